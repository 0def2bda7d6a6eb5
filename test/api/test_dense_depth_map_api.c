/* Tests of tv_sweep_depth: the statuses, the memory and the outputs that the header promises. */
#include <math.h>
#include <string.h>

#include "support/api.h"
#include "twoview/twoview.h"
#include "unity.h"

enum { WIDTH = 200, HEIGHT = 150, SHIFT = 9, VIEWS = 3, ROOM = 24 << 20 };

static uint8_t pixels[VIEWS][WIDTH * HEIGHT];
static uint8_t block[ROOM + 2 * API_GUARD_BYTES + TV_CONTEXT_ALIGNMENT];
static uint8_t *memory;
static size_t size_bytes;
static tv_camera camera;
static tv_depth_view views[VIEWS];
static tv_depth_options options;
static float distance[WIDTH * HEIGHT], sigma[WIDTH * HEIGHT];
static uint8_t witnesses[WIDTH * HEIGHT], grey[WIDTH * HEIGHT];
static tv_depth_arrays arrays;

/* A wall at the depth 300 / SHIFT, seen from places a unit apart. */
void setUp(void) {
  int v, i, y;
  api_draw(3, pixels[0], WIDTH, HEIGHT);
  memcpy(pixels[1], pixels[0], sizeof pixels[1]);
  memcpy(pixels[2], pixels[0], sizeof pixels[2]);
  for (y = 0; y < HEIGHT; ++y) {
    memmove(pixels[1] + y * WIDTH, pixels[0] + y * WIDTH + SHIFT, WIDTH - SHIFT);
    memmove(pixels[2] + y * WIDTH + SHIFT, pixels[0] + y * WIDTH, WIDTH - SHIFT);
  }
  memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = WIDTH, camera.height = HEIGHT;
  camera.fx = camera.fy = 300, camera.cx = 99.5, camera.cy = 74.5;
  memset(views, 0, sizeof views);
  for (v = 0; v < VIEWS; ++v) {
    views[v].image.data = pixels[v];
    views[v].image.width = WIDTH, views[v].image.height = HEIGHT;
    views[v].image.stride_bytes = WIDTH;
    views[v].camera = &camera;
    for (i = 0; i < 9; ++i) views[v].world_from_cam_R[i] = i % 4 == 0;
  }
  views[1].world_from_cam_t[0] = 1;
  views[2].world_from_cam_t[0] = -1;
  tv_depth_options_init(&options);
  options.near_depth = 15, options.far_depth = 150;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_size(&camera, &options, &size_bytes));
  TEST_ASSERT_TRUE(size_bytes <= ROOM);
  memset(block, API_PATTERN, sizeof block);
  memory = block + API_GUARD_BYTES;
  memory += TV_CONTEXT_ALIGNMENT - (uintptr_t)memory % TV_CONTEXT_ALIGNMENT;
  memset(distance, API_PATTERN, sizeof distance);
  memset(sigma, API_PATTERN, sizeof sigma);
  memset(witnesses, API_PATTERN, sizeof witnesses);
  memset(grey, API_PATTERN, sizeof grey);
  arrays.distance = distance, arrays.sigma = sigma, arrays.witnesses = witnesses;
  arrays.grey = grey;
}

void tearDown(void) {}

static tv_status run(int32_t num_views) {
  return tv_sweep_depth(memory, size_bytes, views, num_views, &options, &arrays);
}

static void expect_refusal(tv_status expected) {
  TEST_ASSERT_EQUAL_INT(expected, run(VIEWS));
  TEST_ASSERT_TRUE(api_is_pattern((const uint8_t *)distance, sizeof distance));
  TEST_ASSERT_TRUE(api_is_pattern((const uint8_t *)sigma, sizeof sigma));
  TEST_ASSERT_TRUE(api_is_pattern(witnesses, sizeof witnesses));
  TEST_ASSERT_TRUE(api_is_pattern(grey, sizeof grey));
}

static void test_a_wall_is_a_wall_and_the_memory_suffices(void) {
  int32_t i, known = 0, off = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(VIEWS));
  for (i = 0; i < WIDTH * HEIGHT; ++i) {
    const double x = (i % WIDTH - 99.5) / 300, y = (i / WIDTH - 74.5) / 300;
    const double depth = distance[i] / sqrt(1 + x * x + y * y);
    if (distance[i] == 0) continue;
    ++known;
    off += fabs(depth - 300.0 / SHIFT) > 0.05 * 300 / SHIFT;
  }
  TEST_ASSERT_GREATER_THAN_INT(WIDTH * HEIGHT * 8 / 10, known);
  TEST_ASSERT_LESS_OR_EQUAL_INT(known / 100, off);
  TEST_ASSERT_TRUE(api_is_pattern(block, (size_t)(memory - block)));
  TEST_ASSERT_TRUE(api_is_pattern(memory + size_bytes, API_GUARD_BYTES));
}

static void test_a_blank_wall_has_no_witness(void) {
  int32_t i;
  for (i = 0; i < VIEWS; ++i) memset(pixels[i], 90, sizeof pixels[i]);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(VIEWS));
  for (i = 0; i < WIDTH * HEIGHT; ++i) TEST_ASSERT_TRUE(distance[i] == 0);
}

static void test_views_from_one_centre_give_nothing(void) {
  int32_t i;
  for (i = 1; i < VIEWS; ++i) {
    views[i].world_from_cam_t[0] = 0;
    memcpy(pixels[i], pixels[0], sizeof pixels[0]);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, run(VIEWS));
  for (i = 0; i < WIDTH * HEIGHT; ++i) TEST_ASSERT_TRUE(distance[i] == 0);
}

static void test_mistakes_are_refused_and_nothing_is_written(void) {
  const tv_depth_options good = options;
  const tv_depth_view view = views[1];
  tv_camera other = camera;
  options.near_depth = 0;
  expect_refusal(TV_ERR_ARGUMENT);
  options.near_depth = 200;
  expect_refusal(TV_ERR_ARGUMENT);
  options.near_depth = NAN;
  expect_refusal(TV_ERR_NOT_FINITE);
  options = good;
  options.max_views = 2; /* fewer than there are */
  expect_refusal(TV_ERR_ARGUMENT);
  options = good;
  options.max_planes = 8;
  expect_refusal(TV_ERR_ARGUMENT);
  options = good;
  options.max_relative_sigma = 0;
  expect_refusal(TV_ERR_ARGUMENT);
  options = good;
  options.struct_size = 3;
  expect_refusal(TV_ERR_STRUCT_SIZE);
  options = good;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, run(1));
  views[1].world_from_cam_R[0] = 2;
  expect_refusal(TV_ERR_ARGUMENT);
  views[1].world_from_cam_R[0] = INFINITY;
  expect_refusal(TV_ERR_NOT_FINITE);
  views[1] = view;
  views[1].world_from_cam_t[2] = NAN;
  expect_refusal(TV_ERR_NOT_FINITE);
  views[1] = view;
  views[1].image.width = WIDTH - 1;
  expect_refusal(TV_ERR_CAMERA);
  views[1] = view;
  views[1].image.stride_bytes = WIDTH - 1;
  expect_refusal(TV_ERR_ARGUMENT);
  views[1] = view;
  views[1].image.data = NULL;
  expect_refusal(TV_ERR_NULL);
  views[1] = view;
  views[1].camera = NULL;
  expect_refusal(TV_ERR_NULL);
  other.width = WIDTH - 1;
  views[1].camera = &other;
  views[1].image.width = WIDTH - 1;
  expect_refusal(TV_ERR_CAMERA); /* of another size than the reference */
  views[1] = view;
  --size_bytes;
  expect_refusal(TV_ERR_MEMORY);
  ++size_bytes;
  ++memory;
  expect_refusal(TV_ERR_ALIGNMENT);
  --memory;
  arrays.grey = memory;
  expect_refusal(TV_ERR_OVERLAP);
  arrays.grey = witnesses;
  expect_refusal(TV_ERR_OVERLAP);
  arrays.grey = NULL; /* not wanted */
  TEST_ASSERT_EQUAL_INT(TV_OK, run(VIEWS));
  arrays.sigma = NULL;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, run(VIEWS));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        tv_sweep_depth(memory, size_bytes, NULL, 3, &options, &arrays));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_sweep_depth(memory, size_bytes, views, 3, NULL, &arrays));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_depth_size(&camera, &options, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_depth_map_camera(NULL, &options, &other));
  camera.fx = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, tv_depth_size(&camera, &options, &size_bytes));
}

static void test_a_large_image_is_reduced_to_the_pixels_of_the_option(void) {
  tv_camera map;
  camera.width = 1920, camera.height = 1080;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_map_camera(&camera, NULL, &map));
  TEST_ASSERT_TRUE(map.width * map.height <= 200000 && map.width * map.height > 198000);
  TEST_ASSERT_TRUE(fabs(map.fx / camera.fx - map.width / 1920.0) < 0.003);
  TEST_ASSERT_TRUE(map.cx == (map.width - 1) * 0.5);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_wall_is_a_wall_and_the_memory_suffices);
  RUN_TEST(test_a_blank_wall_has_no_witness);
  RUN_TEST(test_views_from_one_centre_give_nothing);
  RUN_TEST(test_mistakes_are_refused_and_nothing_is_written);
  RUN_TEST(test_a_large_image_is_reduced_to_the_pixels_of_the_option);
  return UNITY_END();
}
