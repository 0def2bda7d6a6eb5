/* Mutual nearest neighbours with a ratio test in both directions, compared with a direct
   implementation of match.h's definition that sorts all distances. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { MANY = 2200, MAX_DESCRIPTORS = 120, SIZE = TV_DESCRIPTOR_BYTES };

static uint8_t descriptors0[MANY * SIZE], descriptors1[MANY * SIZE];
static tv_correspondence found[MANY], swapped[MANY], expected[MANY];
static api_context contexts[8];
static int num_contexts;

void setUp(void) {}
void tearDown(void) {}

/* A context of each kernel set that this machine has. */
static void make_contexts(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 16;
  limits.max_keypoints = MANY;
  num_contexts = api_make_all_kernels(limits, contexts);
}

static int64_t distance_sq(const uint8_t *a, const uint8_t *b) {
  int64_t sum = 0;
  int k;
  for (k = 0; k < SIZE; ++k) sum += (int64_t)(a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

/* The nearest row, of equal ones that with the lowest index, and the ratio to the second
   nearest; the ratio is 1 without a second row. */
static int nearest(const uint8_t *query, const uint8_t *rows, int num_rows, int64_t *best,
                   double *ratio) {
  int64_t second = -1;
  int idx = -1, j;
  for (j = 0; j < num_rows; ++j) {
    const int64_t d = distance_sq(query, rows + j * SIZE);
    if (idx < 0 || d < *best) {
      *best = d;
      idx = j;
    }
  }
  for (j = 0; j < num_rows; ++j) {
    const int64_t d = distance_sq(query, rows + j * SIZE);
    if (j != idx && (second < 0 || d < second)) second = d;
  }
  *ratio = second > 0 ? sqrt((double)*best / (double)second) : 1.0;
  return idx;
}

static int match_by_definition(int num0, int num1, float ratio) {
  int count = 0, i;
  for (i = 0; i < num0; ++i) {
    int64_t best, back_best;
    double forward, back;
    const int j = nearest(descriptors0 + i * SIZE, descriptors1, num1, &best, &forward);
    if (j < 0) continue;
    if (nearest(descriptors1 + j * SIZE, descriptors0, num0, &back_best, &back) != i) continue;
    if (back > forward) forward = back;
    if ((float)forward >= ratio) continue;
    expected[count].idx0 = i;
    expected[count].idx1 = j;
    expected[count].dist_sq = (uint32_t)best;
    expected[count].ratio = (float)forward;
    ++count;
  }
  return count;
}

static int32_t run(const api_context *a, const uint8_t *rows0, int32_t num0, const uint8_t *rows1,
                   int32_t num1, float ratio, tv_correspondence *out) {
  tv_match_options options;
  int32_t count = -1;
  tv_match_options_init(&options);
  options.ratio = ratio;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows(a->context, rows0, num0, rows1, num1, &options, out, MANY, &count));
  return count;
}

static void check(int32_t num0, int32_t num1, float ratio) {
  const int32_t count = match_by_definition(num0, num1, ratio);
  int k, c, other;
  for (c = 0; c < num_contexts; ++c) {
    TEST_ASSERT_EQUAL_INT(count,
                          run(&contexts[c], descriptors0, num0, descriptors1, num1, ratio, found));
    if (count > 0) TEST_ASSERT_EQUAL_MEMORY(expected, found, (size_t)count * sizeof found[0]);
    TEST_ASSERT_EQUAL_INT(
        count, run(&contexts[c], descriptors1, num1, descriptors0, num0, ratio, swapped));
    for (k = 0; k < count; ++k) {
      for (other = 0; swapped[other].idx1 != found[k].idx0; ++other) {
        TEST_ASSERT_TRUE(other + 1 < count);
      }
      TEST_ASSERT_EQUAL_INT(found[k].idx1, swapped[other].idx0);
      TEST_ASSERT_EQUAL_UINT32(found[k].dist_sq, swapped[other].dist_sq);
      TEST_ASSERT_EQUAL_MEMORY(&found[k].ratio, &swapped[other].ratio, sizeof(float));
      TEST_ASSERT_TRUE(k == 0 || swapped[k - 1].idx0 < swapped[k].idx0);
    }
  }
}

static void fill(uint64_t *state, int kind) {
  int k;
  random_bytes(state, descriptors0, sizeof descriptors0);
  random_bytes(state, descriptors1, sizeof descriptors1);
  for (k = 0; k < (int)sizeof descriptors0; ++k) {
    if (kind == 1) { /* only 0 and 1, so that many distances are equal */
      descriptors0[k] = (uint8_t)(k % SIZE < 4 ? descriptors0[k] & 1 : 0);
      descriptors1[k] = (uint8_t)(k % SIZE < 4 ? descriptors1[k] & 1 : 0);
    } else if (kind == 2) { /* 4 of 5 descriptors of image 1 are noisy ones of image 0 */
      const int noise = random_int(state, -9, 9) + descriptors0[k];
      if (k / SIZE % 5 != 0) {
        descriptors1[k] = (uint8_t)(noise < 0 ? 0 : noise > 255 ? 255 : noise);
      }
    } else if (kind == 3) { /* only 0 and 255 */
      descriptors0[k] = descriptors0[k] < 128 ? 0 : 255;
      descriptors1[k] = descriptors1[k] < 200 ? 0 : 255;
    }
  }
}

static void test_matches_equal_the_definition_and_swap_with_the_images(void) {
  static const float ratios[4] = {0.5f, 0.8f, 0.97f, 1.0f};
  uint64_t state = 11;
  int kind, size, r;
  for (kind = 0; kind < 4; ++kind) {
    for (size = 0; size < 9; ++size) {
      const int32_t num0 = random_int(&state, 0, size < 5 ? 4 : MAX_DESCRIPTORS);
      const int32_t num1 = random_int(&state, 0, size < 5 ? 4 : MAX_DESCRIPTORS);
      fill(&state, kind);
      for (r = 0; r < 4; ++r) check(num0, num1, ratios[r]);
    }
  }
}

/* First more rows, then more columns, than any kernel set handles at a time. */
static void test_many_descriptors_match_by_the_definition(void) {
  uint64_t state = 15;
  int kind;
  for (kind = 0; kind < 4; ++kind) {
    fill(&state, kind);
    check(MANY - 7, 43, 1.0f);
    check(43, MANY - 7, 1.0f);
  }
}

static void test_noisy_copies_are_found(void) {
  uint64_t state = 12;
  int32_t count, k;
  fill(&state, 2);
  count =
      run(&contexts[0], descriptors0, MAX_DESCRIPTORS, descriptors1, MAX_DESCRIPTORS, 0.8f, found);
  TEST_ASSERT_EQUAL_INT(MAX_DESCRIPTORS * 4 / 5, count);
  for (k = 0; k < count; ++k) TEST_ASSERT_EQUAL_INT(found[k].idx0, found[k].idx1);
}

static void test_an_empty_side_gives_no_matches(void) {
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], descriptors0, 5, descriptors1, 0, 1.0f, found));
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], NULL, 0, descriptors1, 5, 1.0f, found));
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], NULL, 0, NULL, 0, 1.0f, found));
}

static void test_one_descriptor_never_passes_the_ratio_test(void) {
  memset(descriptors0, 7, sizeof descriptors0);
  memset(descriptors1, 7, sizeof descriptors1);
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], descriptors0, 1, descriptors1, 1, 1.0f, found));
  descriptors1[SIZE] = 200;
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], descriptors0, 1, descriptors1, 2, 1.0f, found));
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], descriptors1, 2, descriptors0, 1, 1.0f, found));
}

static void test_equal_distances_are_rejected(void) {
  uint64_t state = 13;
  fill(&state, 0);
  memcpy(descriptors1, descriptors0, sizeof descriptors0);
  /* Descriptors 0 and 1 of image 1 are equally distant from descriptor 0 of image 0. */
  memcpy(descriptors1 + SIZE, descriptors1, SIZE);
  TEST_ASSERT_EQUAL_INT(8, run(&contexts[0], descriptors0, 10, descriptors1, 10, 1.0f, found));
  TEST_ASSERT_EQUAL_INT(2, found[0].idx0);
}

/* Query 0 is much nearer to row 0 than to row 1, but row 0 has query 1 almost as near. */
static void test_the_ratio_test_works_in_both_directions(void) {
  memset(descriptors0, 0, sizeof descriptors0);
  memset(descriptors1, 0, sizeof descriptors1);
  descriptors0[0] = 10;
  descriptors0[SIZE + 1] = 11;
  memset(descriptors1 + SIZE, 255, SIZE);
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], descriptors0, 2, descriptors1, 2, 0.8f, found));
  TEST_ASSERT_EQUAL_INT(0, run(&contexts[0], descriptors1, 2, descriptors0, 2, 0.8f, found));
  TEST_ASSERT_EQUAL_INT(1, run(&contexts[0], descriptors0, 2, descriptors1, 2, 0.95f, found));
  TEST_ASSERT_EQUAL_UINT32(100, found[0].dist_sq);
  TEST_ASSERT_EQUAL_FLOAT((float)sqrt(100.0 / 121.0), found[0].ratio);
}

static void test_a_small_array_gets_the_count_and_nothing_else(void) {
  uint64_t state = 14;
  tv_correspondence few[4], untouched[4];
  int32_t count = -1;
  fill(&state, 2);
  memset(few, 0x5A, sizeof few);
  memset(untouched, 0x5A, sizeof untouched);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, match_rows(contexts[0].context, descriptors0, 100,
                                                    descriptors1, 100, NULL, few, 4, &count));
  TEST_ASSERT_EQUAL_INT(80, count);
  TEST_ASSERT_EQUAL_MEMORY(untouched, few, sizeof few);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, match_rows(contexts[0].context, descriptors0, 100,
                                                    descriptors1, 100, NULL, NULL, 0, &count));
}

int main(void) {
  int failures;
  UNITY_BEGIN();
  make_contexts();
  RUN_TEST(test_matches_equal_the_definition_and_swap_with_the_images);
  RUN_TEST(test_many_descriptors_match_by_the_definition);
  RUN_TEST(test_noisy_copies_are_found);
  RUN_TEST(test_an_empty_side_gives_no_matches);
  RUN_TEST(test_one_descriptor_never_passes_the_ratio_test);
  RUN_TEST(test_equal_distances_are_rejected);
  RUN_TEST(test_the_ratio_test_works_in_both_directions);
  RUN_TEST(test_a_small_array_gets_the_count_and_nothing_else);
  failures = UNITY_END();
  while (num_contexts > 0) api_release(&contexts[--num_contexts]);
  return failures;
}
