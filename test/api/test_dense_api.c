/* Tests of tv_densify: the statuses, the memory and the outputs that the header promises. */
#include <math.h>
#include <string.h>

#include "support/api.h"
#include "support/calls.h"
#include "twoview/twoview.h"
#include "unity.h"

enum { WIDTH = 200, HEIGHT = 150, SHIFT = 9, MOST = 40000, ROOM = 12 << 20 };

static uint8_t pixels[2][WIDTH * HEIGHT];
static uint8_t block[ROOM + 2 * API_GUARD_BYTES + TV_CONTEXT_ALIGNMENT];
static uint8_t *memory;
static size_t size_bytes;
static tv_image image[2];
static tv_camera camera[2];
static double R[9], t[3];
static tv_point sparse[8];
static tv_dense_options options;
static tv_dense_point points[MOST + 1], untouched[MOST + 1];
static int32_t num;

/* A wall at a distance of 300 / SHIFT baselines: image 1 is image 0, SHIFT pixels to the left. */
void setUp(void) {
  int i, y;
  api_draw(3, pixels[0], WIDTH, HEIGHT);
  memcpy(pixels[1], pixels[0], sizeof pixels[1]);
  for (y = 0; y < HEIGHT; ++y) {
    memmove(pixels[1] + y * WIDTH, pixels[0] + y * WIDTH + SHIFT, WIDTH - SHIFT);
  }
  memset(camera, 0, sizeof camera);
  for (i = 0; i < 2; ++i) {
    image[i].data = pixels[i];
    image[i].width = WIDTH, image[i].height = HEIGHT, image[i].stride_bytes = WIDTH;
    camera[i].model = TV_CAMERA_PINHOLE;
    camera[i].width = WIDTH, camera[i].height = HEIGHT;
    camera[i].fx = camera[i].fy = 300, camera[i].cx = 100, camera[i].cy = 75;
  }
  for (i = 0; i < 9; ++i) R[i] = i % 4 == 0;
  t[0] = -1, t[1] = 0, t[2] = 0;
  memset(sparse, 0, sizeof sparse);
  for (i = 0; i < 8; ++i) sparse[i].angle_rad = SHIFT / 300.0f;
  tv_dense_options_init(&options);
  options.max_cells = 60000;
  options.sparse = sparse;
  options.num_sparse = 8;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera[0], &camera[1], &options, &size_bytes));
  TEST_ASSERT_TRUE(size_bytes <= ROOM);
  memset(block, API_PATTERN, sizeof block);
  memory = block + API_GUARD_BYTES;
  memory += TV_CONTEXT_ALIGNMENT - (uintptr_t)memory % TV_CONTEXT_ALIGNMENT;
  memset(points, API_PATTERN, sizeof points);
  memset(untouched, API_PATTERN, sizeof untouched);
  num = -7;
}

void tearDown(void) {}

static tv_status run(int32_t cap) {
  const tv_camera_pair pair = pair_of(&camera[0], &camera[1], R, t);
  return tv_densify(memory, size_bytes, &pair, image, &options, points, cap, &num);
}

static void expect_refusal(tv_status expected) {
  TEST_ASSERT_EQUAL_INT(expected, run(MOST));
  TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
  TEST_ASSERT_EQUAL_INT(-7, num);
}

/* The wall's depth at each point to within 4 sigma, but for one of a hundred, which is flat ground
   of the texture. */
static void expect_the_wall(void) {
  int32_t i, beyond = 0;
  for (i = 0; i < num; ++i) {
    const float off = fabsf(points[i].position[2] - 300.0f / SHIFT);
    TEST_ASSERT_TRUE(points[i].sigma > 0);
    TEST_ASSERT_TRUE(off < 0.2f * 300 / SHIFT);
    beyond += off > 4 * points[i].sigma;
  }
  TEST_ASSERT_LESS_OR_EQUAL_INT(num / 100, beyond);
}

static void test_a_wall_is_a_wall_and_the_memory_suffices(void) {
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_GREATER_THAN_INT(10000, num);
  expect_the_wall();
  TEST_ASSERT_TRUE(api_is_pattern(points + num, sizeof *points));
  TEST_ASSERT_TRUE(api_is_pattern(block, (size_t)(memory - block)));
  TEST_ASSERT_TRUE(api_is_pattern(memory + size_bytes, API_GUARD_BYTES));
}

static void test_room_for_fewer_gives_them_spread_evenly(void) {
  const tv_camera_pair pair = pair_of(&camera[0], &camera[1], R, t);
  int32_t all, i, upper = 0, left = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  all = num;
  memset(points, API_PATTERN, sizeof points);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(500));
  TEST_ASSERT_TRUE(all > 500 && num == 500);
  TEST_ASSERT_TRUE(api_is_pattern(points + 500, sizeof *points));
  for (i = 0; i < num; ++i) {
    upper += points[i].pixel0[1] < HEIGHT / 2;
    left += points[i].pixel0[0] < WIDTH / 2;
  }
  TEST_ASSERT_INT_WITHIN(60, 250, upper);
  TEST_ASSERT_INT_WITHIN(60, 250, left);
  options.sparse = NULL;
  options.num_sparse = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_densify(memory, size_bytes, &pair, image, &options, NULL, 0, &num));
  TEST_ASSERT_EQUAL_INT(0, num);
}

static void test_the_unit_is_that_of_t(void) {
  float z;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(100));
  z = points[50].position[2];
  t[0] = -4;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(100));
  TEST_ASSERT_FLOAT_WITHIN(1e-4f * z, 4 * z, points[50].position[2]);
}

static void test_a_range_in_the_options_replaces_that_of_the_points(void) {
  options.min_parallax_rad = 2.0 / 300, options.max_parallax_rad = 20.0 / 300;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_GREATER_THAN_INT(10000, num);
  options.min_parallax_rad = 15.0 / 300, options.max_parallax_rad = 30.0 / 300;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST)); /* the wall is not within the range */
  TEST_ASSERT_LESS_THAN_INT(500, num);
  tv_dense_options_init(&options);
  options.max_cells = 60000;
  sparse[0].status = TV_POINT_INFINITE, sparse[1].angle_rad = NAN, sparse[2].angle_rad = -1;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_GREATER_THAN_INT(10000, num);
}

static void test_the_largest_sigma_is_obeyed(void) {
  int32_t i, all;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  all = num;
  options.max_relative_sigma = 0.02;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_LESS_THAN_INT(all, num);
  for (i = 0; i < num; ++i) {
    const float *p = points[i].position;
    const float distance = sqrtf(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    TEST_ASSERT_TRUE(points[i].sigma <= 0.0201f * distance);
  }
}

static void test_fewer_cells_than_pixels_use_smaller_images(void) {
  options.max_cells = 5000;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera[0], &camera[1], &options, &size_bytes));
  memset(block, API_PATTERN, sizeof block);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_GREATER_THAN_INT(500, num);
  TEST_ASSERT_LESS_THAN_INT(5001, num);
  expect_the_wall();
  TEST_ASSERT_TRUE(api_is_pattern(memory + size_bytes, API_GUARD_BYTES));
}

static void test_pictures_without_texture_or_overlap_give_no_points(void) {
  memset(pixels[0], 77, sizeof pixels[0]);
  memset(pixels[1], 77, sizeof pixels[1]);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_EQUAL_INT(0, num);
  setUp();
  R[0] = R[8] = -1; /* camera 1 looks back */
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_LESS_THAN_INT(50, num);
}

/* A range of which the wall is at the near end, and each number of steps. */
static void test_any_number_of_steps_reaches_the_near_end(void) {
  int32_t steps;
  options.min_parallax_rad = 0, options.max_parallax_rad = (SHIFT + 1) / 300.0;
  for (steps = 16; steps <= 24; ++steps) {
    options.max_steps = steps;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera[0], &camera[1], &options, &size_bytes));
    TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
    TEST_ASSERT_GREATER_THAN_INT(8000, num);
  }
  options.max_parallax_rad = 24.0 / 300, options.max_steps = 23; /* a step is above a pixel wide */
  memmove(pixels[1], pixels[0], sizeof pixels[1]);
  for (steps = 0; steps < HEIGHT; ++steps) {
    memmove(pixels[1] + steps * WIDTH, pixels[0] + steps * WIDTH + 22, WIDTH - 22);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera[0], &camera[1], &options, &size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  TEST_ASSERT_GREATER_THAN_INT(2000, num);
}

/* Forward, so that the cells are of different widths in the image: image 1 is image 0 a fifth
   larger. */
static void test_room_for_all_gives_all(void) {
  int32_t all, x, y;
  for (y = 0; y < HEIGHT; ++y) {
    for (x = 0; x < WIDTH; ++x) {
      pixels[1][y * WIDTH + x] =
          pixels[0][(int32_t)(75.5 + (y - 75) / 1.2) * WIDTH + (int32_t)(100.5 + (x - 100) / 1.2)];
    }
  }
  t[0] = 0, t[2] = -1;
  options.max_parallax_rad = 0.12;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  all = num;
  TEST_ASSERT_GREATER_THAN_INT(1000, all);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(all));
  TEST_ASSERT_EQUAL_INT(all, num);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(all - 1));
  TEST_ASSERT_LESS_THAN_INT(all, num);
}

static void test_an_extreme_translation_gives_the_same_pixels(void) {
  static const double length[] = {1e-320, 1e-170, 1e-99, 1e99, 1e160, 1e307};
  static float seen[2 * MOST];
  int32_t i, all;
  size_t k;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
  all = num;
  for (i = 0; i < all; ++i) memcpy(seen + 2 * i, points[i].pixel0, sizeof points[i].pixel0);
  for (k = 0; k < sizeof length / sizeof length[0]; ++k) {
    t[0] = -length[k];
    TEST_ASSERT_EQUAL_INT(TV_OK, run(MOST));
    TEST_ASSERT_EQUAL_INT(all, num);
    for (i = 0; i < all; ++i) {
      TEST_ASSERT_EQUAL_MEMORY(seen + 2 * i, points[i].pixel0, sizeof points[i].pixel0);
    }
  }
}

static void test_bad_options_are_refused(void) {
  struct {
    int32_t cells, steps, num_sparse;
    double low, high, sigma;
    tv_status expected;
  } const cases[] = {{1023, 128, 8, 0, 0, 0.05, TV_ERR_ARGUMENT},
                     {(1 << 24) + 1, 128, 8, 0, 0, 0.05, TV_ERR_ARGUMENT},
                     {60000, 15, 8, 0, 0, 0.05, TV_ERR_ARGUMENT},
                     {60000, 513, 8, 0, 0, 0.05, TV_ERR_ARGUMENT},
                     {60000, 128, -1, 0, 0, 0.05, TV_ERR_ARGUMENT},
                     {60000, 128, 8, -0.1, 1, 0.05, TV_ERR_ARGUMENT},
                     {60000, 128, 8, 0, 3.2, 0.05, TV_ERR_ARGUMENT},
                     {60000, 128, 8, 1, 1, 0.05, TV_ERR_ARGUMENT},
                     {60000, 128, 8, 0, 0, 0, TV_ERR_ARGUMENT},
                     {60000, 128, 8, 0, 0, 1.01, TV_ERR_ARGUMENT},
                     {60000, 128, 8, NAN, 0, 0.05, TV_ERR_NOT_FINITE},
                     {60000, 128, 8, 0, INFINITY, 0.05, TV_ERR_NOT_FINITE},
                     {60000, 128, 8, 0, 0, NAN, TV_ERR_NOT_FINITE}};
  size_t k, size = 99;
  for (k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
    options.max_cells = cases[k].cells, options.max_steps = cases[k].steps;
    options.num_sparse = cases[k].num_sparse;
    options.min_parallax_rad = cases[k].low, options.max_parallax_rad = cases[k].high;
    options.max_relative_sigma = cases[k].sigma;
    expect_refusal(cases[k].expected);
    TEST_ASSERT_EQUAL_INT(cases[k].expected,
                          tv_dense_size(&camera[0], &camera[1], &options, &size));
    TEST_ASSERT_EQUAL_UINT64(99, size);
  }
  tv_dense_options_init(&options);
  options.struct_size = 3;
  expect_refusal(TV_ERR_STRUCT_SIZE);
}

static void test_bad_images_cameras_and_poses_are_refused(void) {
  image[1].width = WIDTH - 1;
  expect_refusal(TV_ERR_CAMERA);
  setUp();
  image[0].stride_bytes = WIDTH - 1;
  expect_refusal(TV_ERR_ARGUMENT);
  setUp();
  image[0].data = NULL;
  expect_refusal(TV_ERR_NULL);
  setUp();
  camera[1].fx = NAN;
  expect_refusal(TV_ERR_CAMERA);
  setUp();
  camera[0].width = image[0].width = 16385;
  image[0].stride_bytes = 16385;
  expect_refusal(TV_ERR_CAMERA);
  setUp();
  R[4] = NAN;
  expect_refusal(TV_ERR_NOT_FINITE);
  setUp();
  t[2] = INFINITY;
  expect_refusal(TV_ERR_NOT_FINITE);
  setUp();
  R[4] = 1.1;
  expect_refusal(TV_ERR_ARGUMENT);
  setUp();
  t[0] = 0;
  expect_refusal(TV_ERR_ARGUMENT);
}

static void test_bad_memory_and_overlaps_are_refused(void) {
  uint8_t *const good = memory;
  tv_camera_pair pair = pair_of(&camera[0], &camera[1], R, t);
  size_bytes -= 1;
  expect_refusal(TV_ERR_MEMORY);
  setUp();
  memory += 1;
  expect_refusal(TV_ERR_ALIGNMENT);
  setUp();
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, run(-1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_densify(memory, size_bytes, &pair, image, &options,
                                                   (tv_dense_point *)(void *)memory, 10, &num));
  options.sparse = (tv_point *)(void *)points;
  options.num_sparse = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, run(10));
  options.sparse = sparse;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_densify(memory, size_bytes, &pair, image, &options,
                                   (tv_dense_point *)(void *)&pair.cam1_from_cam0_R, 1, &num));
  image[1].data = good + 100;
  expect_refusal(TV_ERR_OVERLAP);
}

static void test_null_pointers_are_refused(void) {
  const tv_camera_pair pair = pair_of(&camera[0], &camera[1], R, t);
  size_t size;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_dense_size(NULL, &camera[1], &options, &size));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_dense_size(&camera[0], NULL, &options, &size));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_dense_size(&camera[0], &camera[1], &options, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera[0], &camera[1], NULL, &size));
#define CALL(a, b, c, d, e) \
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_densify(a, size_bytes, b, c, &options, d, 5, e))
  CALL(NULL, &pair, image, points, &num);
  CALL(memory, NULL, image, points, &num);
  CALL(memory, &pair, NULL, points, &num);
  CALL(memory, &pair, image, NULL, &num);
  CALL(memory, &pair, image, points, NULL);
  options.sparse = NULL;
  CALL(memory, &pair, image, points, &num);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_dense_size(&camera[0], &camera[1], &options, &size));
  TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
}

static void test_extreme_cameras_stay_within_the_memory(void) {
  static const double focal[] = {1e-3, 1, 40, 1e4, 1e9};
  size_t i, j, k;
  for (i = 0; i < 5; ++i) {
    for (j = 0; j < 5; ++j) {
      for (k = 0; k < 6; ++k) {
        setUp();
        camera[0].model = camera[1].model =
            k % 2 == 0 ? TV_CAMERA_PINHOLE : TV_CAMERA_KANNALA_BRANDT;
        camera[0].fx = focal[i], camera[0].fy = focal[j];
        camera[1].fx = focal[j], camera[1].fy = focal[i];
        t[0] = k < 2 ? -1 : 1e-9, t[2] = k < 2 ? 0 : k < 4 ? 1 : -1;
        options.max_cells = 3000;
        if (k == 5) options.max_parallax_rad = 3.14;
        TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera[0], &camera[1], &options, &size_bytes));
        TEST_ASSERT_EQUAL_INT(TV_OK, run(1000));
        TEST_ASSERT_TRUE(num >= 0 && num <= 1000);
        TEST_ASSERT_TRUE(api_is_pattern(memory + size_bytes, API_GUARD_BYTES));
      }
    }
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_wall_is_a_wall_and_the_memory_suffices);
  RUN_TEST(test_room_for_fewer_gives_them_spread_evenly);
  RUN_TEST(test_the_unit_is_that_of_t);
  RUN_TEST(test_a_range_in_the_options_replaces_that_of_the_points);
  RUN_TEST(test_the_largest_sigma_is_obeyed);
  RUN_TEST(test_fewer_cells_than_pixels_use_smaller_images);
  RUN_TEST(test_pictures_without_texture_or_overlap_give_no_points);
  RUN_TEST(test_any_number_of_steps_reaches_the_near_end);
  RUN_TEST(test_room_for_all_gives_all);
  RUN_TEST(test_an_extreme_translation_gives_the_same_pixels);
  RUN_TEST(test_bad_options_are_refused);
  RUN_TEST(test_bad_images_cameras_and_poses_are_refused);
  RUN_TEST(test_bad_memory_and_overlaps_are_refused);
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_extreme_cameras_stay_within_the_memory);
  return UNITY_END();
}
