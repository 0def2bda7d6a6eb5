/* Every kernel of every set that this machine runs, against the C set: the same bytes out of random
   and extreme data, odd sizes and misaligned pointers, and nothing written outside the outputs.
   Inputs are heap blocks of the exact size, so the address sanitizer sees a read beyond them.
   The cases come from TVK_LIST, TVK_ODOMETRY_LIST and TVK_DENSE_LIST: a kernel without a case does
   not compile.

   check_kernels          runs the checks
   check_kernels --time   prints nanoseconds per call of typical size, a column per set */
#define _POSIX_C_SOURCE 199309L /* declares clock_gettime */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unity.h>

#include "kernels/dense.h"
#include "kernels/odometry.h"
#include "support/random.h"
#include "twoview/context.h"
#include "twoview/triangulate.h"

#if defined(TWOVIEW_HAS_ODOMETRY)
#define ODOMETRY_KERNELS(X) TVK_ODOMETRY_LIST(X)
#else
#define ODOMETRY_KERNELS(X)
#endif
#if defined(TWOVIEW_HAS_DENSE)
#define DENSE_KERNELS(X) TVK_DENSE_LIST(X)
#else
#define DENSE_KERNELS(X)
#endif
#define ALL_KERNELS(X) TVK_LIST(X) ODOMETRY_KERNELS(X) DENSE_KERNELS(X)

enum { MAX_BLOCKS = 40, GUARD_BYTES = 64, PATTERN = 0xA5, ROUNDS = 600 };

typedef struct block {
  uint8_t *memory, *data;
  size_t bytes;
  int is_output;
} block;

/* One run of a case: the same seed gives the same inputs to every kernel set. */
typedef struct trial {
  const tvk_set *set;
  uint64_t seed;
  int typical;   /* 1: use the sizes of a 640 x 480 image, for --time */
  int64_t calls; /* number of calls of the kernel on the same input */
  block blocks[MAX_BLOCKS];
  int num_lists;
} trial;

static void *take(trial *t, size_t bytes, size_t unit, int is_output) {
  const size_t offset = GUARD_BYTES + unit * (size_t)random_int(&t->seed, 0, 15);
  block *b = &t->blocks[t->num_lists++];
  TEST_ASSERT_TRUE(t->num_lists <= MAX_BLOCKS);
  b->memory = (uint8_t *)malloc(offset + bytes + (is_output ? GUARD_BYTES : 0));
  TEST_ASSERT_NOT_NULL(b->memory);
  b->data = b->memory + offset;
  b->bytes = bytes;
  b->is_output = is_output;
  memset(b->memory, PATTERN, offset + bytes + (is_output ? GUARD_BYTES : 0));
  return b->data;
}

static void release(trial *t) {
  while (t->num_lists > 0) free(t->blocks[--t->num_lists].memory);
}

#define INPUT(t, type, count) ((type *)take(t, (size_t)(count) * sizeof(type), sizeof(type), 0))
#define OUTPUT(t, type, count) ((type *)take(t, (size_t)(count) * sizeof(type), sizeof(type), 1))
#define REPEAT(t, call)                                \
  do {                                                 \
    int64_t left_;                                     \
    for (left_ = (t)->calls; left_ > 0; --left_) call; \
  } while (0)

/* A random size in [low, high], or `typical` for --time. */
static int32_t pick(trial *t, int32_t low, int32_t high, int32_t typical) {
  const int32_t value = random_int(&t->seed, low, high);
  return t->typical ? typical : value;
}

/* Random pixels of one of four sorts: noise; black and white; one grey level; a ramp with small
   steps, where many values are equal. */
static void fill_bytes(trial *t, uint8_t *bytes, int32_t count) {
  const int32_t kind = random_int(&t->seed, 0, 3), base = random_int(&t->seed, 0, 255);
  int32_t k;
  for (k = 0; k < count; ++k) {
    const int32_t noise = random_int(&t->seed, 0, 255);
    bytes[k] = (uint8_t)(kind == 0   ? noise
                         : kind == 1 ? (noise & 1) * 255
                         : kind == 2 ? base
                                     : base + k / 4 + (noise & 3));
  }
}

static uint8_t *row_of_bytes(trial *t, int32_t count) {
  uint8_t *row = INPUT(t, uint8_t, count);
  fill_bytes(t, row, count);
  return row;
}

static void case_fast_score_row(trial *t) {
  const int32_t width = pick(t, 1, 300, 640), arc = pick(t, 9, 12, 12);
  const int32_t extreme = random_int(&t->seed, 0, 3);
  const int32_t threshold = extreme == 0   ? pick(t, 1, 1, 10)
                            : extreme == 1 ? pick(t, 254, 254, 10)
                                           : pick(t, 1, 254, 10);
  const uint8_t *rows[7];
  uint8_t *scores;
  int k;
  for (k = 0; k < 7; ++k) rows[k] = row_of_bytes(t, width);
  scores = OUTPUT(t, uint8_t, width);
  REPEAT(t, tvk_detect_of(t->set)->fast_score_row(rows, width, arc, threshold, scores));
}

static void case_hessian_determinants(trial *t) {
  enum { REACH = TVK_HESSIAN_REACH, LEAST = 2 * REACH + 1 };
  const int32_t stride = pick(t, LEAST, 40, 640), height = pick(t, LEAST, 20, 480);
  const int32_t width = pick(t, LEAST, stride, stride);
  /* The image ends with its last pixel, and in some trials that is the last one the kernel reads.
   */
  const uint8_t *image = row_of_bytes(t, (height - 1) * stride + width);
  int32_t *determinants = OUTPUT(t, int32_t, 2 * TVK_HESSIAN_PLACES), k;
  const uint8_t *centres[2];
  for (k = 0; k < 2; ++k) {
    const int32_t last = random_int(&t->seed, 0, 3) == 0;
    const int32_t x = last ? width - REACH - 1 : random_int(&t->seed, REACH, width - REACH - 1);
    const int32_t y = last ? height - REACH - 1 : random_int(&t->seed, REACH, height - REACH - 1);
    centres[k] = image + y * stride + x;
  }
  REPEAT(t, tvk_detect_of(t->set)->hessian_determinants(centres, stride, determinants));
  /* The eighth entry of a row may hold anything, so it is not compared. */
  for (k = 0; k < 2 * 7; ++k) determinants[8 * k + 7] = 0;
}

static void case_suppress_row(trial *t) {
  const int32_t width = pick(t, 1, 300, 640), room = (width + 1) / 2;
  const int32_t highest = random_int(&t->seed, 0, 1) ? 254 : 2;
  const int32_t sparsity = pick(t, 0, 20, 20);
  uint8_t *rows[3];
  uint16_t *xs;
  int32_t *found, k, x;
  for (k = 0; k < 3; ++k) {
    rows[k] = INPUT(t, uint8_t, width);
    for (x = 0; x < width; ++x) {
      const int32_t score = random_int(&t->seed, 1, highest);
      rows[k][x] = (uint8_t)(random_int(&t->seed, 0, sparsity) == 0 ? score : 0);
    }
  }
  xs = OUTPUT(t, uint16_t, room);
  found = OUTPUT(t, int32_t, 1);
  REPEAT(t, *found = tvk_detect_of(t->set)->suppress_row(rows[0], rows[1], rows[2], width, xs));
  TEST_ASSERT_TRUE(*found >= 0 && *found <= room);
  /* The entries of xs after the columns found may hold anything, so they are not compared. */
  memset(xs + *found, PATTERN, (size_t)(room - *found) * sizeof xs[0]);
}

static void random_weights(trial *t, int32_t weights[3]) {
  weights[0] = random_int(&t->seed, 1, 255);
  weights[1] = random_int(&t->seed, weights[0] == 1, 256 - weights[0] - (weights[0] == 1));
  weights[2] = 256 - weights[0] - weights[1];
}

static void case_average_columns(trial *t) {
  const int32_t out_width = pick(t, 1, 200, 453), padded = (out_width + 15) / 16 * 16;
  const int32_t stride = pick(t, 0, 15, 11), width = padded / 8 * stride + 18;
  int32_t *first = INPUT(t, int32_t, padded / 8), weights[3], x, k;
  uint16_t *picks = INPUT(t, uint16_t, padded), *sums;
  tvk_columns columns;
  /* The block ends with the last pixel of the last columns, so that the address sanitizer reports a
     kernel that reads further ones. */
  const uint8_t *row = row_of_bytes(t, width);
  columns.first = first;
  columns.picks = picks;
  for (k = 0; k < 3; ++k) columns.weights[k] = INPUT(t, uint16_t, padded);
  for (x = 0; x < padded; ++x) {
    first[x / 8] = x / 8 < padded / 8 - 1 ? x / 8 * stride : width - 18;
    picks[x] = (uint16_t)(0xff00 + random_int(&t->seed, 0, 15));
    random_weights(t, weights);
    for (k = 0; k < 3; ++k) columns.weights[k][x] = (uint16_t)weights[k];
  }
  sums = OUTPUT(t, uint16_t, padded);
  REPEAT(t, tvk_detect_of(t->set)->average_columns(row, &columns, out_width, sums));
  /* The sums after the last column may hold anything, so they are not compared. */
  for (x = out_width; x < padded; ++x) sums[x] = 0;
}

static void case_average_rows(trial *t) {
  const int32_t width = pick(t, 16, 300, 453);
  const uint16_t *rows[3];
  int32_t weights[3], k, x;
  uint8_t *out;
  for (k = 0; k < 3; ++k) {
    uint16_t *row = INPUT(t, uint16_t, width);
    const int32_t lowest = random_int(&t->seed, 0, 1) * 65000;
    for (x = 0; x < width; ++x) row[x] = (uint16_t)random_int(&t->seed, lowest, 65280);
    rows[k] = row;
  }
  random_weights(t, weights);
  out = OUTPUT(t, uint8_t, width);
  REPEAT(t, tvk_detect_of(t->set)->average_rows(rows, weights, width, out));
}

static void case_squeeze_row(trial *t) {
  const int32_t width = pick(t, 1, 300, 640), out_width = pick(t, 1, 400, 640);
  const int32_t step = 65536 + random_int(&t->seed, 0, 3 * 65536);
  const int32_t begin = random_int(&t->seed, -200 * 65536, 200 * 65536);
  const uint8_t *row = row_of_bytes(t, width);
  uint32_t *sums = OUTPUT(t, uint32_t, width);
  uint16_t *out = OUTPUT(t, uint16_t, out_width);
  REPEAT(t, tvk_squeeze_of(t->set)->squeeze_row(row, width, begin, step, out_width, sums, out));
  memset(sums, 0, (size_t)width * sizeof *sums); /* unspecified, so not compared */
}

static void case_mix_rows(trial *t) {
  const int32_t width = pick(t, 1, 300, 640);
  const uint16_t *rows[TVK_MIX_ROWS];
  int32_t weights[TVK_MIX_ROWS], rest = 256, k, x;
  uint8_t *out;
  for (k = 0; k < TVK_MIX_ROWS; ++k) {
    uint16_t *row = INPUT(t, uint16_t, width);
    const int32_t lowest = random_int(&t->seed, 0, 1) * 65000;
    for (x = 0; x < width; ++x) row[x] = (uint16_t)random_int(&t->seed, lowest, 65280);
    rows[k] = row;
    weights[k] = k + 1 < TVK_MIX_ROWS ? random_int(&t->seed, 0, rest) : rest;
    rest -= weights[k];
  }
  out = OUTPUT(t, uint8_t, width);
  REPEAT(t, tvk_squeeze_of(t->set)->mix_rows(rows, weights, width, out));
}

static void case_halve_row(trial *t) {
  const int32_t out_width = pick(t, 1, 200, 320);
  const uint8_t *a = row_of_bytes(t, 2 * out_width), *b = row_of_bytes(t, 2 * out_width);
  uint8_t *out = OUTPUT(t, uint8_t, out_width);
  REPEAT(t, tvk_detect_of(t->set)->halve_row(a, b, out_width, out));
}

static void case_blur_row(trial *t) {
  const int32_t width = pick(t, 1, 700, 640);
  const uint8_t *above = row_of_bytes(t, width), *row = row_of_bytes(t, width);
  const uint8_t *below = random_int(&t->seed, 0, 3) == 0 ? row : row_of_bytes(t, width);
  uint8_t *out = OUTPUT(t, uint8_t, width);
  REPEAT(t, tvk_describe_of(t->set)->blur_row(above, row, below, width, out));
}

static void case_pair_rows(trial *t) {
  const int32_t width = pick(t, 1, 300, 640);
  const uint8_t *row = row_of_bytes(t, width);
  const uint8_t *below = random_int(&t->seed, 0, 3) == 0 ? row : row_of_bytes(t, width);
  uint16_t *pairs = OUTPUT(t, uint16_t, width + 1);
  REPEAT(t, tvk_describe_of(t->set)->pair_rows(row, below, width, pairs));
}

static void case_sample_patch(trial *t) {
  static const int32_t heights[4] = {TVK_PATCH_SIDE, TVK_ORIENT_SIDE, 1, 7};
  const int32_t width = pick(t, 1, 90, 640), height = pick(t, 1, 90, 480);
  const int32_t num_rows = t->typical ? TVK_PATCH_SIDE : heights[random_int(&t->seed, 0, 3)];
  const int32_t num_pairs = height * (width + 1); /* a kernel must not read further ones */
  /* Steps from zero to far beyond the image. Whole steps from a whole position end exactly on
     the last column or row. */
  const int32_t whole = random_int(&t->seed, 0, 3) == 0;
  const int32_t farthest = random_int(&t->seed, 0, 7) == 0 ? 160 << 16 : 2 << 16;
  const int32_t margin = 40 << 16;
  int32_t du_x = pick(t, -farthest, farthest, 80000), du_y = pick(t, -farthest, farthest, 40000);
  int32_t x = pick(t, -margin, (width << 16) + margin, 300 << 16);
  int32_t y = pick(t, -margin, (height << 16) + margin, 200 << 16);
  uint16_t *pairs = INPUT(t, uint16_t, num_pairs);
  int16_t *patch = OUTPUT(t, int16_t, num_rows * TVK_PATCH_SIDE + 1);
  fill_bytes(t, (uint8_t *)pairs, 2 * num_pairs);
  if (whole) {
    x = random_int(&t->seed, 0, width) << 16;
    y = random_int(&t->seed, 0, height) << 16;
    du_x = 1 << 16;
    du_y = 0;
  }
  if (!t->typical && random_int(&t->seed, 0, 2) == 0) { /* upright */
    du_x = random_int(&t->seed, 0, 5 << 15);
    du_y = 0;
  }
  REPEAT(t, tvk_describe_of(t->set)->sample_patch(pairs, width, height, x, y, du_x, du_y, num_rows,
                                                  patch));
}

/* The range of the samples that sample_patch makes: -LOWEST_SAMPLE to LARGEST_SAMPLE. */
enum {
  LOWEST_SAMPLE = 8065,
  LARGEST_SAMPLE = 8001,
  SAMPLE_RANGE = LOWEST_SAMPLE + LARGEST_SAMPLE + 1
};

/* num_patches patches that follow each other, and a 0. */
static const int16_t *random_patches(trial *t, int32_t num_patches, int32_t num_rows) {
  const int32_t kind = random_int(&t->seed, 0, 4), base = random_int(&t->seed, 0, 8000);
  const int32_t size = num_patches * num_rows * TVK_PATCH_SIDE;
  int16_t *patch = INPUT(t, int16_t, size + 1);
  int32_t k;
  for (k = 0; k < size; ++k) {
    const int32_t noise = random_int(&t->seed, 0, SAMPLE_RANGE - 1);
    const int32_t x = k % TVK_PATCH_SIDE, y = k / TVK_PATCH_SIDE;
    patch[k] = (int16_t)((kind == 0   ? noise
                          : kind == 1 ? (noise & 1) * (SAMPLE_RANGE - 1)
                          : kind == 2 ? base + noise % 3
                          : kind == 3 ? ((x + y) & 1) * (SAMPLE_RANGE - 1)
                                      : (y * 531 + x * 257) % SAMPLE_RANGE) -
                         LOWEST_SAMPLE);
  }
  patch[size] = 0;
  return patch;
}

static void case_orientation_histogram(trial *t) {
  const int16_t *patch = random_patches(t, 1, TVK_ORIENT_SIDE);
  int32_t *smooth = OUTPUT(t, int32_t, TVK_ORIENT_BINS + 2), *peaks = OUTPUT(t, int32_t, 2);
  REPEAT(t, tvk_describe_of(t->set)->orientation_histogram(patch, smooth, peaks));
}

static void case_gradient_histogram(trial *t) {
  const int32_t num_patches = pick(t, 1, 2, 1);
  const int16_t *patches = random_patches(t, num_patches, TVK_PATCH_SIDE);
  int32_t *histogram = OUTPUT(t, int32_t, TVK_DESCRIPTOR_SIZE), k;
  REPEAT(t, tvk_describe_of(t->set)->gradient_histogram(patches, num_patches, histogram));
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) TEST_ASSERT_TRUE(histogram[k] >= 0);
}

/* An image that ends with its last pixel, as long rows as it is wide in some trials. */
static const uint8_t *window_image(trial *t, int32_t *width, int32_t *height, int32_t *stride) {
  *width = pick(t, 18, 60, 640);
  *height = pick(t, 18, 60, 480);
  *stride = *width + pick(t, 0, 3, 0);
  return row_of_bytes(t, (*height - 1) * *stride + *width);
}

/* Random, or as far as the first sample may lie with `reach` to the last one; in 1/65536 pixel. */
static int32_t window_start(trial *t, int32_t pixels, int32_t reach_below, int32_t reach) {
  const int32_t low = 65536 + reach_below, high = ((pixels - 2) << 16) - 1 - reach;
  const int32_t extreme = random_int(&t->seed, 0, 5);
  const int32_t x = random_int(&t->seed, low, high);
  return extreme == 0 ? low : extreme == 1 ? high : x;
}

static void case_window_template(trial *t) {
  int32_t width, height, stride;
  const uint8_t *pixels = window_image(t, &width, &height, &stride);
  const int32_t step = random_int(&t->seed, 0, 3) == 0 ? 65536 : pick(t, 40000, 98304, 80000);
  const int32_t x = window_start(t, width, 0, 9 * step), y = window_start(t, height, 0, 9 * step);
  int16_t *channels = OUTPUT(t, int16_t, TVK_WINDOW_CHANNELS * TVK_WINDOW_SAMPLES);
  int32_t *products = OUTPUT(t, int32_t, TVK_WINDOW_PRODUCTS);
  REPEAT(t, tvk_align_of(t->set)->window_template(pixels, stride, width, x, y, step, channels,
                                                  products));
}

/* How far the samples lie from the first one, before and after it, along one axis. */
static void window_reach(const int32_t *map, int32_t reach[2]) {
  int k;
  reach[0] = reach[1] = 0;
  for (k = 0; k < 2; ++k) {
    if (map[k] < 0) reach[0] -= (TVK_WINDOW_SIDE - 1) * map[k];
    if (map[k] > 0) reach[1] += (TVK_WINDOW_SIDE - 1) * map[k];
  }
}

static void case_window_sums(trial *t) {
  enum { LIMIT = TVK_WINDOW_CHANNELS * TVK_WINDOW_SAMPLES };
  int32_t width, height, stride, k, map[4], reach[2][2];
  const uint8_t *pixels = window_image(t, &width, &height, &stride);
  const int32_t largest = random_int(&t->seed, 0, 1) ? 65536 : 1000; /* of 7 map + 7 map <= 15 px */
  int16_t *channels = INPUT(t, int16_t, LIMIT);
  int32_t *sums = OUTPUT(t, int32_t, TVK_WINDOW_SUMS);
  for (k = 0; k < 4; ++k) map[k] = pick(t, -largest, largest, k == 1 ? -20000 : 60000);
  for (k = 0; k < LIMIT; ++k) {
    channels[k] = (int16_t)(k < TVK_WINDOW_SAMPLES ? random_int(&t->seed, 600, 3947)
                                                   : random_int(&t->seed, -4032, 4032));
  }
  window_reach(map, reach[0]);
  window_reach(map + 2, reach[1]);
  {
    const int32_t x = window_start(t, width, reach[0][0], reach[0][1]);
    const int32_t y = window_start(t, height, reach[1][0], reach[1][1]);
    REPEAT(t, tvk_align_of(t->set)->window_sums(pixels, stride, x, y, map, channels, sums));
  }
}

static void case_quantize_descriptors(trial *t) {
  static const int32_t highest[6] = {0, 1, 300, 4096, 1 << 18, INT32_MAX};
  const int32_t count = random_int(&t->seed, 1, TVK_QUANTIZED), root = pick(t, 0, 1, 1);
  int32_t *histograms = INPUT(t, int32_t, count * TVK_DESCRIPTOR_SIZE), n, k;
  uint8_t *descriptors = OUTPUT(t, uint8_t, count * TVK_DESCRIPTOR_SIZE);
  for (n = 0; n < count; ++n) {
    const int32_t high = t->typical ? 1 << 18 : highest[random_int(&t->seed, 0, 5)];
    const int32_t spikes = random_int(&t->seed, 0, 2) == 0;
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
      const int32_t value = random_int(&t->seed, 0, high);
      histograms[n * TVK_DESCRIPTOR_SIZE + k] =
          spikes && random_int(&t->seed, 0, 63) > 0 ? 0 : value;
    }
  }
  REPEAT(t, tvk_describe_of(t->set)->quantize_descriptors(histograms, count, root, descriptors));
}

static int is_pattern(const uint8_t *begin, const uint8_t *end) {
  for (; begin < end; ++begin) {
    if (*begin != PATTERN) return 0;
  }
  return 1;
}

/* Random descriptors, with equal ones, near copies of each other, and extreme values. */
static uint8_t *random_descriptors(trial *t, int32_t count, const uint8_t *similar, int32_t num) {
  const int32_t kind = random_int(&t->seed, 0, 4);
  uint8_t *rows = INPUT(t, uint8_t, count * TVK_DESCRIPTOR_SIZE);
  int32_t i, k;
  for (i = 0; i < count; ++i) {
    uint8_t *const row = rows + i * TVK_DESCRIPTOR_SIZE;
    const int32_t copy = num > 0 ? random_int(&t->seed, 0, num - 1) : -1;
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
      const int32_t noise = random_int(&t->seed, 0, 255);
      row[k] = (uint8_t)(kind == 0   ? noise
                         : kind == 1 ? (noise & 1) * 255
                         : kind == 2 ? (k < 3 ? noise & 1 : 0)
                                     : noise * noise / 400);
      if (kind == 4 && copy >= 0) {
        row[k] = similar[copy * TVK_DESCRIPTOR_SIZE + k];
        if (noise == 0) row[k] = (uint8_t)(row[k] ^ 1);
      }
    }
    if (random_int(&t->seed, 0, 40) == 0) memset(row, i % 2 * 255, TVK_DESCRIPTOR_SIZE);
  }
  return rows;
}

static int32_t distance_of(const uint8_t *a, const uint8_t *b) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

static tvk_descriptors in_any_order(trial *t, const uint8_t *bytes, int32_t num) {
  uint16_t *order = INPUT(t, uint16_t, num);
  tvk_descriptors set;
  int32_t k;
  for (k = 0; k < num; ++k) {
    const int32_t other = random_int(&t->seed, 0, k);
    order[k] = order[other];
    order[other] = (uint16_t)k;
  }
  set.bytes = bytes;
  set.order = order;
  set.num = num;
  return set;
}

/* A list is right if it ascends, each entry is the distance of its group's nearest member, which
   the entry names, and no descriptor of another group is nearer than both the last entry and the
   odd entry of its bin. Entries depend on the set, but for the smallest distance; the list is
   replaced by it. */
static void check_list(const uint8_t *query, const tvk_descriptors *set, int32_t group,
                       int32_t bins, tvk_nearest *list) {
  int32_t least[TVK_NEAREST_LIST], smallest = TVK_NEAREST_NONE, rank, k;
  for (k = 0; k < TVK_NEAREST_LIST; ++k) least[k] = TVK_NEAREST_NONE;
  for (rank = 0; rank < set->num; ++rank) {
    const int32_t dist =
        distance_of(query, set->bytes + (size_t)set->order[rank] * TVK_DESCRIPTOR_SIZE);
    int32_t listed = 0, bound = list->keys[TVK_NEAREST_LIST - 1] >> 1;
    if (dist < smallest) smallest = dist;
    for (k = 0; k < TVK_NEAREST_LIST; ++k) {
      const int32_t listed_group = list->ranks[k] / group, of_list = list->keys[k] >> 1;
      if (of_list >= TVK_NEAREST_NONE) continue;
      if (list->keys[k] % 2 != 0 && listed_group % bins == rank / group % bins && of_list < bound) {
        bound = of_list;
      }
      if (listed_group != rank / group) continue;
      TEST_ASSERT_FALSE(listed);
      listed = 1;
      if (dist < least[k]) least[k] = dist;
      if (rank == list->ranks[k]) TEST_ASSERT_EQUAL_INT(dist, of_list);
    }
    if (!(listed || dist >= bound)) {
      printf("n %d group %d bins %d rank %d dist %d bound %d\n", set->num, group, bins, rank, dist,
             bound);
      for (k = 0; k < 6; k++) printf(" %d:%d", list->keys[k], list->ranks[k]);
      puts("");
    }
    TEST_ASSERT_TRUE(listed || dist >= bound);
  }
  for (k = 0; k < TVK_NEAREST_LIST; ++k) {
    const int32_t of_list = list->keys[k] >> 1;
    TEST_ASSERT_EQUAL_INT(least[k], of_list < TVK_NEAREST_NONE ? of_list : TVK_NEAREST_NONE);
    TEST_ASSERT_TRUE(of_list >= TVK_NEAREST_NONE || list->ranks[k] < set->num);
    TEST_ASSERT_TRUE(k == 0 || list->keys[k - 1] <= list->keys[k]);
  }
  TEST_ASSERT_EQUAL_INT(smallest, least[0]);
  memset(list, 0, sizeof *list);
  list->keys[0] = smallest;
}

/* The list of the column of that rank. */
static tvk_nearest list_of(const tvk_nearest_lists *of_columns, int32_t rank) {
  const tvk_nearest_lists *lists = &of_columns[TVK_NEAREST_NUMBER(rank)];
  tvk_nearest list;
  int32_t k;
  for (k = 0; k < TVK_NEAREST_LIST; ++k) {
    list.keys[k] = lists->entries[k].keys[TVK_NEAREST_LANE(rank)];
    list.ranks[k] = lists->entries[k].ranks[TVK_NEAREST_LANE(rank)];
  }
  return list;
}

static void case_nearest_groups(trial *t) {
  /* A few trials have more rows or columns than a kernel handles at a time. */
  const int32_t many = random_int(&t->seed, 0, 59);
  const int32_t num_rows = pick(t, 0, many == 0 ? 2000 : 40, 1000);
  const int32_t num_columns = pick(t, 0, many == 1 ? TVK_NEAREST_PANEL + 300 : 150, 1000);
  const uint8_t *row_bytes = random_descriptors(t, num_rows, NULL, 0);
  const uint8_t *column_bytes = random_descriptors(t, num_columns, row_bytes, num_rows);
  const tvk_descriptors rows = in_any_order(t, row_bytes, num_rows);
  const tvk_descriptors columns = in_any_order(t, column_bytes, num_columns);
  const size_t scratch_bytes = TVK_NEAREST_SCRATCH(num_rows, num_columns);
  uint8_t *scratch = OUTPUT(t, uint8_t, scratch_bytes + 64), *aligned = scratch;
  const int32_t num_lists = TVK_NEAREST_LISTS(num_columns);
  tvk_nearest_lists *of_columns = OUTPUT(t, tvk_nearest_lists, num_lists);
  tvk_nearest *of_rows = OUTPUT(t, tvk_nearest, num_rows);
  tvk_nearest_shape shape = {0, 0, 0};
  int32_t k;
  while ((uintptr_t)aligned % 64 != 0) ++aligned;
  REPEAT(t, shape = tvk_match_of(t->set)->nearest_groups(&rows, &columns, aligned, of_columns,
                                                         of_rows));
  TEST_ASSERT_TRUE(is_pattern(scratch, aligned));
  TEST_ASSERT_TRUE(is_pattern(aligned + scratch_bytes, scratch + scratch_bytes + 64));
  memset(scratch, PATTERN, scratch_bytes + 64);
  if (t->typical) return; /* timing */
  for (k = 0; k < num_rows; ++k) {
    check_list(row_bytes + k * TVK_DESCRIPTOR_SIZE, &columns, TVK_NEAREST_GROUP, shape.column_bins,
               &of_rows[k]);
  }
  for (k = 0; k < num_columns; ++k) {
    tvk_nearest list = list_of(of_columns, k);
    check_list(column_bytes + columns.order[k] * TVK_DESCRIPTOR_SIZE, &rows, shape.row_group,
               shape.row_bins, &list);
  }
  memset(of_columns, 0, (size_t)num_lists * sizeof *of_columns);
}

static void case_squared_distances(trial *t) {
  const int32_t num_rows = pick(t, 1, 40, 1000), count = pick(t, 0, 60, 20);
  const uint8_t *query = random_descriptors(t, 1, NULL, 0);
  const uint8_t *rows = random_descriptors(t, num_rows, query, 1);
  int32_t *indices = INPUT(t, int32_t, count), *out = OUTPUT(t, int32_t, count), k;
  for (k = 0; k < count; ++k) indices[k] = random_int(&t->seed, 0, num_rows - 1);
  REPEAT(t, tvk_match_of(t->set)->squared_distances(query, rows, indices, count, out));
}

/* Rays near the axis, with slopes of a lens whose focal length is about 500 pixels. In three of
   four trials entries are extreme: one of each array is 1e60 times as large, or one of each is
   0, or all are 0. */
static void fill_matches(trial *t, double *const *arrays, int32_t n, int32_t on_plane) {
  const int32_t extreme = random_int(&t->seed, 0, 3);
  int32_t a, i;
  for (a = 0; a < 18; ++a) {
    const int32_t is_ray = a < 6, last = is_ray ? a % 3 == 2 : a % 6 >= 4;
    for (i = 0; i < n; ++i) {
      const double noise = 2 * random_unit(&t->seed) - 1;
      arrays[a][i] = is_ray ? (last ? 1 : 0.6 * noise) : 0.002 * noise;
      if (last && on_plane) arrays[a][i] = is_ray ? 1 : 0;
    }
    if (extreme == 0) arrays[a][random_int(&t->seed, 0, n - 1)] *= 1e60;
    if (extreme == 1) arrays[a][random_int(&t->seed, 0, n - 1)] = 0;
    if (extreme == 2) memset(arrays[a], 0, (size_t)n * sizeof arrays[a][0]);
  }
}

typedef struct match_arrays {
  int32_t n, on_plane, count, first;
  double *arrays[18], *m;
  const double *read[18];
  int32_t *indices;
} match_arrays;

static match_arrays take_matches(trial *t) {
  match_arrays a;
  int32_t k;
  a.n = pick(t, 1, 100, 500);
  a.on_plane = pick(t, 0, 1, 1);
  for (k = 0; k < 18; ++k) a.arrays[k] = INPUT(t, double, a.n);
  fill_matches(t, a.arrays, a.n, a.on_plane);
  for (k = 0; k < 18; ++k) a.read[k] = a.arrays[k];
  a.m = INPUT(t, double, 9);
  for (k = 0; k < 9; ++k) a.m[k] = 2 * random_unit(&t->seed) - 1;
  if (random_int(&t->seed, 0, 9) == 0) memset(a.m, 0, 9 * sizeof a.m[0]);
  a.first = pick(t, 0, a.n - 1, 0);
  a.count = pick(t, 0, a.n - a.first, a.n);
  a.indices = NULL;
  if (random_int(&t->seed, 0, 1)) {
    a.indices = INPUT(t, int32_t, a.count);
    for (k = 0; k < a.count; ++k) a.indices[k] = random_int(&t->seed, 0, a.n - 1);
  }
  return a;
}

static void case_sampson_squares(trial *t) {
  const match_arrays a = take_matches(t);
  double *squares = OUTPUT(t, double, a.count);
  REPEAT(t, tvk_geometry_of(t->set)->sampson_squares(a.read, a.indices, a.first, a.count,
                                                     a.on_plane, a.m, squares));
}

static void case_pose_squares(trial *t) {
  const match_arrays a = take_matches(t);
  const double *read[19];
  double *angle = INPUT(t, double, a.n), *pose = INPUT(t, double, 21);
  double *squares = OUTPUT(t, double, a.count);
  int32_t k;
  for (k = 0; k < 18; ++k) read[k] = a.read[k];
  for (k = 0; k < a.n; ++k) angle[k] = 0.01 * random_unit(&t->seed);
  for (k = 0; k < 21; ++k) pose[k] = 2 * random_unit(&t->seed) - 1;
  read[18] = angle;
  REPEAT(t, tvk_geometry_of(t->set)->pose_squares(read, a.first, a.count, a.on_plane, pose, 1.5,
                                                  squares));
}

static void case_transfer_squares(trial *t) {
  const match_arrays a = take_matches(t);
  double *squares = OUTPUT(t, double, a.count);
  REPEAT(t, tvk_geometry_of(t->set)->transfer_squares(a.read, a.indices, a.first, a.count,
                                                      a.on_plane, a.m, squares));
}

typedef void sums_kernel(const double *const *, const int32_t *, int32_t, int32_t, int32_t,
                         const double *, double, int32_t, double *);

static void check_sums(trial *t, sums_kernel *kernel, int32_t num_sums) {
  const match_arrays a = take_matches(t);
  const int32_t cauchy = random_int(&t->seed, 0, 1);
  double *sums = OUTPUT(t, double, num_sums *TVK_WIDTH);
  int32_t k;
  for (k = 0; k < num_sums * TVK_WIDTH; ++k) sums[k] = k / TVK_WIDTH == num_sums - 1;
  REPEAT(t, kernel(a.read, a.indices, a.first, a.count, a.on_plane, a.m, 1.0, cauchy, sums));
}

static void case_sampson_sums(trial *t) {
  check_sums(t, tvk_geometry_of(t->set)->sampson_sums, TVK_SAMPSON_SUMS);
}

static void case_transfer_sums(trial *t) {
  check_sums(t, tvk_geometry_of(t->set)->transfer_sums, TVK_TRANSFER_SUMS);
}

static void case_sampson_score(trial *t) {
  const int32_t num_lists = pick(t, 0, 8, 16), on_plane = pick(t, 0, 1, 1);
  const int32_t n = num_lists * TVK_SCORE_BLOCK, scale = random_int(&t->seed, 0, 2);
  const float inverse_sq = scale == 0 ? 1e-18f : scale == 1 ? 1.0f : 1e37f;
  const int32_t first_block = pick(t, 0, num_lists, 0);
  const float *read[18];
  float *m = INPUT(t, float, 9);
  int64_t *score = OUTPUT(t, int64_t, 1);
  int32_t k, i;
  for (k = 0; k < 18; ++k) {
    float *array = INPUT(t, float, n);
    const int32_t is_slope = on_plane ? k >= 4 : k >= 6;
    for (i = 0; i < n; ++i) {
      const float noise = (float)(2 * random_unit(&t->seed) - 1);
      array[i] = is_slope ? (on_plane && k % 3 == 2 ? 0.0f : 4e-6f) + 1e-6f * noise : noise;
      if (random_int(&t->seed, 0, 50) == 0) array[i] *= 1e30f;
      if (random_int(&t->seed, 0, 50) == 0) array[i] = 0;
    }
    read[k] = array;
  }
  for (k = 0; k < 9; ++k) m[k] = (float)(2 * random_unit(&t->seed) - 1);
  REPEAT(t, *score = tvk_geometry_of(t->set)->sampson_score(
                read, first_block, num_lists - first_block, on_plane, m, inverse_sq));
}

/* Rays of random points seen from two places; some samples are degenerate: equal matches, zeros. */
static void case_relpose_5pt(trial *t) {
  const int32_t num_samples = pick(t, 1, TVK_WIDTH, TVK_WIDTH);
  const double span = random_int(&t->seed, 0, 1) ? 1 : 1e-3;
  double *rays = INPUT(t, double, 30 * TVK_WIDTH);
  double *essentials = OUTPUT(t, double, 9 * TVK_RELPOSE_MODELS * TVK_WIDTH);
  int32_t *counts = OUTPUT(t, int32_t, TVK_WIDTH), s, k, c;
  for (s = 0; s < TVK_WIDTH; ++s) {
    const int32_t kind = random_int(&t->seed, 0, 9);
    double move[3];
    for (c = 0; c < 3; ++c) move[c] = 2 * random_unit(&t->seed) - 1;
    for (k = 0; k < 5; ++k) {
      const double depth = 2 + 6 * random_unit(&t->seed);
      for (c = 0; c < 3; ++c) {
        const double x = c == 2 ? depth : depth * span * (2 * random_unit(&t->seed) - 1);
        rays[TVK_WIDTH * (6 * k + c) + s] = kind == 0 ? 0 : kind == 1 ? 1 : x;
        rays[TVK_WIDTH * (6 * k + 3 + c) + s] = kind == 0   ? 0
                                                : kind == 1 ? 1
                                                : kind == 2 ? x
                                                            : x + move[c];
      }
    }
  }
  REPEAT(t, tvk_geometry_of(t->set)->relpose_5pt(rays, num_samples, essentials, counts));
  for (s = 0; s < TVK_WIDTH; ++s) { /* outputs beyond the models found are not compared */
    const int32_t count = s < num_samples ? counts[s] : 0;
    TEST_ASSERT_TRUE(count >= 0 && count <= TVK_RELPOSE_MODELS);
    if (s >= num_samples) counts[s] = 0;
    memset(essentials + 9 * (TVK_RELPOSE_MODELS * s + count), PATTERN,
           (size_t)(TVK_RELPOSE_MODELS - count) * 9 * sizeof essentials[0]);
  }
}

/* Points in front of and behind two cameras, far points, pixels that belong to no point, and
   some NaN. */
static void case_triangulate(trial *t) {
  const int32_t num = pick(t, 0, 100, 500), method = random_int(&t->seed, 0, 2);
  const double angle = random_unit(&t->seed) - 0.5, sine = sin(angle), cosine = cos(angle);
  const double R[9] = {cosine, 0, sine, 0, 1, 0, -sine, 0, cosine};
  double *pixels0 = INPUT(t, double, 2 * num), *pixels1 = INPUT(t, double, 2 * num);
  tvk_triangulate_pair *pair = INPUT(t, tvk_triangulate_pair, 1);
  tv_point *points = OUTPUT(t, tv_point, num);
  int32_t *any = OUTPUT(t, int32_t, 1), expected = 0, k, c;
  for (k = 0; k < 4; ++k) {
    pair->focal[k] = 500 + k;
    pair->inverse_focal[k] = 1 / pair->focal[k];
    pair->principal[k] = 320 - 40 * k;
  }
  memcpy(pair->R, R, sizeof R);
  for (c = 0; c < 3; ++c) pair->direction[c] = c == 0 ? -0.8 : c == 1 ? 0 : 0.6;
  for (c = 0; c < 3; ++c) pair->center1[c] = 0.8 * R[c] - 0.6 * R[6 + c];
  pair->baseline = 0.1;
  pair->parallel_sine_sq = 1e-29;
  for (k = 0; k < num; ++k) {
    const int32_t kind = random_int(&t->seed, 0, 9);
    const double depth = kind == 0 ? -4 : kind == 1 ? 1e9 : 1 + 9 * random_unit(&t->seed);
    double X[3], Y[3];
    for (c = 0; c < 3; ++c) X[c] = c == 2 ? depth : depth * (2 * random_unit(&t->seed) - 1);
    for (c = 0; c < 3; ++c) {
      Y[c] = R[3 * c] * X[0] + R[3 * c + 1] * X[1] + R[3 * c + 2] * X[2] + pair->direction[c];
    }
    for (c = 0; c < 2; ++c) {
      const double noise = kind == 2 ? 100 : 1;
      pixels0[2 * k + c] =
          pair->focal[c] * X[c] / X[2] + pair->principal[c] + random_unit(&t->seed);
      pixels1[2 * k + c] =
          pair->focal[2 + c] * Y[c] / Y[2] + pair->principal[2 + c] + noise * random_unit(&t->seed);
    }
    if (kind == 3) pixels0[2 * k] = random_int(&t->seed, 0, 1) ? 1e200 : NAN;
  }
  REPEAT(t,
         *any = tvk_geometry_of(t->set)->triangulate(pair,
                                                     method == 0   ? TV_TRIANGULATION_MIDPOINT
                                                     : method == 1 ? TV_TRIANGULATION_LINEAR_LS
                                                                   : TV_TRIANGULATION_ITERATIVE_LS,
                                                     pixels0, pixels1, num, points));
  for (k = 0; k < num; ++k) expected |= points[k].status < 0;
  TEST_ASSERT_EQUAL_INT(expected, *any);
}

#if defined(TWOVIEW_HAS_ODOMETRY)
static void case_sighting_costs(trial *t) {
  const int32_t first = TVK_SIGHTING_BLOCK * pick(t, 0, 2, 0), num = first + TVK_SIGHTING_BLOCK;
  const float *arrays[12];
  float *pose = INPUT(t, float, 12);
  int32_t *out = OUTPUT(t, int32_t, 1), k, n;
  for (k = 0; k < 12; ++k) {
    float *numbers = INPUT(t, float, num);
    /* Points around the origin, rows of J of 500 pixels, axes near z. */
    const double size = k < 3 ? 1 : k < 9 ? 500 : 0.1;
    for (n = 0; n < num; ++n) {
      numbers[n] = (float)(size * (2 * random_unit(&t->seed) - 1) + (k == 11 ? 1 : 0));
      if (!t->typical && random_int(&t->seed, 0, 99) == 0) numbers[n] = n % 2 ? NAN : 1e30f;
    }
    pose[k] = (float)(2 * random_unit(&t->seed) - 1 + (k == 11 ? 2 : 0));
    arrays[k] = numbers;
  }
  /* From thresholds that hardly any match meets to such that nearly all do. */
  REPEAT(t, *out = tvk_odometry_of(t->set)->sighting_costs(
                arrays, first, pose, (float)pow(10, -random_int(&t->seed, 2, 6))));
}

static void case_subtract_products(trial *t) {
  const int32_t num_rows = pick(t, 1, 20, 10), num_entries = 18 * num_rows * (num_rows + 1);
  double *entries = OUTPUT(t, double, num_entries), *columns = INPUT(t, double, 18 * num_rows);
  int32_t *blocks = INPUT(t, int32_t, num_rows), num = 0, k;
  for (k = 0; k < num_rows; ++k) {
    if (t->typical || random_int(&t->seed, 0, 2) > 0) blocks[num++] = k;
  }
  for (k = 0; k < num_entries; ++k) entries[k] = 2 * random_unit(&t->seed) - 1;
  for (k = 0; k < 18 * num_rows; ++k) columns[k] = 2 * random_unit(&t->seed) - 1;
  REPEAT(t,
         tvk_odometry_of(t->set)->subtract_products(entries, columns, 6 * num_rows, blocks, num));
}

static void case_add_observation(trial *t) {
  const int32_t num_blocks = pick(t, 1, 5, 5), pitch = 6 * pick(t, 1, 5, 5);
  const int32_t num_entries = 18 * num_blocks * (num_blocks + 1);
  double *observation = INPUT(t, double, 9), *R = INPUT(t, double, 9),
         *linear = INPUT(t, double, 9);
  double *sums = OUTPUT(t, double, 9), *entries = OUTPUT(t, double, num_entries);
  double *diagonal = OUTPUT(t, double, 6 * num_blocks);
  double *gradient = OUTPUT(t, double, 6 * num_blocks);
  double *columns = OUTPUT(t, double, 2 * pitch + 6);
  const tvk_reduced_system system = {entries, diagonal, gradient};
  /* -1: the view is held. */
  const int32_t idx = t->typical ? num_blocks - 1 : random_int(&t->seed, -1, num_blocks - 1);
  int32_t k;
  for (k = 0; k < 9; ++k) {
    observation[k] = 2 * random_unit(&t->seed) - 1;
    R[k] = 2 * random_unit(&t->seed) - 1;
    linear[k] = 2 * random_unit(&t->seed) - 1;
    sums[k] = 2 * random_unit(&t->seed) - 1;
  }
  /* Without a loss, nothing is weighed. */
  if (random_int(&t->seed, 0, 2) == 0) linear[6] = linear[7] = 1, linear[8] = 0;
  for (k = 0; k < num_entries; ++k) entries[k] = 2 * random_unit(&t->seed) - 1;
  for (k = 0; k < 2 * pitch + 6; ++k) columns[k] = 2 * random_unit(&t->seed) - 1;
  for (k = 0; k < 6 * num_blocks; ++k) gradient[k] = 2 * random_unit(&t->seed) - 1;
  for (k = 0; k < 6 * num_blocks; ++k) diagonal[k] = 2 * random_unit(&t->seed) - 1;
  REPEAT(t, tvk_odometry_of(t->set)->add_observation(observation, R, linear, sums, &system, idx,
                                                     columns, pitch));
}
#endif

#if defined(TWOVIEW_HAS_DENSE)
enum { DENSE_FRAME = 2 * TVK_DENSE_BLOCK };

/* Random bytes, some of them 0 and some stretches equal, with a frame before and behind; returns
   where the frame ends. */
static uint8_t *dense_bytes(trial *t, int32_t count, int32_t most) {
  uint8_t *bytes = INPUT(t, uint8_t, count + 2 * DENSE_FRAME);
  const int kind = random_int(&t->seed, 0, 3);
  int32_t k;
  for (k = 0; k < count + 2 * DENSE_FRAME; ++k) {
    const int32_t value = random_int(&t->seed, 0, most);
    bytes[k] = (uint8_t)(kind == 0                                      ? value
                         : kind == 1 && k > 0                           ? bytes[k - 1]
                         : kind == 2 && random_int(&t->seed, 0, 9) == 0 ? 0
                                                                        : most / 2 + value % 8);
  }
  return bytes + DENSE_FRAME;
}

static void case_census_codes(trial *t) {
  const int32_t width = pick(t, 5, 200, 640), tolerance = random_int(&t->seed, 0, 40);
  uint8_t *brighter = OUTPUT(t, uint8_t, width + TVK_DENSE_BLOCK);
  uint8_t *darker = OUTPUT(t, uint8_t, width + TVK_DENSE_BLOCK);
  const uint8_t *rows[5];
  int k;
  for (k = 0; k < 5; ++k) rows[k] = dense_bytes(t, width, 255);
  REPEAT(t, tvk_dense_of(t->set)->census_codes(rows, width, tolerance, brighter, darker));
}

static void case_edge_costs(trial *t) {
  const int32_t width = pick(t, 1, 200, 640);
  const uint8_t *row = dense_bytes(t, width, 255), *above = dense_bytes(t, width, 255);
  uint8_t *large = OUTPUT(t, uint8_t, width + TVK_DENSE_BLOCK);
  uint8_t *across = OUTPUT(t, uint8_t, width + TVK_DENSE_BLOCK);
  REPEAT(t, tvk_dense_of(t->set)->edge_costs(row, above, width, large, across));
}

/* A row whose arrays are filled as the kernels before would: `stage` of them have run. */
static tvk_dense_row dense_row(trial *t, int stage) {
  tvk_dense_row row;
  const int32_t count = TVK_DENSE_BLOCK * pick(t, 1, 3, 2), width = pick(t, 1, 60, 640);
  uint8_t *large, *across, *above;
  int32_t x, k;
  memset(&row, 0, sizeof row);
  row.width = width;
  row.num_steps = count;
  row.brighter0 = dense_bytes(t, width, 255);
  row.darker0 = dense_bytes(t, width, 255);
  row.brighter1 = dense_bytes(t, width + count, 255);
  row.darker1 = dense_bytes(t, width + count, 255);
  row.grey0 = dense_bytes(t, width, 255);
  row.large = large = dense_bytes(t, width, 255);
  row.across = across = dense_bytes(t, width, 255);
  above = dense_bytes(t, width * count, 48);
  row.costs = stage < 1 ? OUTPUT(t, uint8_t, width * count) : dense_bytes(t, width * count, 16);
  row.sums = OUTPUT(t, uint8_t, width * count);
  row.above = OUTPUT(t, uint8_t, width * count);
  row.least = OUTPUT(t, uint8_t, width);
  row.scratch = OUTPUT(t, uint8_t, 3 * count);
  memcpy(row.above, above, (size_t)(width * count));
  for (k = 0; k < width * count; ++k) row.sums[k] = (uint8_t)random_int(&t->seed, 0, 96);
  for (x = 0; x < width; ++x) {
    large[x] = (uint8_t)(TVK_DENSE_SMALL + large[x] % (TVK_DENSE_LARGE - TVK_DENSE_SMALL + 1));
    across[x] = (uint8_t)(TVK_DENSE_SMALL + across[x] % (TVK_DENSE_LARGE - TVK_DENSE_SMALL + 1));
    row.least[x] = 255;
    for (k = 0; k < count; ++k) {
      if (above[x * count + k] < row.least[x]) row.least[x] = above[x * count + k];
    }
  }
  return row;
}

static void case_sum_ahead(trial *t) {
  const tvk_dense_row row = dense_row(t, 0);
  REPEAT(t, tvk_dense_of(t->set)->sum_ahead(&row));
}

static void case_choose_steps(trial *t) {
  const tvk_dense_row row = dense_row(t, 1);
  int16_t *steps = OUTPUT(t, int16_t, row.width);
  uint8_t *least = OUTPUT(t, uint8_t, row.width), *margin = OUTPUT(t, uint8_t, row.width);
  uint8_t *least1 = OUTPUT(t, uint8_t, row.width + row.num_steps - 1);
  REPEAT(t, tvk_dense_of(t->set)->choose_steps(&row, steps, least, margin, least1));
}

/* Whole blocks that hold `width` and the frame of a window. */
static int32_t dense_pitch(int32_t width) {
  return (width + 2 * TVK_DENSE_REACH + TVK_DENSE_SPAN - 1) / TVK_DENSE_SPAN * TVK_DENSE_SPAN;
}

static void case_support_row(trial *t) {
  const int32_t width = pick(t, 1, 100, 640), pitch = dense_pitch(width);
  const int16_t *rows[7];
  const int32_t spread = random_int(&t->seed, 1, 6);
  uint8_t *support = OUTPUT(t, uint8_t, pitch), *alike = OUTPUT(t, uint8_t, pitch);
  int8_t *slant = OUTPUT(t, int8_t, pitch);
  int32_t n, k;
  for (n = 0; n < 7; ++n) {
    int16_t *row = INPUT(t, int16_t, width + 2 * TVK_DENSE_REACH + TVK_DENSE_SPAN);
    for (k = 0; k < width + 2 * TVK_DENSE_REACH + TVK_DENSE_SPAN; ++k) {
      row[k] =
          (int16_t)(random_int(&t->seed, 0, 9) == 0 ? -1 : 500 + random_int(&t->seed, 0, spread));
    }
    rows[n] = row;
  }
  REPEAT(t, tvk_dense_of(t->set)->support_row(rows, width, support, alike, slant));
}

static void case_cell_columns(trial *t) {
  const int32_t pitch = dense_pitch(pick(t, 1, 100, 640)), first = random_int(&t->seed, 0, 1);
  const int32_t num_columns = TVK_DENSE_SUMS * (pitch + TVK_DENSE_SPAN);
  int32_t *columns = OUTPUT(t, int32_t, num_columns), n, k;
  tvk_dense_rows rows;
  for (n = 0; n < 2 * TVK_DENSE_REACH + 2; ++n) {
    int16_t *g = INPUT(t, int16_t, pitch);
    rows.a[n] = dense_bytes(t, pitch, 255);
    rows.b[n] = dense_bytes(t, pitch, 255);
    rows.is_cell[n] = dense_bytes(t, pitch, 1);
    rows.g[n] = g;
    for (k = 0; k < pitch; ++k) g[k] = (int16_t)random_int(&t->seed, -510, 510);
  }
  for (k = 0; k < num_columns; ++k) columns[k] = random_int(&t->seed, 0, 1000000);
  REPEAT(t, tvk_dense_of(t->set)->cell_columns(&rows, pitch, first, columns));
}

static void case_cell_sums(trial *t) {
  const int32_t pitch = TVK_DENSE_STRETCH * pick(t, 1, 3, 10);
  const int32_t num_columns = TVK_DENSE_SUMS * (pitch + TVK_DENSE_SPAN);
  int32_t *columns = INPUT(t, int32_t, num_columns), k;
  int32_t *sums = OUTPUT(t, int32_t, TVK_DENSE_SUMS * TVK_DENSE_STRETCH);
  for (k = 0; k < num_columns; ++k) columns[k] = random_int(&t->seed, 0, 1000000);
  REPEAT(t, tvk_dense_of(t->set)->cell_sums(columns + pitch - TVK_DENSE_STRETCH, pitch, sums));
}

static void case_fit_cells(trial *t) {
  enum { pitch = TVK_DENSE_STRETCH };
  int32_t *sums = INPUT(t, int32_t, TVK_DENSE_SUMS * pitch), x, k;
  int16_t *steps = INPUT(t, int16_t, pitch);
  uint8_t *alike = INPUT(t, uint8_t, pitch), *similarity = OUTPUT(t, uint8_t, pitch);
  int8_t *slant = INPUT(t, int8_t, pitch);
  float *parallax = OUTPUT(t, float, pitch), *sigma = OUTPUT(t, float, pitch);
  const tvk_dense_model model = {2.0f, 4.0f, 0.1f, 8.0f, 0.0144f};
  memset(sums, 0, (size_t)(TVK_DENSE_SUMS * pitch) * sizeof *sums);
  for (x = 0; x < pitch; ++x) {
    const int32_t num = random_int(&t->seed, 0, 49), contrast = random_int(&t->seed, 0, 127);
    int32_t *s = sums + x;
    for (k = 0; k < num; ++k) {
      const int32_t a = 128 + random_int(&t->seed, -contrast, contrast);
      const int32_t b = random_int(&t->seed, 0, 3) == 0 ? random_int(&t->seed, 0, 255) : a;
      const int32_t g = random_int(&t->seed, -2 * contrast, 2 * contrast);
      const int32_t terms[TVK_DENSE_SUMS] = {a, b, g, a * a, b * b, g * g, a * b, a * g, b * g, 1};
      int n;
      for (n = 0; n < TVK_DENSE_SUMS; ++n) s[n * pitch] += terms[n];
    }
    steps[x] = (int16_t)random_int(&t->seed, -1, 511);
    alike[x] = (uint8_t)random_int(&t->seed, 0, 49);
    slant[x] = (int8_t)random_int(&t->seed, -alike[x], alike[x]);
  }
  REPEAT(t, tvk_dense_of(t->set)->fit_cells(sums, steps, alike, slant, &model, parallax, sigma,
                                            similarity));
  for (x = 0; x < pitch; ++x) {
    TEST_ASSERT_TRUE(parallax[x] >= steps[x] - 2.001f && parallax[x] <= steps[x] + 2.001f);
    TEST_ASSERT_TRUE(sigma[x] > 0 && sigma[x] < 1 && similarity[x] > 0);
  }
}

static void case_smooth_row(trial *t) {
  const int32_t width = pick(t, 1, 200, 640);
  uint8_t *out = OUTPUT(t, uint8_t, width + TVK_DENSE_SPAN);
  const uint8_t *rows[3];
  int k;
  for (k = 0; k < 3; ++k) rows[k] = dense_bytes(t, width, 255);
  REPEAT(t, tvk_dense_of(t->set)->smooth_row(rows, width, out));
}

static void case_place_row(trial *t) {
  const int32_t width = pick(t, 1, 300, 640), height = pick(t, 1, 300, 480);
  const int32_t num = pick(t, 1, 9, 80);
  tvk_dense_span *spans = INPUT(t, tvk_dense_span, num);
  int32_t *u = OUTPUT(t, int32_t, num * TVK_DENSE_NODES);
  int32_t *v = OUTPUT(t, int32_t, num * TVK_DENSE_NODES), n, k;
  memset(spans, 0, (size_t)num * sizeof *spans);
  for (n = 0; n < num; ++n) {
    for (k = 0; k < 4; ++k) {
      const double size = k == 0 ? 300 : k == 1 ? 1 : k == 2 ? 0.01 : 1e-4;
      spans[n].at[k][0] = size * (2 * random_unit(&t->seed) - 0.5);
      spans[n].at[k][1] = size * (2 * random_unit(&t->seed) - 0.5);
    }
    spans[n].is_smooth = random_int(&t->seed, 0, 5) > 0;
  }
  REPEAT(t, tvk_dense_of(t->set)->place_row(spans, num, random_int(&t->seed, 0, 1) ? 1 : 0.5, width,
                                            height, u, v));
}

static void case_sample_row(trial *t) {
  const int32_t width = pick(t, 1, 40, 640), height = pick(t, 1, 40, 480);
  const int32_t stride = width + pick(t, 0, 3, 0), count = pick(t, 1, 60, 640);
  const int32_t sparsity = random_int(&t->seed, 0, 1) ? 9 : 90;
  uint8_t *image = INPUT(t, uint8_t, stride * (height - 1) + width),
          *out = OUTPUT(t, uint8_t, count);
  int32_t *u = INPUT(t, int32_t, count), *v = INPUT(t, int32_t, count), k;
  for (k = 0; k < stride * (height - 1) + width; ++k)
    image[k] = (uint8_t)random_int(&t->seed, 0, 255);
  for (k = 0; k < count; ++k) {
    u[k] = random_int(&t->seed, 0, sparsity) == 0 ? -1 : random_int(&t->seed, 0, (width - 1) << 16);
    v[k] = random_int(&t->seed, 0, (height - 1) << 16);
  }
  REPEAT(t, tvk_dense_of(t->set)->sample_row(image, width, height, stride, u, v, count, out));
}

static void case_census_words(trial *t) {
  const int32_t width = pick(t, 1, 200, 960);
  uint32_t *census = OUTPUT(t, uint32_t, width + TVK_DENSE_BLOCK);
  const uint8_t *rows[2 * TVK_SWEEP_DOWN + 1];
  int k;
  for (k = 0; k < 2 * TVK_SWEEP_DOWN + 1; ++k) rows[k] = dense_bytes(t, width, 255);
  REPEAT(t, tvk_dense_of(t->set)->census_words(rows, width, census));
}

static uint32_t random_census(trial *t) {
  const uint32_t low = (uint32_t)random_int(&t->seed, 0, 65535);
  const uint32_t high = (uint32_t)random_int(&t->seed, 0, 32767);
  return random_int(&t->seed, 0, 5) == 0 ? TVK_SWEEP_NONE : high << 16 | low;
}

/* Up to six views of three lines; planes from beyond one edge to beyond the other. */
static void case_plane_costs(trial *t) {
  const int32_t width = pick(t, 1, 40, 320), count = TVK_DENSE_BLOCK * pick(t, 1, 3, 3);
  const int32_t num_views = pick(t, 1, 6, 4), columns = 3 * width;
  uint8_t *costs = OUTPUT(t, uint8_t, width * count);
  uint32_t *own = INPUT(t, uint32_t, 2 * width);
  tvk_swept_view views[6];
  int32_t v, k;
  for (k = 0; k < 2 * width; ++k) own[k] = random_census(t);
  memset(views, 0, sizeof views);
  for (v = 0; v < num_views; ++v) {
    uint32_t *census = INPUT(t, uint32_t, 3 * columns);
    float *scale = INPUT(t, float, count), *shift = INPUT(t, float, count);
    int32_t *row = INPUT(t, int32_t, count);
    for (k = 0; k < 3 * columns; ++k) census[k] = random_census(t);
    for (k = 0; k < count; ++k) {
      scale[k] = (float)(2 + 0.1 * random_unit(&t->seed));
      shift[k] = (float)(2.0 * width * (random_unit(&t->seed) - 0.5));
      row[k] = columns * random_int(&t->seed, 0, 2);
    }
    views[v].census = census;
    views[v].scale = scale;
    views[v].shift = shift;
    views[v].row = row;
    views[v].last = columns - 1;
  }
  REPEAT(t, tvk_dense_of(t->set)->plane_costs(views, num_views, own, width, count, costs));
  for (k = 0; k < width * count; ++k) TEST_ASSERT_TRUE(costs[k] <= TVK_SWEEP_BITS);
}

static void case_sum_planes(trial *t) {
  const int32_t width = pick(t, 1, 60, 320), count = TVK_DENSE_BLOCK * pick(t, 1, 3, 3);
  uint8_t *const kept_before = dense_bytes(t, width * count, 252);
  uint8_t *kept = OUTPUT(t, uint8_t, width * count);
  uint8_t *across = dense_bytes(t, width + 1, 255);
  tvk_swept_row row;
  int32_t x, k, p;
  memset(&row, 0, sizeof row);
  row.width = width;
  row.count = count;
  row.step = random_int(&t->seed, 0, 1) ? 1 : -1;
  row.costs = dense_bytes(t, width * count, TVK_SWEEP_BITS);
  row.kept = kept;
  row.across = across;
  for (x = 0; x <= width; ++x) {
    across[x] = (uint8_t)(TVK_DENSE_SMALL + across[x] % (TVK_DENSE_LARGE - TVK_DENSE_SMALL + 1));
  }
  for (p = 0; p < 3; ++p) {
    uint8_t *before = dense_bytes(t, width * count, TVK_SWEEP_BITS + TVK_DENSE_LARGE);
    uint8_t *least = INPUT(t, uint8_t, width), *large = dense_bytes(t, width, 255);
    for (x = 0; x < width; ++x) {
      const uint8_t *const line = before + x * count;
      large[x] = (uint8_t)(TVK_DENSE_SMALL + large[x] % (TVK_DENSE_LARGE - TVK_DENSE_SMALL + 1));
      least[x] = 255;
      for (k = 0; k < count; ++k) {
        if (line[k] < least[x]) least[x] = line[k];
      }
    }
    row.before[p] = before;
    row.least_before[p] = least;
    row.large[p] = large;
    row.after[p] = OUTPUT(t, uint8_t, width * count);
    row.least_after[p] = OUTPUT(t, uint8_t, width);
  }
  row.scratch = OUTPUT(t, uint8_t, 2 * count);
  memcpy(kept, kept_before, (size_t)(width * count));
  REPEAT(t, tvk_dense_of(t->set)->sum_planes(&row));
}

static void case_choose_planes(trial *t) {
  const int32_t width = pick(t, 1, 60, 320), count = TVK_DENSE_BLOCK * pick(t, 1, 3, 3);
  const uint8_t *sums = dense_bytes(t, width * count, 255);
  int16_t *planes = OUTPUT(t, int16_t, width);
  uint8_t *margin = OUTPUT(t, uint8_t, width);
  int32_t x;
  REPEAT(t, tvk_dense_of(t->set)->choose_planes(sums, width, count, planes, margin));
  for (x = 0; x < width; ++x) TEST_ASSERT_TRUE(planes[x] >= 0 && planes[x] < count);
}
#endif

static trial make_trial(const tvk_set *set, uint64_t seed, int typical, int64_t calls) {
  trial t;
  memset(&t, 0, sizeof t);
  t.set = set;
  t.seed = seed;
  t.typical = typical;
  t.calls = calls;
  return t;
}

/* Compares the kernel set with C on one input; returns what differs, or null. */
static const char *difference(const trial *expected, const trial *actual) {
  int k;
  for (k = 0; k < actual->num_lists; ++k) {
    const block *b = &actual->blocks[k];
    if (!b->is_output) {
      if (memcmp(expected->blocks[k].data, b->data, b->bytes) != 0) return "an input was changed";
      continue;
    }
    if (memcmp(expected->blocks[k].data, b->data, b->bytes) != 0) return "differs from the C set";
    if (!is_pattern(b->memory, b->data)) return "wrote before an output";
    if (!is_pattern(b->data + b->bytes, b->data + b->bytes + GUARD_BYTES)) {
      return "wrote behind an output";
    }
  }
  return NULL;
}

/* The set's name; a "+" is added for a second table of the same set, which uses more
   instructions. */
static const char *name_of(int32_t n) {
  static char name[16];
  const tvk_set *table = tvk_nth(n), *below = tvk_nth(n - 1);
  snprintf(name, sizeof name, "%s%s", tv_kernels_string((tv_kernels)table->id),
           below != NULL && below->id == table->id ? "+" : "");
  return name;
}

static void check(const char *name, void (*run)(trial *)) {
  int32_t n;
  uint64_t seed;
  for (n = 0; tvk_nth(n) != NULL; ++n) {
    for (seed = 0; seed < ROUNDS; ++seed) {
      trial expected = make_trial(tvk_nth(0), seed, 0, 1),
            actual = make_trial(tvk_nth(n), seed, 0, 1);
      const char *what;
      run(&expected);
      run(&actual);
      what = difference(&expected, &actual);
      release(&expected);
      release(&actual);
      if (what != NULL) {
        char message[160];
        snprintf(message, sizeof message, "%s of set %s, seed %d: %s", name, name_of(n), (int)seed,
                 what);
        TEST_FAIL_MESSAGE(message);
      }
    }
  }
}

#define TEST(name, result, parameters) \
  static void test_##name##_equals_the_c_set(void) { check(#name, case_##name); }
ALL_KERNELS(TEST)
#undef TEST

static double now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* Returns the nanoseconds of a call of the kernel: the least of nine runs, each of as many calls
   as take a millisecond or more. */
static double time_per_call(const tvk_set *set, void (*run)(trial *)) {
  double best = 1e30;
  int64_t calls = 1;
  int repeat = 0;
  while (repeat < 9) {
    trial t = make_trial(set, 1, 1, 1);
    double setup, total; /* ns; setup: making the inputs, and one call */
    const double start = now_ns();
    run(&t);
    setup = now_ns() - start;
    release(&t);
    t = make_trial(set, 1, 1, calls + 1);
    total = now_ns();
    run(&t);
    total = now_ns() - total - setup;
    release(&t);
    if (total < 1e6) {
      calls *= 2;
      continue;
    }
    if (total / (double)calls < best) best = total / (double)calls;
    ++repeat;
  }
  return best;
}

static void print_times(const char *name, void (*run)(trial *)) {
  int32_t n;
  printf("%-24s", name);
  for (n = 0; tvk_nth(n) != NULL; ++n) printf(" %10.1f", time_per_call(tvk_nth(n), run));
  printf("\n");
}

static int print_all_times(void) {
  int32_t n;
  printf("%-24s", "ns per call");
  for (n = 0; tvk_nth(n) != NULL; ++n) printf(" %10s", name_of(n));
  printf("\n");
#define TIME(name, result, parameters) print_times(#name, case_##name);
  ALL_KERNELS(TIME)
#undef TIME
  return 0;
}

/* tvk_nth lists the sets that this machine runs, C first and the fastest last; tvk_select
   returns the fastest for TV_KERNELS_AUTO, a set by its number, or null. */
static void test_the_sets_are_those_of_this_cpu(void) {
  int32_t n, set;
  const tvk_set *fastest = NULL;
  TEST_ASSERT_EQUAL_INT(TV_KERNELS_C, tvk_nth(0)->id);
  for (n = 0; tvk_nth(n) != NULL; ++n) {
    fastest = tvk_nth(n);
    TEST_ASSERT_TRUE(n == 0 || fastest->id >= tvk_nth(n - 1)->id);
    TEST_ASSERT_EQUAL_INT(fastest->id, tvk_select(fastest->id)->id);
    printf("kernel set: %s\n", name_of(n));
  }
  TEST_ASSERT_NULL(tvk_nth(-1));
  TEST_ASSERT_NULL(tvk_nth(n + 1));
  TEST_ASSERT_EQUAL_PTR(fastest, tvk_select(TV_KERNELS_AUTO));
  for (set = -1; set <= TV_KERNELS_NEON + 1; ++set) {
    const tvk_set *table = tvk_select(set);
    TEST_ASSERT_TRUE(table == NULL || set == TV_KERNELS_AUTO || table->id == set);
  }
#if defined(__x86_64__)
  TEST_ASSERT_NOT_NULL(tvk_select(TV_KERNELS_SSE2));
  TEST_ASSERT_NULL(tvk_select(TV_KERNELS_NEON));
#elif defined(__aarch64__)
  TEST_ASSERT_NOT_NULL(tvk_select(TV_KERNELS_NEON));
#endif
#if !defined(__x86_64__)
  TEST_ASSERT_NULL(tvk_select(TV_KERNELS_SSE2));
#endif
}

void setUp(void) {}
void tearDown(void) {}

int main(int argc, char **argv) {
  if (argc == 2 && strcmp(argv[1], "--time") == 0) return print_all_times();
  UNITY_BEGIN();
  RUN_TEST(test_the_sets_are_those_of_this_cpu);
#define RUN(name, result, parameters) RUN_TEST(test_##name##_equals_the_c_set);
  ALL_KERNELS(RUN)
#undef RUN
  return UNITY_END();
}
