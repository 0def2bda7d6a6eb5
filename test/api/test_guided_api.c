/* Tests of tv_match_guided: every status of match.h, outputs that stay untouched on errors, and
   determinism. The matches themselves are checked in test/unit/test_guided.c. */

#include <math.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { COUNT = 40 };

static tv_keypoint keypoints0[COUNT + 1], keypoints1[COUNT + 1];
static uint8_t descriptors0[(COUNT + 1) * TV_DESCRIPTOR_BYTES];
static uint8_t descriptors1[(COUNT + 1) * TV_DESCRIPTOR_BYTES];
static tv_correspondence found[COUNT];
static tv_camera camera;
static double sideways[9]; /* E of a sideways motion: epipolar lines are image rows */
static api_context a;

static tv_limits small_limits(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 8;
  limits.max_keypoints = COUNT;
  return limits;
}

void setUp(void) {
  static const double rows[9] = {0, 0, 0, 0, 0, -1, 0, 1, 0};
  const tv_limits limits = small_limits();
  uint64_t state = 71;
  size_t k;
  a = api_make(&limits);
  memcpy(sideways, rows, sizeof sideways);
  memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_BROWN_CONRADY;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  random_bytes(&state, descriptors0, sizeof descriptors0);
  memcpy(descriptors1, descriptors0, sizeof descriptors0);
  for (k = 0; k < sizeof descriptors1; k += 7) descriptors1[k] ^= 5;
  memset(keypoints0, 0, sizeof keypoints0);
  for (k = 0; k < COUNT + 1; ++k) {
    keypoints0[k].x = 100.0f + 10.0f * (float)k;
    keypoints0[k].y = 30.0f + 10.0f * (float)k;
    keypoints0[k].size = 4.0f;
  }
  memcpy(keypoints1, keypoints0, sizeof keypoints1);
  for (k = 0; k < COUNT + 1; ++k) keypoints1[k].x -= 25.0f;
  memset(found, API_PATTERN, sizeof found);
}

void tearDown(void) { api_release(&a); }

typedef struct call {
  tv_context *context;
  const tv_camera *camera0, *camera1;
  const double *epipolar;
  const tv_keypoint *keypoints0, *keypoints1;
  const uint8_t *descriptors0, *descriptors1;
  int32_t num0, num1;
  const tv_guided_options *options;
  tv_correspondence *out;
  int32_t capacity;
} call;

static call good_call(void) {
  call c;
  c.context = a.context;
  c.camera0 = c.camera1 = &camera;
  c.epipolar = sideways;
  c.keypoints0 = keypoints0;
  c.keypoints1 = keypoints1;
  c.descriptors0 = descriptors0;
  c.descriptors1 = descriptors1;
  c.num0 = c.num1 = COUNT;
  c.options = NULL;
  c.out = found;
  c.capacity = COUNT;
  return c;
}

static tv_status run(const call *c, int32_t *count) {
  return match_rows_guided(c->context, c->camera0, c->camera1, c->epipolar, c->keypoints0,
                           c->descriptors0, c->num0, c->keypoints1, c->descriptors1, c->num1,
                           c->options, c->out, c->capacity, count);
}

static void refused(tv_status expected, const call *c) {
  int32_t count = -7;
  TEST_ASSERT_EQUAL_INT(expected, run(c, &count));
  TEST_ASSERT_EQUAL_INT(-7, count);
  TEST_ASSERT_TRUE(api_is_pattern(found, sizeof found));
}

static void test_null_pointers_are_refused(void) {
  call c = good_call();
  c.context = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  c.epipolar = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  c.keypoints0 = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  c.keypoints1 = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  c.descriptors0 = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  c.descriptors1 = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  c.out = NULL;
  refused(TV_ERR_NULL, &c);
  c = good_call();
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, run(&c, NULL));
  c.camera0 = NULL; /* only one of the two cameras is given */
  refused(TV_ERR_ARGUMENT, &c);
}

static void test_counts_out_of_range_are_refused(void) {
  call c = good_call();
  c.num0 = -1;
  refused(TV_ERR_ARGUMENT, &c);
  c = good_call();
  c.num1 = INT32_MIN;
  refused(TV_ERR_ARGUMENT, &c);
  c = good_call();
  c.capacity = -1;
  refused(TV_ERR_ARGUMENT, &c);
  c = good_call();
  c.num0 = COUNT + 1;
  refused(TV_ERR_LIMITS, &c);
  c = good_call();
  c.num1 = INT32_MAX;
  refused(TV_ERR_LIMITS, &c);
}

static void test_an_output_over_an_input_is_refused(void) {
  call c = good_call();
  c.keypoints0 = (const tv_keypoint *)found;
  refused(TV_ERR_OVERLAP, &c);
  c = good_call();
  c.descriptors1 = (const uint8_t *)found;
  c.num1 = 1;
  refused(TV_ERR_OVERLAP, &c);
}

static void test_bad_numbers_are_refused(void) {
  static const double bad[3] = {NAN, INFINITY, -INFINITY};
  size_t k;
  call c = good_call();
  for (k = 0; k < 9; ++k) {
    const double kept = sideways[k];
    sideways[k] = bad[k % 3];
    refused(TV_ERR_NOT_FINITE, &c);
    sideways[k] = kept;
  }
  for (k = 0; k < 3; ++k) {
    keypoints1[COUNT - 1].y = (float)bad[k];
    refused(TV_ERR_NOT_FINITE, &c);
    keypoints1[COUNT - 1].y = 7;
  }
  camera.fx = 0;
  refused(TV_ERR_CAMERA, &c);
}

static void test_the_scale_of_the_matrix_does_not_matter(void) {
  static const double scales[4] = {1e-300, 1e-160, -3, 1e300};
  call c = good_call();
  int32_t first = 0, count;
  size_t s, k;
  double kept[9];
  memcpy(kept, sideways, sizeof kept);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &first));
  TEST_ASSERT_TRUE(first > 0);
  for (s = 0; s < 4; ++s) {
    for (k = 0; k < 9; ++k) sideways[k] = kept[k] * scales[s];
    TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &count));
    TEST_ASSERT_EQUAL_INT(first, count);
  }
  memcpy(sideways, kept, sizeof kept);
}

static void test_options_out_of_range_are_refused(void) {
  static const float bad[4][6] = {{0.0f, 0.009f, 1000.1f, (float)NAN, (float)INFINITY, -1.0f},
                                  {0.0f, -0.5f, 1.0001f, (float)NAN, (float)INFINITY, 2.0f},
                                  {0.0f, -1.0f, 3000.1f, (float)NAN, (float)INFINITY, -0.001f},
                                  {-0.001f, -1.0f, 1000.1f, (float)NAN, (float)INFINITY, 2000.0f}};
  tv_guided_options options;
  call c = good_call();
  size_t field, k;
  tv_guided_options_init(NULL);
  c.options = &options;
  for (field = 0; field < 4; ++field) {
    for (k = 0; k < 6; ++k) {
      tv_guided_options_init(&options);
      *(field == 0   ? &options.max_error_px
        : field == 1 ? &options.ratio
        : field == 2 ? &options.max_distance
                     : &options.neighbourhood_px) = bad[field][k];
      refused(TV_ERR_ARGUMENT, &c);
    }
  }
  tv_guided_options_init(&options);
  options.struct_size += 1;
  refused(TV_ERR_STRUCT_SIZE, &c);
}

static void test_huge_numbers_give_no_match_and_no_crash(void) {
  call c = good_call();
  int32_t count = -7;
  size_t k;
  for (k = 0; k < 9; ++k) sideways[k] = k % 2 ? 1e308 : -1e308;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &count));
  TEST_ASSERT_EQUAL_INT(0, count);
  for (k = 0; k < 9; ++k) sideways[k] = 5e-324;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &count));
  TEST_ASSERT_EQUAL_INT(0, count);
}

static void test_a_full_context_matches_in_its_memory(void) {
  call c = good_call();
  tv_guided_options options;
  int32_t count = 0, k;
  tv_guided_options_init(&options);
  options.max_distance = 3000;
  options.max_error_px = 1000; /* 1000 px: every pair of keypoints is a candidate */
  c.options = &options;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &count));
  TEST_ASSERT_EQUAL_INT(COUNT, count);
  for (k = 0; k < count; ++k) TEST_ASSERT_EQUAL_INT(k, found[k].idx1);
}

static void test_capacity_is_told_and_the_least_of_both_is_enough(void) {
  call c = good_call();
  int32_t count = 0;
  c.num1 = 20;
  c.capacity = 19;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, run(&c, &count));
  TEST_ASSERT_EQUAL_INT(20, count);
  TEST_ASSERT_TRUE(api_is_pattern(found, sizeof found));
  c.capacity = 20;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &count));
  TEST_ASSERT_TRUE(api_is_pattern(found + 20, sizeof found - 20 * sizeof found[0]));
}

static void test_an_empty_side_gives_no_matches(void) {
  call c = good_call();
  int32_t count = -7;
  c.num0 = 0;
  c.keypoints0 = NULL;
  c.descriptors0 = NULL;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(&c, &count));
  TEST_ASSERT_EQUAL_INT(0, count);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_counts_out_of_range_are_refused);
  RUN_TEST(test_an_output_over_an_input_is_refused);
  RUN_TEST(test_bad_numbers_are_refused);
  RUN_TEST(test_the_scale_of_the_matrix_does_not_matter);
  RUN_TEST(test_options_out_of_range_are_refused);
  RUN_TEST(test_huge_numbers_give_no_match_and_no_crash);
  RUN_TEST(test_a_full_context_matches_in_its_memory);
  RUN_TEST(test_capacity_is_told_and_the_least_of_both_is_enough);
  RUN_TEST(test_an_empty_side_gives_no_matches);
  return UNITY_END();
}
