/* Tests of tv_detect, tv_orient, tv_describe, tv_extract: every status of feature.h, outputs that
   stay untouched on errors, what the options promise, memory, and determinism. */

#include <math.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"
#include "support/real_pair.h"

enum { WIDTH = 240, HEIGHT = 180, CAP = 400 };

static uint8_t pixels[WIDTH * HEIGHT], padded[(WIDTH + 13) * HEIGHT], mask_pixels[WIDTH * HEIGHT];
static tv_keypoint keypoints[CAP], others[CAP];
static uint8_t descriptors[CAP * TV_DESCRIPTOR_BYTES], other_descriptors[CAP * TV_DESCRIPTOR_BYTES];
static tv_feature_options options;
static tv_image image;
static api_context a;

static tv_limits limits_of(int32_t width, int32_t height, int32_t max_keypoints, int32_t kernels) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = width;
  limits.max_height = height;
  limits.max_keypoints = max_keypoints;
  limits.kernels = kernels;
  return limits;
}

static void clear_outputs(void) {
  memset(keypoints, API_PATTERN, sizeof keypoints);
  memset(others, API_PATTERN, sizeof others);
  memset(descriptors, API_PATTERN, sizeof descriptors);
  memset(other_descriptors, API_PATTERN, sizeof other_descriptors);
}

void setUp(void) {
  const tv_limits limits = limits_of(WIDTH, HEIGHT, CAP, TV_KERNELS_AUTO);
  a = api_make(&limits);
  api_draw(71, pixels, WIDTH, HEIGHT);
  image = api_image(pixels, WIDTH, HEIGHT, WIDTH);
  tv_feature_options_init(&options);
  options.max_keypoints = CAP;
  clear_outputs();
}

void tearDown(void) { api_release(&a); }

static int32_t detect(tv_context *context, tv_keypoint *out) {
  int32_t count = -1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_detect(context, &image, NULL, &options, out, CAP, &count));
  return count;
}

static int32_t extract(tv_context *context, tv_keypoint *out, uint8_t *rows) {
  int32_t count = -1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_extract(context, &image, NULL, &options, out, rows, CAP, &count));
  return count;
}

/* All four functions must return this status and write nothing. */
static void refused(tv_status expected, tv_context *context, const tv_image *view,
                    const tv_image *mask, const tv_feature_options *o) {
  tv_keypoint point = {50, 50, 4, 0, 1, 0};
  int32_t count = -7;
  clear_outputs();
  TEST_ASSERT_EQUAL_INT(expected, tv_detect(context, view, mask, o, keypoints, CAP, &count));
  TEST_ASSERT_EQUAL_INT(expected,
                        tv_extract(context, view, mask, o, keypoints, descriptors, CAP, &count));
  if (mask == NULL) {
    TEST_ASSERT_EQUAL_INT(expected, tv_orient(context, view, &point, 1, o, keypoints, CAP, &count));
    TEST_ASSERT_EQUAL_INT(expected, tv_describe(context, view, &point, 1, o, descriptors));
  }
  TEST_ASSERT_EQUAL_INT(-7, count);
  TEST_ASSERT_TRUE(api_is_pattern(keypoints, sizeof keypoints));
  TEST_ASSERT_TRUE(api_is_pattern(descriptors, sizeof descriptors));
}

static void test_images_that_are_none_are_refused(void) {
  tv_image bad = image;
  refused(TV_ERR_NULL, NULL, &image, NULL, NULL);
  refused(TV_ERR_NULL, a.context, NULL, NULL, NULL);
#define REFUSED(status, field, value) \
  bad = image;                        \
  bad.field = value;                  \
  refused(status, a.context, &bad, NULL, NULL)
  REFUSED(TV_ERR_NULL, data, NULL);
  REFUSED(TV_ERR_ARGUMENT, width, 0);
  REFUSED(TV_ERR_ARGUMENT, width, -WIDTH);
  REFUSED(TV_ERR_ARGUMENT, height, 0);
  REFUSED(TV_ERR_ARGUMENT, height, INT32_MIN);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, 0);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, WIDTH - 1);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, -WIDTH);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, INT64_MAX);
  REFUSED(TV_ERR_LIMITS, height, HEIGHT + 1);
  REFUSED(TV_ERR_LIMITS, height, INT32_MAX);
#undef REFUSED
  bad = image;
  bad.width = WIDTH + 1;
  bad.stride_bytes = WIDTH + 1;
  refused(TV_ERR_LIMITS, a.context, &bad, NULL, NULL);
}

static void test_masks_of_another_shape_are_refused(void) {
  tv_image bad;
#define REFUSED(status, field, value)                 \
  bad = api_image(mask_pixels, WIDTH, HEIGHT, WIDTH); \
  bad.field = value;                                  \
  refused(status, a.context, &image, &bad, NULL)
  REFUSED(TV_ERR_NULL, data, NULL);
  REFUSED(TV_ERR_ARGUMENT, width, WIDTH - 1);
  REFUSED(TV_ERR_ARGUMENT, height, HEIGHT - 1);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, WIDTH - 1);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, 0);
  REFUSED(TV_ERR_ARGUMENT, stride_bytes, INT64_MAX);
#undef REFUSED
}

static void test_options_out_of_range_are_refused(void) {
  tv_feature_options bad;
  tv_feature_options_init(NULL);
#define REFUSED(status, field, value) \
  bad = options;                      \
  bad.field = value;                  \
  refused(status, a.context, &image, NULL, &bad)
  REFUSED(TV_ERR_STRUCT_SIZE, struct_size, 0);
  REFUSED(TV_ERR_STRUCT_SIZE, struct_size, sizeof bad + 1);
  REFUSED(TV_ERR_ARGUMENT, max_keypoints, -1);
  REFUSED(TV_ERR_ARGUMENT, max_keypoints, INT32_MIN);
  REFUSED(TV_ERR_LIMITS, max_keypoints, CAP + 1);
  REFUSED(TV_ERR_LIMITS, max_keypoints, INT32_MAX);
  REFUSED(TV_ERR_ARGUMENT, arc, 8);
  REFUSED(TV_ERR_ARGUMENT, arc, 13);
  REFUSED(TV_ERR_ARGUMENT, threshold, 0);
  REFUSED(TV_ERR_ARGUMENT, threshold, 255);
  REFUSED(TV_ERR_ARGUMENT, min_threshold, -1);
  REFUSED(TV_ERR_ARGUMENT, min_threshold, options.threshold + 1);
  REFUSED(TV_ERR_ARGUMENT, levels, 0);
  REFUSED(TV_ERR_ARGUMENT, levels, 9);
  REFUSED(TV_ERR_ARGUMENT, scale_factor, 1.0999f);
  REFUSED(TV_ERR_ARGUMENT, scale_factor, 2.0001f);
  REFUSED(TV_ERR_ARGUMENT, scale_factor, (float)NAN);
  REFUSED(TV_ERR_ARGUMENT, scale_factor, (float)INFINITY);
  REFUSED(TV_ERR_ARGUMENT, cell_px, 7);
  REFUSED(TV_ERR_ARGUMENT, cell_px, -1);
  REFUSED(TV_ERR_ARGUMENT, cell_px, 16385);
  REFUSED(TV_ERR_ARGUMENT, subpixel, 2);
  REFUSED(TV_ERR_ARGUMENT, subpixel, -1);
  REFUSED(TV_ERR_ARGUMENT, orientation, 2);
  REFUSED(TV_ERR_ARGUMENT, orientation, -1);
  REFUSED(TV_ERR_ARGUMENT, descriptor, 2);
  REFUSED(TV_ERR_ARGUMENT, descriptor, -1);
  REFUSED(TV_ERR_ARGUMENT, keypoint_size, 0.5f);
  REFUSED(TV_ERR_ARGUMENT, keypoint_size, 33.0f);
  REFUSED(TV_ERR_ARGUMENT, keypoint_size, (float)NAN);
  REFUSED(TV_ERR_ARGUMENT, pooling, -1);
  REFUSED(TV_ERR_ARGUMENT, pooling, 2);
  REFUSED(TV_ERR_ARGUMENT, reserved, 1);
#undef REFUSED
}

static void test_output_pointers_are_checked(void) {
  tv_keypoint point = {50, 50, 4, 0, 1, 0};
  int32_t count = -7;
  const tv_image other = api_image(mask_pixels, WIDTH, HEIGHT, WIDTH);
  tv_context *c = a.context;
  const tv_image *v = &image;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_detect(c, v, NULL, NULL, keypoints, CAP, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_detect(c, v, NULL, NULL, NULL, CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_detect(c, v, NULL, NULL, keypoints, -1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_detect(c, v, NULL, NULL, (tv_keypoint *)v->data, 1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_extract(c, v, NULL, NULL, keypoints, NULL, CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_extract(c, v, NULL, NULL, NULL, descriptors, CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        tv_extract(c, v, NULL, NULL, keypoints, descriptors, CAP, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_extract(c, v, NULL, NULL, keypoints, descriptors, -1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_extract(c, v, NULL, NULL, keypoints,
                                                   (uint8_t *)(keypoints + 1), CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_orient(c, v, NULL, 1, NULL, keypoints, CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_orient(c, v, &point, 1, NULL, NULL, CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_orient(c, v, &point, 1, NULL, keypoints, CAP, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_orient(c, v, &point, -1, NULL, keypoints, CAP, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_orient(c, v, &point, 1, NULL, keypoints, -1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_orient(c, v, keypoints, 2, NULL, keypoints + 1, CAP - 1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_describe(c, v, NULL, 1, NULL, descriptors));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_describe(c, v, &point, 1, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_describe(c, v, &point, -1, NULL, descriptors));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_describe(c, v, keypoints, 2, NULL, (uint8_t *)keypoints));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_describe(c, v, NULL, 0, NULL, NULL));
  /* an output that overlaps the image or the mask is refused */
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_detect(c, &other, v, NULL, (tv_keypoint *)v->data, 1, &count));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP, tv_extract(c, v, NULL, NULL, (tv_keypoint *)v->data, descriptors, 1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_extract(c, &other, v, NULL, keypoints, (uint8_t *)v->data, 1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_orient(c, v, &point, 1, NULL, (tv_keypoint *)v->data, 1, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_describe(c, v, &point, 1, NULL, (uint8_t *)v->data));
  TEST_ASSERT_EQUAL_INT(-7, count);
  TEST_ASSERT_TRUE(api_is_pattern(keypoints, sizeof keypoints));
  TEST_ASSERT_TRUE(api_is_pattern(descriptors, sizeof descriptors));
}

static void point_refused(tv_status expected, float x, float y, float size, float angle_rad) {
  tv_keypoint points[2] = {{50, 50, 4, 0, 1, 0}, {50, 50, 4, 0, 1, 0}};
  int32_t count = -7;
  points[1].x = x;
  points[1].y = y;
  points[1].size = size;
  points[1].angle_rad = angle_rad;
  TEST_ASSERT_EQUAL_INT(expected,
                        tv_orient(a.context, &image, points, 2, NULL, keypoints, CAP, &count));
  TEST_ASSERT_EQUAL_INT(expected, tv_describe(a.context, &image, points, 2, NULL, descriptors));
  TEST_ASSERT_EQUAL_INT(-7, count);
  TEST_ASSERT_TRUE(api_is_pattern(keypoints, sizeof keypoints));
  TEST_ASSERT_TRUE(api_is_pattern(descriptors, sizeof descriptors));
}

static void test_points_that_are_none_are_refused(void) {
  const float nan = (float)NAN, inf = (float)INFINITY;
  point_refused(TV_ERR_NOT_FINITE, nan, 5, 4, 0);
  point_refused(TV_ERR_NOT_FINITE, 5, -inf, 4, 0);
  point_refused(TV_ERR_NOT_FINITE, 5, 5, nan, 0);
  point_refused(TV_ERR_NOT_FINITE, 5, 5, 4, inf);
  point_refused(TV_ERR_ARGUMENT, 1e30f, 5, 4, 0);
  point_refused(TV_ERR_ARGUMENT, 5, -1e6f, 4, 0);
  point_refused(TV_ERR_ARGUMENT, 5, 5, 0, 0);
  point_refused(TV_ERR_ARGUMENT, 5, 5, -4, 0);
  point_refused(TV_ERR_ARGUMENT, 5, 5, 1e4f, 0);
  point_refused(TV_ERR_ARGUMENT, 5, 5, 4, 1e9f);
}

static void test_keypoint_sigmas_are_powers_of_the_size(void) {
  enum { NUM = 9 };
  const float sizes[NUM] = {4, 8, 5.64f, 4096, 0.004f, 2, 11.3f, 1e-30f, 4.0001f};
  const double exponents[] = {0, 0.5, 1, 2, 0.37};
  tv_keypoint points[NUM];
  float sigmas[NUM + 1];
  int e, k;
  for (k = 0; k < NUM; ++k) {
    const tv_keypoint point = {50, 50, 0, 0, 1, 7}; /* the level plays no part */
    points[k] = point;
    points[k].size = sizes[k];
  }
  sigmas[NUM] = -7;
  for (e = 0; e < 5; ++e) {
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_keypoint_sigmas(points, NUM, 4, exponents[e], sigmas));
    for (k = 0; k < NUM; ++k) {
      const double power = pow((double)sizes[k] / 4, exponents[e]);
      const double expected = power < 0.01 ? 0.01 : power > 1000 ? 1000 : power;
      TEST_ASSERT_DOUBLE_WITHIN(1e-6 * expected, expected, sigmas[k]);
      TEST_ASSERT_TRUE(exponents[e] != 0 || sigmas[k] == 1);
      TEST_ASSERT_TRUE(sigmas[k] >= 0.01f && sigmas[k] <= 1000.0f);
    }
    TEST_ASSERT_TRUE(sigmas[0] == 1);
  }
  TEST_ASSERT_TRUE(sigmas[NUM] == -7);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_keypoint_sigmas(NULL, 0, 4, 1, NULL));
}

static void sigmas_refused(tv_status expected, const tv_keypoint *points, int32_t num, float size,
                           double exponent, float *sigmas) {
  float before[2];
  if (sigmas != NULL) memcpy(before, sigmas, sizeof before);
  TEST_ASSERT_EQUAL_INT(expected, tv_keypoint_sigmas(points, num, size, exponent, sigmas));
  if (sigmas != NULL) TEST_ASSERT_EQUAL_MEMORY(before, sigmas, sizeof before);
}

static void test_keypoint_sigmas_check_their_arguments(void) {
  tv_keypoint points[2] = {{50, 50, 4, 0, 1, 0}, {50, 50, 4, 0, 1, 0}};
  float sigmas[2] = {-7, -7};
  const float nan = (float)NAN;
  sigmas_refused(TV_ERR_NULL, NULL, 2, 4, 1, sigmas);
  sigmas_refused(TV_ERR_NULL, points, 2, 4, 1, NULL);
  sigmas_refused(TV_ERR_ARGUMENT, points, -1, 4, 1, sigmas);
  sigmas_refused(TV_ERR_ARGUMENT, points, 2, 0, 1, sigmas);
  sigmas_refused(TV_ERR_ARGUMENT, points, 2, -4, 1, sigmas);
  sigmas_refused(TV_ERR_ARGUMENT, points, 2, 4097, 1, sigmas);
  sigmas_refused(TV_ERR_NOT_FINITE, points, 2, nan, 1, sigmas);
  sigmas_refused(TV_ERR_ARGUMENT, points, 2, 4, -0.1, sigmas);
  sigmas_refused(TV_ERR_ARGUMENT, points, 2, 4, 2.1, sigmas);
  sigmas_refused(TV_ERR_NOT_FINITE, points, 2, 4, INFINITY, sigmas);
  sigmas_refused(TV_ERR_OVERLAP, points, 2, 4, 1, &points[1].score);
  points[1].size = 0;
  sigmas_refused(TV_ERR_ARGUMENT, points, 2, 4, 1, sigmas);
  points[1].size = nan;
  sigmas_refused(TV_ERR_NOT_FINITE, points, 2, 4, 1, sigmas);
}

static void test_capacity_is_told_and_nothing_is_written(void) {
  const int32_t all = detect(a.context, others),
                described = extract(a.context, others, descriptors);
  int32_t count = 0;
  clear_outputs();
  TEST_ASSERT_TRUE(all > 50 && described >= all);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_detect(a.context, &image, NULL, &options, keypoints, all - 1, &count));
  TEST_ASSERT_EQUAL_INT(all, count);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, tv_extract(a.context, &image, NULL, &options, keypoints,
                                                    descriptors, described - 1, &count));
  TEST_ASSERT_EQUAL_INT(described, count);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_detect(a.context, &image, NULL, &options, NULL, 0, &count));
  TEST_ASSERT_TRUE(api_is_pattern(keypoints, sizeof keypoints));
  TEST_ASSERT_TRUE(api_is_pattern(descriptors, sizeof descriptors));
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_detect(a.context, &image, NULL, &options, keypoints, all, &count));
  TEST_ASSERT_TRUE(
      api_is_pattern(keypoints + all, sizeof keypoints - (size_t)all * sizeof keypoints[0]));
  clear_outputs();
  options.orientation = TV_ORIENTATION_GRADIENT;
  detect(a.context, others);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_orient(a.context, &image, others, 20, &options, keypoints, 19, &count));
  TEST_ASSERT_TRUE(count >= 20 && api_is_pattern(keypoints, sizeof keypoints));
}

static void test_keypoints_are_in_order_and_inside(void) {
  const float sizes[4] = {4.0f, 5.2f, 6.76f, 8.788f}; /* px; a level is 1.3 times larger */
  int32_t count, k;
  options.levels = 4;
  options.scale_factor = 1.3f;
  count = detect(a.context, keypoints);
  TEST_ASSERT_TRUE(count > 100);
  for (k = 0; k < count; ++k) {
    const tv_keypoint *p = &keypoints[k], *q = k > 0 ? p - 1 : p;
    TEST_ASSERT_TRUE(p->x > -0.5f && p->x < WIDTH - 0.5f && p->y > -0.5f && p->y < HEIGHT - 0.5f);
    TEST_ASSERT_TRUE(p->score >= 1 && p->score <= 254 && p->level >= 0 && p->level < 4);
    TEST_ASSERT_TRUE(p->angle_rad == 0.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-3f, sizes[p->level], p->size);
    if (k == 0) continue;
    TEST_ASSERT_TRUE(q->score >= p->score);
    if (q->score > p->score) continue;
    TEST_ASSERT_TRUE(q->level < p->level ||
                     (q->level == p->level && (q->y < p->y || (q->y == p->y && q->x < p->x))));
  }
}

static void test_extract_is_detect_orient_describe(void) {
  static const int32_t kinds[2] = {TV_ORIENTATION_UPRIGHT, TV_ORIENTATION_GRADIENT};
  int k;
  for (k = 0; k < 2; ++k) {
    int32_t corners, oriented = 0, extracted;
    options.orientation = kinds[k];
    options.max_keypoints = 120;
    corners = detect(a.context, keypoints);
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_orient(a.context, &image, keypoints, corners, &options, others, CAP, &oriented));
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_describe(a.context, &image, others, oriented, &options, other_descriptors));
    options.max_keypoints = CAP; /* so many that no second orientation is left out */
    options.levels = 1;
    options.cell_px = 0;
    options.min_threshold = 0;
    corners = detect(a.context, keypoints);
    if (corners > CAP / 2) corners = CAP / 2;
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_orient(a.context, &image, keypoints, corners, &options, others, CAP, &oriented));
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_describe(a.context, &image, others, oriented, &options, other_descriptors));
    TEST_ASSERT_TRUE(k == 0 ? oriented == corners : oriented > corners);
    extracted = extract(a.context, keypoints, descriptors);
    TEST_ASSERT_TRUE(extracted >= corners);
    if (extracted > oriented) extracted = oriented;
    TEST_ASSERT_EQUAL_MEMORY(others, keypoints, 50 * sizeof keypoints[0]);
    TEST_ASSERT_EQUAL_MEMORY(other_descriptors, descriptors, 50 * TV_DESCRIPTOR_BYTES);
  }
}

static void test_max_keypoints_bounds_descriptors(void) {
  static const int32_t most[] = {1, 2, 7, 60, 200};
  size_t k;
  options.orientation = TV_ORIENTATION_GRADIENT;
  for (k = 0; k < sizeof most / sizeof most[0]; ++k) {
    options.max_keypoints = most[k];
    TEST_ASSERT_EQUAL_INT(most[k], detect(a.context, keypoints));
    TEST_ASSERT_EQUAL_INT(most[k], extract(a.context, others, descriptors));
    TEST_ASSERT_EQUAL_FLOAT(keypoints[0].x, others[0].x);
  }
}

static void test_padding_is_never_read(void) {
  uint64_t seed = 72;
  int32_t count, other_count, y;
  options.levels = 3;
  options.scale_factor = 1.5f;
  count = extract(a.context, keypoints, descriptors);
  random_bytes(&seed, padded, sizeof padded);
  for (y = 0; y < HEIGHT; ++y) memcpy(padded + y * (WIDTH + 13), pixels + y * WIDTH, WIDTH);
  image = api_image(padded, WIDTH, HEIGHT, WIDTH + 13);
  other_count = extract(a.context, others, other_descriptors);
  TEST_ASSERT_EQUAL_INT(count, other_count);
  TEST_ASSERT_EQUAL_MEMORY(keypoints, others, sizeof keypoints);
  TEST_ASSERT_EQUAL_MEMORY(descriptors, other_descriptors, sizeof descriptors);
}

static void test_the_mask_keeps_corners_where_it_is_not_zero(void) {
  const tv_image mask = api_image(mask_pixels, WIDTH, HEIGHT, WIDTH);
  int32_t all, count = 0, kept = 0, k, x, y;
  options.subpixel = 0;
  options.levels = 1;
  options.cell_px = 0;
  options.min_threshold = 0;
  options.threshold = 40;
  all = detect(a.context, others);
  TEST_ASSERT_TRUE(all > 20 && all < CAP);
  for (y = 0; y < HEIGHT; ++y) {
    for (x = 0; x < WIDTH; ++x) mask_pixels[y * WIDTH + x] = (x / 16 + y / 16) % 2 ? 1 : 0;
  }
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_detect(a.context, &image, &mask, &options, keypoints, CAP, &count));
  for (k = 0; k < all; ++k) {
    if (mask_pixels[(int)others[k].y * WIDTH + (int)others[k].x] == 0) continue;
    TEST_ASSERT_EQUAL_MEMORY(&others[k], &keypoints[kept++], sizeof keypoints[0]);
  }
  TEST_ASSERT_EQUAL_INT(kept, count);
  TEST_ASSERT_TRUE(kept > 5 && kept < all);
  memset(mask_pixels, 0, sizeof mask_pixels);
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_detect(a.context, &image, &mask, &options, keypoints, CAP, &count));
  TEST_ASSERT_EQUAL_INT(0, count);
}

/* Corners move by up to three pixels to a maximum: never to one that another corner has, nor into
   the part that is masked out, of which a maximum's pixel is no part. */
static void test_corners_that_move_meet_no_other_and_no_mask(void) {
  const tv_image mask = api_image(mask_pixels, WIDTH, HEIGHT, WIDTH);
  uint64_t seed = 74;
  int32_t count = 0, k, x, y;
  random_bytes(&seed, pixels, sizeof pixels);
  options.levels = 1;
  for (y = 0; y < HEIGHT; ++y) {
    for (x = 0; x < WIDTH; ++x) mask_pixels[y * WIDTH + x] = (x / 8 + y / 8) % 2 ? 1 : 0;
  }
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_detect(a.context, &image, &mask, &options, keypoints, CAP, &count));
  TEST_ASSERT_TRUE(count > 50);
  for (k = 0; k < count; ++k) {
    int32_t near_kept = 0, other;
    for (other = 0; other < k; ++other) {
      TEST_ASSERT_TRUE(keypoints[k].x != keypoints[other].x ||
                       keypoints[k].y != keypoints[other].y);
    }
    for (y = 0; y < HEIGHT; ++y) {
      for (x = 0; x < WIDTH; ++x) {
        near_kept |= mask_pixels[y * WIDTH + x] != 0 && fabsf(keypoints[k].x - (float)x) <= 1.0f &&
                     fabsf(keypoints[k].y - (float)y) <= 1.0f;
      }
    }
    TEST_ASSERT_EQUAL_INT(1, near_kept);
  }
}

static void test_a_blank_or_tiny_image_has_no_corners(void) {
  static const int32_t sizes[][2] = {{1, 1}, {1, HEIGHT}, {WIDTH, 1},
                                     {6, 6}, {WIDTH, 6},  {6, HEIGHT}};
  size_t k;
  memset(pixels, 128, sizeof pixels);
  options.levels = 8;
  TEST_ASSERT_EQUAL_INT(0, detect(a.context, keypoints));
  TEST_ASSERT_EQUAL_INT(0, extract(a.context, keypoints, descriptors));
  api_draw(73, pixels, WIDTH, HEIGHT);
  for (k = 0; k < sizeof sizes / sizeof sizes[0]; ++k) {
    image = api_image(pixels, sizes[k][0], sizes[k][1], WIDTH);
    TEST_ASSERT_EQUAL_INT(0, extract(a.context, keypoints, descriptors));
  }
  TEST_ASSERT_TRUE(api_is_pattern(keypoints, sizeof keypoints));
}

/* A corner of level 7 with the largest keypoint_size has a size of 4096 pixels. An image of one row
   has no octave but the first, so that the patch reaches far beyond it. */
static void test_the_largest_size_is_described_in_any_image(void) {
  const tv_keypoint points[3] = {
      {0, 0, 4096, 0.8f, 1, 0}, {WIDTH, 0, 4096, -2.4f, 1, 0}, {9e4f, -9e4f, 4096, 2, 1, 0}};
  const int32_t sizes[3][2] = {{WIDTH, HEIGHT}, {WIDTH, 1}, {1, HEIGHT}};
  int32_t count = 0, k;
  for (k = 0; k < 3; ++k) {
    image = api_image(pixels, sizes[k][0], sizes[k][1], WIDTH);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_describe(a.context, &image, points, 3, &options, descriptors));
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_orient(a.context, &image, points, 3, &options, keypoints, CAP, &count));
    TEST_ASSERT_TRUE(count >= 3);
  }
}

static void test_any_point_of_a_1x1_image_is_described(void) {
  const tv_keypoint points[3] = {
      {0, 0, 4, 0, 1, 0}, {-300, 9e4f, 512, 3, 1, 0}, {0, 0, 1e-30f, 1, 1, 0}};
  int32_t count = 0;
  image = api_image(pixels, 1, 1, 1);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_describe(a.context, &image, points, 3, &options, descriptors));
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_orient(a.context, &image, points, 3, &options, keypoints, CAP, &count));
  TEST_ASSERT_EQUAL_INT(3, count);
  for (count = 0; count < 3 * TV_DESCRIPTOR_BYTES; ++count) {
    TEST_ASSERT_EQUAL_INT(0, descriptors[count]);
  }
}

/* All strong corners lie in the left half: without a grid they use up max_keypoints. */
static void test_a_grid_spreads_the_corners(void) {
  int32_t count, k, right[2] = {0, 0}, with_grid;
  for (k = 0; k < WIDTH * HEIGHT; ++k) {
    if (k % WIDTH >= WIDTH / 2) pixels[k] = (uint8_t)(110 + pixels[k] / 6);
  }
  options.max_keypoints = 60;
  options.threshold = options.min_threshold = 5;
  for (with_grid = 0; with_grid < 2; ++with_grid) {
    options.cell_px = with_grid ? 30 : 0;
    count = detect(a.context, keypoints);
    TEST_ASSERT_EQUAL_INT(60, count);
    for (k = 0; k < count; ++k) right[with_grid] += keypoints[k].x >= WIDTH / 2;
  }
  TEST_ASSERT_TRUE(right[0] < 3);
  TEST_ASSERT_TRUE(right[1] > 10); /* the right half has 24 cells, some without a corner */
}

/* The threshold falls only until max_keypoints corners are found, and never below min_threshold. */
static void test_the_threshold_adapts(void) {
  int32_t strict, count, k, lowest = 255;
  options.threshold = 120;
  options.min_threshold = 0;
  strict = detect(a.context, keypoints);
  TEST_ASSERT_TRUE(strict < 100);
  options.min_threshold = 20;
  options.max_keypoints = strict + 40;
  count = detect(a.context, keypoints);
  TEST_ASSERT_EQUAL_INT(strict + 40, count);
  for (k = 0; k < count; ++k) {
    if (keypoints[k].score < lowest) lowest = (int32_t)keypoints[k].score;
  }
  TEST_ASSERT_TRUE(lowest < 120 && lowest >= 20);
  options.max_keypoints = CAP;
  options.min_threshold = 119;
  count = detect(a.context, keypoints);
  for (k = 0; k < count; ++k) TEST_ASSERT_TRUE(keypoints[k].score >= 119);
}

static void test_interleaved_contexts_give_the_bytes_of_separate_ones(void) {
  const tv_limits limits = limits_of(WIDTH, HEIGHT, CAP, TV_KERNELS_AUTO);
  api_context b = api_make(&limits);
  int32_t count = extract(a.context, keypoints, descriptors), other_count;
  api_draw(74, padded, WIDTH, HEIGHT);
  image.data = padded;
  extract(b.context, others, other_descriptors);
  extract(a.context, others, other_descriptors);
  image.data = pixels;
  clear_outputs();
  other_count = extract(b.context, others, other_descriptors);
  count = extract(a.context, keypoints, descriptors);
  TEST_ASSERT_EQUAL_INT(count, other_count);
  TEST_ASSERT_EQUAL_MEMORY(keypoints, others, sizeof keypoints);
  TEST_ASSERT_EQUAL_MEMORY(descriptors, other_descriptors, sizeof descriptors);
  api_release(&b);
}

/* All combinations of levels, factors, cells and odd sizes; mainly for the sanitizers. The
   context is made for exactly the image's size and the image is a heap block of its own, so that
   the sanitizers and api_release report an access beyond either. */
static void test_options_work_in_all_combinations(void) {
  static const float factors[] = {1.1f, 1.2345f, 1.5f, 1.99f, 2.0f};
  static const int32_t cells[] = {0, 8, 31, 16384}, levels[] = {1, 2, 5, 8};
  static const int32_t sizes[][2] = {{7, 7}, {24, 25}, {53, 49}, {131, 97}, {WIDTH, 33}};
  size_t f, c, l, s;
  int combination = 0;
  for (s = 0; s < sizeof sizes / sizeof sizes[0]; ++s) {
    const tv_limits limits = limits_of(sizes[s][0], sizes[s][1], CAP, TV_KERNELS_AUTO);
    uint8_t *exact = (uint8_t *)malloc((size_t)sizes[s][0] * (size_t)sizes[s][1]);
    image = api_image(exact, sizes[s][0], sizes[s][1], sizes[s][0]);
    api_draw(75 + s, exact, sizes[s][0], sizes[s][1]);
    for (f = 0; f < sizeof factors / sizeof factors[0]; ++f) {
      for (c = 0; c < sizeof cells / sizeof cells[0]; ++c) {
        for (l = 0; l < sizeof levels / sizeof levels[0]; ++l, ++combination) {
          api_context b = api_make(&limits);
          int32_t count, k;
          options.levels = levels[l];
          options.scale_factor = factors[f];
          options.cell_px = cells[c];
          options.arc = 9 + combination % 4;
          options.subpixel = combination / 4 % 2;
          options.orientation = combination / 8 % 2;
          options.max_keypoints = combination % 3 ? CAP : 25;
          options.threshold = 1 + combination % 40;
          options.min_threshold = combination % 5 ? 1 : 0;
          options.keypoint_size = combination % 7 ? 4.0f : 32.0f;
          count = extract(b.context, keypoints, descriptors);
          TEST_ASSERT_TRUE(count <= options.max_keypoints);
          for (k = 0; k < count; ++k) {
            TEST_ASSERT_TRUE(keypoints[k].x > 0 && keypoints[k].x < image.width - 1);
            TEST_ASSERT_TRUE(keypoints[k].y > 0 && keypoints[k].y < image.height - 1);
          }
          api_release(&b);
        }
      }
    }
    free(exact);
  }
}

/* A real pair with every kernel set: the same keypoints, descriptors and matches. */
static void test_every_kernel_set_gives_the_same_bytes(void) {
  enum { MANY = 1500 };
  static tv_keypoint points[2][2][MANY];
  static uint8_t rows[2][2][MANY * TV_DESCRIPTOR_BYTES];
  static tv_correspondence found[2][MANY];
  int32_t counts[2][2], num_found[2], set, view, levels;
  real_pair pair;
  if (!real_pair_load(&pair)) TEST_IGNORE_MESSAGE("no real images");
  options.max_keypoints = MANY;
  for (levels = 1; levels <= 4; levels += 3) {
    options.levels = levels;
    options.scale_factor = levels == 1 ? 2.0f : 1.4f;
    for (set = TV_KERNELS_C; set <= TV_KERNELS_NEON; ++set) {
      const int slot = set != TV_KERNELS_C;
      tv_limits limits = limits_of(pair.width, pair.height, MANY, set);
      api_context b;
      if (api_try(&limits, &b) == TV_ERR_KERNELS) continue;
      for (view = 0; view < 2; ++view) {
        const tv_image luma = api_image(pair.luma[view], pair.width, pair.height, pair.width);
        TEST_ASSERT_EQUAL_INT(TV_OK,
                              tv_extract(b.context, &luma, NULL, &options, points[slot][view],
                                         rows[slot][view], MANY, &counts[slot][view]));
      }
      TEST_ASSERT_EQUAL_INT(TV_OK,
                            match_rows(b.context, rows[slot][0], counts[slot][0], rows[slot][1],
                                       counts[slot][1], NULL, found[slot], MANY, &num_found[slot]));
      api_release(&b);
      if (slot == 0) {
        TEST_ASSERT_TRUE(num_found[0] > 100);
        continue;
      }
      TEST_ASSERT_EQUAL_MEMORY(counts[0], counts[1], sizeof counts[0]);
      TEST_ASSERT_EQUAL_INT(num_found[0], num_found[1]);
      TEST_ASSERT_EQUAL_MEMORY(points[0], points[1], sizeof points[0]);
      TEST_ASSERT_EQUAL_MEMORY(rows[0], rows[1], sizeof rows[0]);
      TEST_ASSERT_EQUAL_MEMORY(found[0], found[1], (size_t)num_found[0] * sizeof found[0][0]);
    }
  }
  free(pair.luma[0]);
  free(pair.luma[1]);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_images_that_are_none_are_refused);
  RUN_TEST(test_masks_of_another_shape_are_refused);
  RUN_TEST(test_options_out_of_range_are_refused);
  RUN_TEST(test_output_pointers_are_checked);
  RUN_TEST(test_points_that_are_none_are_refused);
  RUN_TEST(test_keypoint_sigmas_are_powers_of_the_size);
  RUN_TEST(test_keypoint_sigmas_check_their_arguments);
  RUN_TEST(test_capacity_is_told_and_nothing_is_written);
  RUN_TEST(test_keypoints_are_in_order_and_inside);
  RUN_TEST(test_extract_is_detect_orient_describe);
  RUN_TEST(test_max_keypoints_bounds_descriptors);
  RUN_TEST(test_padding_is_never_read);
  RUN_TEST(test_the_mask_keeps_corners_where_it_is_not_zero);
  RUN_TEST(test_corners_that_move_meet_no_other_and_no_mask);
  RUN_TEST(test_a_blank_or_tiny_image_has_no_corners);
  RUN_TEST(test_the_largest_size_is_described_in_any_image);
  RUN_TEST(test_any_point_of_a_1x1_image_is_described);
  RUN_TEST(test_a_grid_spreads_the_corners);
  RUN_TEST(test_the_threshold_adapts);
  RUN_TEST(test_interleaved_contexts_give_the_bytes_of_separate_ones);
  RUN_TEST(test_options_work_in_all_combinations);
  RUN_TEST(test_every_kernel_set_gives_the_same_bytes);
  return UNITY_END();
}
