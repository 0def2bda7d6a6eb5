/* Helpers of the tests of the API: a context in memory with guard bytes around it, and images. */
#ifndef TEST_SUPPORT_API_H
#define TEST_SUPPORT_API_H

#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/random.h"
#include "twoview/twoview.h"

enum { API_GUARD_BYTES = 4096, API_PATTERN = 0x5A };

typedef struct api_context {
  uint8_t *block, *memory;
  size_t size_bytes;
  tv_context *context;
} api_context;

/* Returns the status of tv_context_init; on any other than TV_OK the memory is freed. */
static inline tv_status api_try(const tv_limits *limits, api_context *a) {
  uintptr_t start;
  size_t block_bytes;
  tv_status status;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(limits, &a->size_bytes));
  block_bytes = a->size_bytes + 2 * API_GUARD_BYTES + TV_CONTEXT_ALIGNMENT;
  a->block = (uint8_t *)malloc(block_bytes);
  TEST_ASSERT_NOT_NULL(a->block);
  memset(a->block, API_PATTERN, block_bytes);
  start = (uintptr_t)a->block + API_GUARD_BYTES + TV_CONTEXT_ALIGNMENT - 1;
  start = start / TV_CONTEXT_ALIGNMENT * TV_CONTEXT_ALIGNMENT;
  a->memory = a->block + (start - (uintptr_t)a->block);
  status = tv_context_init(&a->context, limits, a->memory, a->size_bytes);
  if (status != TV_OK) free(a->block);
  return status;
}

static inline api_context api_make(const tv_limits *limits) {
  api_context a;
  TEST_ASSERT_EQUAL_INT(TV_OK, api_try(limits, &a));
  return a;
}

/* Fills the array, which has room for all, with a context for each kernel set that this machine
   runs. Returns how many. */
static inline int api_make_all_kernels(tv_limits limits, api_context *contexts) {
  int count = 0;
  for (limits.kernels = TV_KERNELS_C; limits.kernels <= TV_KERNELS_NEON; ++limits.kernels) {
    if (api_try(&limits, &contexts[count]) == TV_OK) ++count;
  }
  TEST_ASSERT_TRUE(count > 0);
  return count;
}

static inline int api_is_pattern(const void *begin, size_t bytes) {
  const uint8_t *b = (const uint8_t *)begin;
  while (bytes > 0 && *b == API_PATTERN) ++b, --bytes;
  return bytes == 0;
}

/* Frees the context. First it checks that nothing outside its memory was written, and that no
   byte above the high water mark changed. */
static inline void api_release(api_context *a) {
  const size_t high_water = tv_context_high_water(a->context);
  TEST_ASSERT_TRUE(high_water <= a->size_bytes);
  TEST_ASSERT_TRUE(api_is_pattern(a->block, (size_t)(a->memory - a->block)));
  TEST_ASSERT_TRUE(api_is_pattern(a->memory + high_water, a->size_bytes - high_water));
  TEST_ASSERT_TRUE(api_is_pattern(a->memory + a->size_bytes, API_GUARD_BYTES));
  free(a->block);
}

static inline tv_image api_image(const uint8_t *data, int32_t width, int32_t height,
                                 int64_t stride_bytes) {
  tv_image image;
  image.data = data;
  image.width = width;
  image.height = height;
  image.stride_bytes = stride_bytes;
  return image;
}

/* Draws bright and dark squares of random places and sizes on noise: many corners, some with
   equal scores. */
static inline void api_draw(uint64_t seed, uint8_t *pixels, int32_t width, int32_t height) {
  int32_t k, x, y;
  for (k = 0; k < width * height; ++k) pixels[k] = (uint8_t)random_int(&seed, 100, 104);
  for (k = 0; k < width * height / 60; ++k) {
    const int32_t side = random_int(&seed, 2, 7), grey = random_int(&seed, 0, 255);
    const int32_t x0 = random_int(&seed, 0, width - 1), y0 = random_int(&seed, 0, height - 1);
    for (y = y0; y < y0 + side && y < height; ++y) {
      for (x = x0; x < x0 + side && x < width; ++x) pixels[y * width + x] = (uint8_t)grey;
    }
  }
}

#endif
