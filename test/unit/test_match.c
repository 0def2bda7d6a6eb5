/* Mutual nearest neighbours with a ratio test in both directions, compared with a direct
   implementation of match.h's definition that compares all distances. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { MANY = 2200, MAX_DESCRIPTORS = 120, SIZE = TV_DESCRIPTOR_BYTES };

static uint8_t descriptors0[MANY * SIZE], descriptors1[MANY * SIZE];
static tv_keypoint keypoints0[MANY], keypoints1[MANY];
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

static tv_match_options plain(float ratio) {
  tv_match_options options;
  tv_match_options_init(&options);
  options.ratio = ratio;
  options.neighbourhood_px = 0;
  options.max_distance = 0;
  return options;
}

/* Whether row j is so far from row `best` that it counts as the second nearest one. */
static int is_far(const tv_keypoint *keypoints, int best, int j, double radius) {
  const double dx = (double)keypoints[j].x - keypoints[best].x;
  const double dy = (double)keypoints[j].y - keypoints[best].y;
  return radius > 0 ? dx * dx + dy * dy >= radius * radius : j != best;
}

/* The nearest row, of equal ones that with the lowest index, and the ratio to the second
   nearest; the ratio is 1 where there is none. */
static int nearest(const uint8_t *query, const uint8_t *rows, const tv_keypoint *keypoints,
                   int num_rows, const tv_match_options *options, int64_t *best, double *ratio) {
  const double largest = (double)options->max_distance * options->max_distance;
  static int64_t distances[MANY];
  double second = largest > 0 ? largest : -1;
  int idx = -1, j;
  for (j = 0; j < num_rows; ++j) {
    const int64_t d = distance_sq(query, rows + j * SIZE);
    distances[j] = d;
    if (idx < 0 || d < *best) {
      *best = d;
      idx = j;
    }
  }
  for (j = 0; j < num_rows; ++j) {
    const double d = (double)distances[j];
    if (!is_far(keypoints, idx, j, options->neighbourhood_px)) continue;
    if (second < 0 || d < second) second = d;
  }
  *ratio = second > 0 ? sqrt((double)*best / second) : 1.0;
  return idx;
}

static int match_by_definition(int num0, int num1, const tv_match_options *options) {
  int count = 0, i;
  for (i = 0; i < num0; ++i) {
    int64_t best, back_best;
    double forward, back;
    const int j =
        nearest(descriptors0 + i * SIZE, descriptors1, keypoints1, num1, options, &best, &forward);
    if (j < 0) continue;
    if (nearest(descriptors1 + j * SIZE, descriptors0, keypoints0, num0, options, &back_best,
                &back) != i) {
      continue;
    }
    if (back > forward) forward = back;
    if ((float)forward >= options->ratio) continue;
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
  const tv_match_options options = plain(ratio);
  int32_t count = -1;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows(a->context, rows0, num0, rows1, num1, &options, out, MANY, &count));
  return count;
}

static int32_t run_options(const api_context *a, int32_t num0, int32_t num1, int swap,
                           const tv_match_options *options, tv_correspondence *out) {
  const tv_features features[2] = {features_of(keypoints0, descriptors0, num0),
                                   features_of(keypoints1, descriptors1, num1)};
  int32_t count = -1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_match(a->context, &features[swap], &features[1 - swap], options,
                                        out, MANY, &count));
  return count;
}

static int32_t check_options(int32_t num0, int32_t num1, const tv_match_options *options) {
  const int32_t count = match_by_definition(num0, num1, options);
  int k, c, other;
  for (c = 0; c < num_contexts; ++c) {
    TEST_ASSERT_EQUAL_INT(count, run_options(&contexts[c], num0, num1, 0, options, found));
    if (count > 0) TEST_ASSERT_EQUAL_MEMORY(expected, found, (size_t)count * sizeof found[0]);
    TEST_ASSERT_EQUAL_INT(count, run_options(&contexts[c], num0, num1, 1, options, swapped));
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
  return count;
}

static void check(int32_t num0, int32_t num1, float ratio) {
  const tv_match_options options = plain(ratio);
  check_options(num0, num1, &options);
}

/* Keypoints on a lattice of 5 px or anywhere in a square: distances of 5, 10 and 15 px are exact,
   and several keypoints are at one place. */
static void scatter(uint64_t *state, tv_keypoint *keypoints, int32_t side_px, int on_lattice) {
  int k;
  for (k = 0; k < MANY; ++k) {
    keypoints[k] = keypoints[0];
    keypoints[k].x = (float)(random_unit(state) * side_px - 7);
    keypoints[k].y = (float)(random_unit(state) * side_px + 3);
    if (on_lattice) {
      keypoints[k].x = (float)(5 * random_int(state, 0, side_px / 5));
      keypoints[k].y = (float)(5 * random_int(state, 0, side_px / 5));
    }
    keypoints[k].size = 4;
    keypoints[k].angle_rad = 0;
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

static void test_the_second_neighbour_is_outside_the_neighbourhood(void) {
  static const float radii[5] = {0.01f, 5, 10, 25, 1000};
  static const int32_t sides_px[3] = {1, 40, 300};
  uint64_t state = 16;
  int32_t total = 0;
  int kind, size, r;
  for (kind = 0; kind < 4; ++kind) {
    for (size = 0; size < 12; ++size) {
      const int32_t num0 = random_int(&state, 0, size < 4 ? 5 : MAX_DESCRIPTORS);
      const int32_t num1 = random_int(&state, 0, size < 4 ? 5 : MAX_DESCRIPTORS);
      fill(&state, kind);
      scatter(&state, keypoints0, sides_px[size % 3], size % 2);
      scatter(&state, keypoints1, sides_px[size % 3], size % 2);
      for (r = 0; r < 5; ++r) {
        tv_match_options options = plain(random_int(&state, 0, 1) ? 1.0f : 0.9f);
        options.neighbourhood_px = radii[r];
        if (random_int(&state, 0, 3) == 0) {
          options.max_distance = (float)random_int(&state, 1, kind == 1 ? 3 : 3000);
        }
        total += check_options(num0, num1, &options);
      }
    }
  }
  TEST_ASSERT_TRUE(total > 1000);
}

/* Each descriptor of image 1 is a noisy copy of one of image 0, and both have copies of their own
   in the neighbourhood, as second orientations and further levels are: up to 40 of a corner. The
   lists of the kernels do not reach beyond these. */
static void test_crowded_neighbourhoods_match_by_the_definition(void) {
  enum { NUM = 700 };
  uint64_t state = 17;
  int32_t corner, k, b, with, without;
  tv_match_options options = plain(0.9f);
  fill(&state, 0);
  scatter(&state, keypoints0, 500, 0);
  for (k = 0; k < NUM; ++k) {
    corner = k < 300 ? k : k < 600 ? random_int(&state, 0, 299) : random_int(&state, 0, 4);
    for (b = 0; b < SIZE; ++b) {
      const int value = descriptors0[corner * SIZE + b] / 2 + 60;
      descriptors1[k * SIZE + b] = (uint8_t)(value + random_int(&state, -3, 3));
      if (k >= 300) descriptors0[k * SIZE + b] = descriptors0[corner * SIZE + b];
      if (k >= 300 && b < 4) descriptors0[k * SIZE + b] ^= 1;
    }
    if (k >= 300) keypoints0[k] = keypoints0[corner];
    keypoints0[k].x += (float)random_unit(&state);
    keypoints1[k] = keypoints0[k];
    keypoints1[k].y += (float)random_unit(&state);
  }
  for (k = 0; k < NUM * SIZE; ++k) descriptors0[k] = (uint8_t)(descriptors0[k] / 2 + 60);
  without = check_options(NUM, NUM, &options);
  options.neighbourhood_px = 3;
  with = check_options(NUM, NUM, &options);
  TEST_ASSERT_TRUE(with > 290 && without < 150);
}

/* All descriptors equal, or all keypoints at one place: nothing is matched, or by the index. */
static void test_equal_descriptors_in_one_place_compete_by_their_index(void) {
  enum { NUM = 300 };
  tv_match_options options = plain(1.0f);
  uint64_t state = 18;
  int k;
  memset(descriptors0, 7, sizeof descriptors0);
  memset(descriptors1, 7, sizeof descriptors1);
  scatter(&state, keypoints0, 300, 0);
  scatter(&state, keypoints1, 300, 0);
  options.neighbourhood_px = 10;
  TEST_ASSERT_EQUAL_INT(0, check_options(NUM, NUM, &options));
  for (k = 0; k < NUM; ++k) keypoints0[k] = keypoints1[k] = keypoints0[0];
  TEST_ASSERT_EQUAL_INT(0, check_options(NUM, NUM, &options));
  options.max_distance = 100; /* takes the place of the second neighbour, which does not exist */
  TEST_ASSERT_EQUAL_INT(1, check_options(NUM, NUM, &options));
  options.max_distance = 0;
  memset(descriptors0 + 250 * SIZE, 9, SIZE); /* an unlike keypoint far away, in each image */
  memset(descriptors1 + 120 * SIZE, 9, SIZE);
  keypoints0[250].x += 10;
  TEST_ASSERT_EQUAL_INT(0, check_options(NUM, NUM, &options));
  keypoints1[120].y -= 10;
  TEST_ASSERT_EQUAL_INT(2, check_options(NUM, NUM, &options));
  TEST_ASSERT_EQUAL_INT(0, found[0].idx0);
  TEST_ASSERT_EQUAL_INT(0, found[0].idx1);
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
  RUN_TEST(test_the_second_neighbour_is_outside_the_neighbourhood);
  RUN_TEST(test_crowded_neighbourhoods_match_by_the_definition);
  RUN_TEST(test_equal_descriptors_in_one_place_compete_by_their_index);
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
