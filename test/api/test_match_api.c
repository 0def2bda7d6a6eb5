/* Tests of tv_match: every status of match.h, outputs that stay untouched on errors, and
   determinism. The matches themselves are checked in test/unit/test_match.c. */

#include <math.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { COUNT = 50 };

static uint8_t descriptors0[(COUNT + 1) * TV_DESCRIPTOR_BYTES];
static uint8_t descriptors1[(COUNT + 1) * TV_DESCRIPTOR_BYTES];
static tv_correspondence found[COUNT];
static api_context a;

static tv_limits small_limits(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 8;
  limits.max_keypoints = COUNT;
  return limits;
}

void setUp(void) {
  const tv_limits limits = small_limits();
  uint64_t state = 61;
  size_t k;
  a = api_make(&limits);
  random_bytes(&state, descriptors0, sizeof descriptors0);
  memcpy(descriptors1, descriptors0, sizeof descriptors0);
  for (k = 0; k < sizeof descriptors1; k += 7) descriptors1[k] ^= 5;
  memset(found, API_PATTERN, sizeof found);
}

void tearDown(void) { api_release(&a); }

static void refused(tv_status expected, tv_context *context, const uint8_t *d0, int32_t num0,
                    const uint8_t *d1, int32_t num1, const tv_match_options *options,
                    int32_t capacity) {
  int32_t count = -7;
  TEST_ASSERT_EQUAL_INT(expected,
                        match_rows(context, d0, num0, d1, num1, options, found, capacity, &count));
  TEST_ASSERT_EQUAL_INT(-7, count);
  TEST_ASSERT_TRUE(api_is_pattern(found, sizeof found));
}

static void test_null_pointers_are_refused(void) {
  int32_t count;
  refused(TV_ERR_NULL, NULL, descriptors0, 1, descriptors1, 1, NULL, 1);
  refused(TV_ERR_NULL, a.context, NULL, 1, descriptors1, 1, NULL, 1);
  refused(TV_ERR_NULL, a.context, descriptors0, 1, NULL, 1, NULL, 1);
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_NULL, match_rows(a.context, descriptors0, 1, descriptors1, 1, NULL, found, 1, NULL));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_NULL, match_rows(a.context, descriptors0, 1, descriptors1, 1, NULL, NULL, 1, &count));
}

static void test_counts_out_of_range_are_refused(void) {
  refused(TV_ERR_ARGUMENT, a.context, descriptors0, -1, descriptors1, 1, NULL, 1);
  refused(TV_ERR_ARGUMENT, a.context, descriptors0, 1, descriptors1, INT32_MIN, NULL, 1);
  refused(TV_ERR_ARGUMENT, a.context, descriptors0, 1, descriptors1, 1, NULL, -1);
  refused(TV_ERR_OVERLAP, a.context, (const uint8_t *)found, 1, descriptors1, 1, NULL, 1);
  refused(TV_ERR_OVERLAP, a.context, descriptors0, 1, (const uint8_t *)found, 1, NULL, 1);
  refused(TV_ERR_LIMITS, a.context, descriptors0, COUNT + 1, descriptors1, 1, NULL, COUNT);
  refused(TV_ERR_LIMITS, a.context, descriptors0, 1, descriptors1, COUNT + 1, NULL, COUNT);
  refused(TV_ERR_LIMITS, a.context, descriptors0, INT32_MAX, descriptors1, 1, NULL, COUNT);
}

static void test_options_out_of_range_are_refused(void) {
  const float bad[] = {0.0f, -0.5f, 1.0001f, (float)NAN, (float)INFINITY, -(float)INFINITY};
  tv_match_options options;
  size_t k;
  tv_match_options_init(NULL);
  tv_match_options_init(&options);
  for (k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    options.ratio = bad[k];
    refused(TV_ERR_ARGUMENT, a.context, descriptors0, 9, descriptors1, 9, &options, 9);
  }
  tv_match_options_init(&options);
  options.struct_size -= 1;
  refused(TV_ERR_STRUCT_SIZE, a.context, descriptors0, 9, descriptors1, 9, &options, 9);
}

static void test_a_neighbourhood_requires_finite_keypoints(void) {
  static tv_keypoint keypoints[COUNT];
  const float bad_px[] = {-0.5f, 1000.5f, (float)NAN, (float)INFINITY};
  const float bad_distance[] = {-1.0f, 3000.5f, (float)NAN, (float)INFINITY};
  tv_features features[2];
  tv_match_options options;
  int32_t count = -7;
  size_t k;
  tv_match_options_init(&options);
  for (k = 0; k < 4; ++k) {
    options.max_distance = bad_distance[k];
    refused(TV_ERR_ARGUMENT, a.context, descriptors0, 9, descriptors1, 9, &options, 9);
    options.max_distance = 0;
    options.neighbourhood_px = bad_px[k];
    refused(TV_ERR_ARGUMENT, a.context, descriptors0, 9, descriptors1, 9, &options, 9);
  }
  options.neighbourhood_px = 5;
  for (k = 0; k < COUNT; ++k) keypoints[k].x = 10 * (float)k, keypoints[k].size = 4;
  features[0] = features_of(keypoints, descriptors0, COUNT);
  features[1] = features_of(NULL, descriptors1, COUNT);
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_NULL, tv_match(a.context, &features[0], &features[1], &options, found, COUNT, &count));
  features[1].keypoints = keypoints;
  keypoints[COUNT - 1].y = (float)NAN;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_match(a.context, &features[0], &features[1], &options,
                                                    found, COUNT, &count));
  keypoints[COUNT - 1].y = 2e5f;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_match(a.context, &features[0], &features[1], &options,
                                                  found, COUNT, &count));
  TEST_ASSERT_EQUAL_INT(-7, count);
  TEST_ASSERT_TRUE(api_is_pattern(found, sizeof found));
  keypoints[COUNT - 1].y = 2;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_match(a.context, &features[0], &features[1], &options, found, COUNT, &count));
  TEST_ASSERT_EQUAL_INT(COUNT, count);
}

/* Descriptors of other programs come without keypoints. */
static void test_without_any_keypoints_there_is_no_neighbourhood(void) {
  static tv_correspondence plain[COUNT];
  tv_match_options options;
  int32_t count = 0, num_plain = 0;
  tv_match_options_init(&options);
  TEST_ASSERT_TRUE(options.neighbourhood_px > 0);
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(a.context, descriptors0, COUNT, descriptors1, COUNT,
                                          &options, found, COUNT, &count));
  options.neighbourhood_px = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(a.context, descriptors0, COUNT, descriptors1, COUNT,
                                          &options, plain, COUNT, &num_plain));
  TEST_ASSERT_EQUAL_INT(num_plain, count);
  TEST_ASSERT_EQUAL_MEMORY(plain, found, (size_t)count * sizeof plain[0]);
}

/* An options struct of version 0.1.0 ends behind the ratio. */
static void test_old_options_have_no_neighbourhood(void) {
  tv_match_options options;
  int32_t count = 0;
  tv_match_options_init_sized(&options, 8);
  options.neighbourhood_px = options.max_distance = (float)NAN;
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(a.context, descriptors0, COUNT, descriptors1, COUNT,
                                          &options, found, COUNT, &count));
  TEST_ASSERT_EQUAL_INT(COUNT, count);
}

static void test_a_full_context_matches_in_its_memory(void) {
  int32_t count = 0, k;
  tv_match_options options;
  tv_match_options_init(&options);
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(a.context, descriptors0, COUNT, descriptors1, COUNT,
                                          &options, found, COUNT, &count));
  TEST_ASSERT_EQUAL_INT(COUNT, count);
  for (k = 0; k < count; ++k) TEST_ASSERT_EQUAL_INT(k, found[k].idx1);
}

static void test_capacity_is_told_and_the_least_of_both_is_enough(void) {
  int32_t count = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, match_rows(a.context, descriptors0, COUNT, descriptors1,
                                                    20, NULL, found, 19, &count));
  TEST_ASSERT_EQUAL_INT(20, count);
  TEST_ASSERT_TRUE(api_is_pattern(found, sizeof found));
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows(a.context, descriptors0, COUNT, descriptors1, 20, NULL, found, 20, &count));
  TEST_ASSERT_TRUE(api_is_pattern(found + 20, sizeof found - 20 * sizeof found[0]));
}

static void test_two_contexts_give_the_same_bytes(void) {
  const tv_limits limits = small_limits();
  api_context b = api_make(&limits);
  tv_correspondence other[COUNT];
  int32_t count = 0, other_count = 0;
  memset(other, API_PATTERN, sizeof other);
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(b.context, descriptors1, 30, descriptors0, COUNT, NULL,
                                          other, COUNT, &other_count));
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(a.context, descriptors0, COUNT, descriptors1, COUNT, NULL,
                                          found, COUNT, &count));
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(b.context, descriptors0, COUNT, descriptors1, COUNT, NULL,
                                          other, COUNT, &other_count));
  TEST_ASSERT_EQUAL_INT(count, other_count);
  TEST_ASSERT_EQUAL_MEMORY(found, other, sizeof found);
  api_release(&b);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_counts_out_of_range_are_refused);
  RUN_TEST(test_options_out_of_range_are_refused);
  RUN_TEST(test_a_neighbourhood_requires_finite_keypoints);
  RUN_TEST(test_without_any_keypoints_there_is_no_neighbourhood);
  RUN_TEST(test_old_options_have_no_neighbourhood);
  RUN_TEST(test_a_full_context_matches_in_its_memory);
  RUN_TEST(test_capacity_is_told_and_the_least_of_both_is_enough);
  RUN_TEST(test_two_contexts_give_the_same_bytes);
  return UNITY_END();
}
