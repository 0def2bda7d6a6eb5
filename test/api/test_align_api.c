/* Tests of tv_align_matches: every status of match.h, outputs that stay untouched on errors, and
   the same positions as in tv_reconstruct and with exchanged images. The alignment itself is
   checked in test/unit/test_align.cc, and what tv_reconstruct does with it in
   test_reconstruct_api.c. */

#include <math.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { WIDTH = 160, HEIGHT = 120, STRIDE = WIDTH + 8, MOST = 400 };

static uint8_t pixels[2][HEIGHT * STRIDE];
static tv_keypoint found[2][MOST], moved[2][MOST];
static uint8_t descriptors[2][MOST * TV_DESCRIPTOR_BYTES];
static tv_correspondence matches[MOST];
static uint8_t aligned[MOST];
static int32_t num[2], num_matches;
static tv_image images[2];
static api_context a;

/* Blurred noise, and the same three tenths of a pixel to the right and four down. */
static void render(void) {
  uint64_t state = 17;
  int v, x, y, k;
  static double noise[HEIGHT + 8][WIDTH + 8], rows[HEIGHT + 8][WIDTH + 8];
  for (y = 0; y < HEIGHT + 8; ++y) {
    for (x = 0; x < WIDTH + 8; ++x) noise[y][x] = random_unit(&state);
  }
  for (v = 0; v < 2; ++v) {
    const double shift[2] = {v == 0 ? 0 : 0.3, v == 0 ? 0 : 0.4};
    double weights[2][9];
    for (k = 0; k < 9; ++k) {
      weights[0][k] = exp(-0.5 * pow((k - 4 + shift[0]) / 1.5, 2));
      weights[1][k] = exp(-0.5 * pow((k - 4 + shift[1]) / 1.5, 2));
    }
    for (y = 0; y < HEIGHT + 8; ++y) {
      for (x = 0; x < WIDTH; ++x) {
        rows[y][x] = 0;
        for (k = 0; k < 9; ++k) rows[y][x] += weights[0][k] * noise[y][x + k];
      }
    }
    for (y = 0; y < HEIGHT; ++y) {
      for (x = 0; x < WIDTH; ++x) {
        double sum = 0;
        for (k = 0; k < 9; ++k) sum += weights[1][k] * rows[y + k][x];
        sum = 128 + 60 * (sum / 14.1 - 0.5) * 9;
        pixels[v][y * STRIDE + x] = (uint8_t)fmin(fmax(sum, 0), 255);
      }
    }
    images[v] = api_image(pixels[v], WIDTH, HEIGHT, STRIDE);
  }
}

static api_context make_context(uint32_t purposes) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = WIDTH;
  limits.max_height = HEIGHT;
  limits.max_keypoints = MOST;
  limits.purposes = purposes;
  return api_make(&limits);
}

void setUp(void) {
  tv_features features[2];
  int v;
  a = make_context(0);
  render();
  for (v = 0; v < 2; ++v) {
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_extract(a.context, &images[v], NULL, NULL, found[v],
                                            descriptors[v], MOST, &num[v]));
    features[v] = features_of(found[v], descriptors[v], num[v]);
    memcpy(moved[v], found[v], sizeof found[v]);
  }
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_match(a.context, &features[0], &features[1], NULL, matches, MOST, &num_matches));
  TEST_ASSERT_GREATER_THAN_INT(30, num_matches);
  memset(aligned, API_PATTERN, sizeof aligned);
}

void tearDown(void) { api_release(&a); }

static tv_status align(void) {
  return align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4, moved[0],
                            num[0], moved[1], num[1], aligned);
}

static void untouched(void) { TEST_ASSERT_TRUE(api_is_pattern(aligned, sizeof aligned)); }

static void test_matches_of_a_shifted_image_come_nearer_to_the_shift(void) {
  double before = 0, after = 0;
  int k, v, count = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, align());
  for (k = 0; k < num_matches; ++k) {
    const int32_t i[2] = {matches[k].idx0, matches[k].idx1};
    int changed = 0;
    for (v = 0; v < 2; ++v) {
      changed += moved[v][i[v]].x != found[v][i[v]].x || moved[v][i[v]].y != found[v][i[v]].y;
    }
    TEST_ASSERT_EQUAL_INT(aligned[k] != 0, changed);
    if (aligned[k] == 0) continue;
    ++count;
    before +=
        hypot(found[1][i[1]].x - found[0][i[0]].x - 0.3, found[1][i[1]].y - found[0][i[0]].y - 0.4);
    after +=
        hypot(moved[1][i[1]].x - moved[0][i[0]].x - 0.3, moved[1][i[1]].y - moved[0][i[0]].y - 0.4);
  }
  TEST_ASSERT_TRUE(api_is_pattern(aligned + num_matches, (size_t)(MOST - num_matches)));
  TEST_ASSERT_GREATER_THAN_INT(num_matches / 2, count);
  printf("%d of %d aligned: mean error %.3f px, before %.3f\n", count, num_matches, after / count,
         before / count);
  TEST_ASSERT_TRUE(after < 0.5 * before);
}

static void test_tv_reconstruct_moves_the_keypoints_alike(void) {
  tv_view views[2];
  tv_two_view two_view;
  tv_reconstruction reconstruction;
  int v;
  views[0] = view_of(images[0], NULL, NULL);
  views[1] = view_of(images[1], NULL, NULL);
  tv_two_view_init(&two_view);
  tv_reconstruction_init(&reconstruction);
  TEST_ASSERT_EQUAL_INT(TV_OK, align());
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(a.context, &views[0], &views[1], NULL, &two_view,
                                              NULL, &reconstruction));
  TEST_ASSERT_EQUAL_INT(num_matches, reconstruction.num_matches);
  for (v = 0; v < 2; ++v) {
    TEST_ASSERT_EQUAL_INT(num[v], reconstruction.num_keypoints[v]);
    TEST_ASSERT_EQUAL_MEMORY(moved[v], reconstruction.keypoints[v],
                             (size_t)num[v] * sizeof moved[v][0]);
  }
}

static void test_exchanged_images_give_the_same_positions(void) {
  static tv_keypoint again[2][MOST];
  static uint8_t mask[MOST];
  int k;
  memcpy(again, found, sizeof again);
  TEST_ASSERT_EQUAL_INT(TV_OK, align());
  for (k = 0; k < num_matches; ++k) {
    const int32_t idx0 = matches[k].idx0;
    matches[k].idx0 = matches[k].idx1;
    matches[k].idx1 = idx0;
  }
  TEST_ASSERT_EQUAL_INT(
      TV_OK, align_keypoints_of(a.context, images[1], images[0], matches, num_matches, 4, again[1],
                                num[1], again[0], num[0], mask));
  TEST_ASSERT_EQUAL_MEMORY(moved, again, sizeof again);
  TEST_ASSERT_EQUAL_MEMORY(aligned, mask, (size_t)num_matches);
}

static void test_wrong_arguments_are_refused_and_nothing_is_written(void) {
  const float bad_sizes[] = {0, -1, 4097, (float)NAN, (float)INFINITY};
  const int32_t index = matches[5].idx1;
  tv_keypoint *const both[2] = {moved[0], moved[1]};
  tv_image image = images[1];
  size_t k;

  TEST_ASSERT_EQUAL_INT(
      TV_ERR_NULL, align_keypoints_of(NULL, images[0], images[1], matches, num_matches, 4, moved[0],
                                      num[0], moved[1], num[1], aligned));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_NULL, tv_align_matches(a.context, NULL, matches, num_matches, 4, both, num, aligned));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_align_matches(a.context, images, matches, num_matches, 4,
                                                      NULL, num, aligned));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_align_matches(a.context, images, matches, num_matches, 4,
                                                      both, NULL, aligned));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4,
                                           NULL, num[0], moved[1], num[1], aligned));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4,
                                           moved[0], num[0], NULL, num[1], aligned));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        align_keypoints_of(a.context, images[0], images[1], NULL, num_matches, 4,
                                           moved[0], num[0], moved[1], num[1], aligned));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4,
                                           moved[0], num[0], moved[1], num[1], NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4,
                                           moved[0], -1, moved[1], num[1], aligned));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_ARGUMENT, align_keypoints_of(a.context, images[0], images[1], matches, -1, 4, moved[0],
                                          num[0], moved[1], num[1], aligned));
  for (k = 0; k < sizeof bad_sizes / sizeof bad_sizes[0]; ++k) {
    TEST_ASSERT_EQUAL_INT(
        isfinite(bad_sizes[k]) ? TV_ERR_ARGUMENT : TV_ERR_NOT_FINITE,
        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, bad_sizes[k],
                           moved[0], num[0], moved[1], num[1], aligned));
  }
  image.width = WIDTH + 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS,
                        align_keypoints_of(a.context, images[0], image, matches, num_matches, 4,
                                           moved[0], num[0], moved[1], num[1], aligned));
  matches[5].idx1 = num[1];
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, align());
  matches[5].idx1 = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, align());
  matches[5].idx1 = index;
  moved[1][3].y = (float)NAN;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, align());
  moved[1][3].y = found[1][3].y;
  moved[0][2].size = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, align());
  moved[0][2].size = found[0][2].size;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        align_keypoints_of(a.context, images[0], images[1], matches, 0, 4, moved[0],
                                           num[0], moved[0] + 1, num[0] - 1, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4,
                                           moved[0], num[0], moved[1], num[1], (uint8_t *)matches));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        align_keypoints_of(a.context, images[0], images[1], matches, num_matches, 4,
                                           moved[0], num[0], moved[1], num[1], pixels[1] + 7));
  untouched();
  TEST_ASSERT_EQUAL_MEMORY(found, moved, sizeof found);
  TEST_ASSERT_EQUAL_INT(TV_OK, align_keypoints_of(a.context, images[0], images[1], NULL, 0, 4, NULL,
                                                  0, NULL, 0, NULL));
}

static void test_a_context_that_is_made_for_other_calls_is_refused(void) {
  api_context other = make_context(TV_PURPOSE_MATCH);
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_LIMITS, align_keypoints_of(other.context, images[0], images[1], matches, num_matches,
                                        4, moved[0], num[0], moved[1], num[1], aligned));
  untouched();
  api_release(&other);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_matches_of_a_shifted_image_come_nearer_to_the_shift);
  RUN_TEST(test_tv_reconstruct_moves_the_keypoints_alike);
  RUN_TEST(test_exchanged_images_give_the_same_positions);
  RUN_TEST(test_wrong_arguments_are_refused_and_nothing_is_written);
  RUN_TEST(test_a_context_that_is_made_for_other_calls_is_refused);
  return UNITY_END();
}
