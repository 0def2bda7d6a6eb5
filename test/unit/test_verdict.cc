// Each rule of robust/verdict just below and just above its threshold, with evidence that the test
// sets itself.
#include <unity.h>

#include <utility>

#include "robust/verdict.h"

namespace {

using tv::Evidence;
using tv::judge;

Evidence good() {
  Evidence e;
  e.kind = TV_KIND_CALIBRATED;
  e.threshold_px = 1;
  e.num_matches = 120;
  e.num_different = 100;
  e.num_inliers = 80;
  e.num_different_inliers = 70;
  e.coverage[0] = e.coverage[1] = 0.5;
  e.num_places[0] = e.num_places[1] = 40;
  e.noise_px = 0.3;
  e.sigma_rad = 0.005;
  e.median_parallax_rad = 0.05;
  e.pixel_angle_rad = 0.002;
  e.line_distance_px[0] = e.line_distance_px[1] = 50;
  return e;
}

// The evidence must give exactly these reasons, also with swapped views; any reason makes the pair
// doubtful.
void assert_reason(uint32_t reasons, Evidence e) {
  const tv::Judgement judgement = judge(e);
  TEST_ASSERT_EQUAL_HEX32(reasons, judgement.reasons);
  TEST_ASSERT_EQUAL_INT(reasons == 0 ? TV_VERDICT_OK : TV_VERDICT_DOUBTFUL, judgement.verdict);
  for (double* values : {e.coverage, e.lattice_share, e.lattice_sigmas, e.line_distance_px}) {
    std::swap(values[0], values[1]);
  }
  std::swap(e.num_places[0], e.num_places[1]);
  TEST_ASSERT_EQUAL_HEX32(reasons, judge(e).reasons);
}

void test_each_reason_has_its_threshold(void) {
  assert_reason(0, good());
  Evidence e = good();
  e.num_different_inliers = 15;
  assert_reason(0, e);
  e.num_different_inliers = 14;
  assert_reason(TV_REASON_TOO_FEW_MATCHES, e);
  // The inliers are in enough places of both images.
  e = good();
  e.num_places[1] = 20;
  assert_reason(0, e);
  e.num_places[1] = 19;
  assert_reason(TV_REASON_TOO_FEW_MATCHES, e);
  e = good();
  e.num_inliers = 30;
  assert_reason(0, e);
  e.num_inliers = 29;
  assert_reason(TV_REASON_LOW_INLIER_RATIO, e);
  e = good();
  e.noise_px = 0.71;
  assert_reason(TV_REASON_LOW_INLIER_RATIO, e);
  // Low parallax is below 3 px (10 times the noise of 0.3 px), and a pixel is 0.002 rad.
  for (const double parallax : {0.0061, 0.0059}) {
    e = good();
    e.median_parallax_rad = parallax;
    assert_reason(parallax < 0.006 ? TV_REASON_LOW_PARALLAX : 0, e);
  }
  e = good();
  e.sigma_rad = 0.022;  // 1.26 degrees, while the limit is 1.25 degrees
  assert_reason(TV_REASON_LOW_PARALLAX, e);
  e.sigma_rad = tv::kUnknown;
  assert_reason(TV_REASON_LOW_PARALLAX, e);
  e = good();
  e.has_alternative = true;
  assert_reason(TV_REASON_TWO_PLANAR_SOLUTIONS, e);
}

void test_inliers_are_crowded_where_they_are_in_both_images_or_on_a_line_in_one(void) {
  Evidence e = good();
  e.coverage[0] = 4 / 64.0;
  assert_reason(0, e);
  e.coverage[1] = 5 / 64.0;
  assert_reason(0, e);
  e.coverage[1] = 4 / 64.0;
  assert_reason(TV_REASON_CROWDED_MATCHES, e);
  e = good();
  e.line_distance_px[1] = 3.01;
  assert_reason(0, e);
  e.line_distance_px[1] = 2.99;
  assert_reason(TV_REASON_CROWDED_MATCHES, e);
}

void test_a_second_model_is_a_motion_or_a_lattice(void) {
  Evidence e = good();
  e.lattice_sigmas[0] = 3;
  e.lattice_sigmas[1] = 4;
  e.lattice_share[0] = 0.3;
  e.lattice_share[1] = 0.6;
  assert_reason(0, e);
  e.has_second_model = true;
  assert_reason(TV_REASON_REPEATED_STRUCTURE, e);
  e.lattice_sigmas[0] = 2.5;
  assert_reason(TV_REASON_SECOND_MOTION, e);
  e = good();
  e.lattice_sigmas[0] = e.lattice_sigmas[1] = 3.4;
  e.lattice_share[0] = 0.45;
  e.lattice_share[1] = 0.6;
  assert_reason(TV_REASON_REPEATED_STRUCTURE, e);
}

void test_without_a_translation_the_pair_is_refused(void) {
  Evidence e = good();
  e.kind = TV_KIND_PANORAMIC;
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, judge(e).verdict);
  TEST_ASSERT_EQUAL_HEX32(TV_REASON_PURE_ROTATION, judge(e).reasons);
  e.kind = TV_KIND_NO_MOTION;
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, judge(e).verdict);
  TEST_ASSERT_EQUAL_HEX32(TV_REASON_NO_MOTION, judge(e).reasons);
  e = Evidence{};
  e.num_matches = e.num_different = 15;
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, judge(e).verdict);
  TEST_ASSERT_EQUAL_HEX32(TV_REASON_LOW_INLIER_RATIO, judge(e).reasons);
  e.num_different = 14;
  TEST_ASSERT_EQUAL_HEX32(TV_REASON_TOO_FEW_MATCHES, judge(e).reasons);
}

// An uncalibrated pair has neither parallax nor lines nor a second model.
void test_an_uncalibrated_pair_is_judged_by_its_inliers_alone(void) {
  Evidence e;
  e.kind = TV_KIND_UNCALIBRATED;
  e.threshold_px = 1;
  e.num_matches = e.num_inliers = e.num_different = e.num_different_inliers = 50;
  e.coverage[0] = e.coverage[1] = 0.5;
  assert_reason(0, e);
}

void test_after_guided_matching_the_first_verdict_stays(void) {
  tv_two_view first{}, again{};
  first.has_R = first.has_t = again.has_R = again.has_t = 1;
  first.kind = again.kind = TV_KIND_CALIBRATED;
  first.num_inliers = again.num_inliers = 50;
  first.verdict = TV_VERDICT_DOUBTFUL;
  first.reasons = TV_REASON_CROWDED_MATCHES;
  again.verdict = TV_VERDICT_OK;
  TEST_ASSERT_TRUE(tv::takes_guided_estimate(first, &again));
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_DOUBTFUL, again.verdict);
  TEST_ASSERT_EQUAL_HEX32(TV_REASON_CROWDED_MATCHES, again.reasons);
  again.num_inliers = 49;
  TEST_ASSERT_FALSE(tv::takes_guided_estimate(first, &again));
  again.num_inliers = 50;
  again.kind = TV_KIND_PLANAR;
  TEST_ASSERT_FALSE(tv::takes_guided_estimate(first, &again));
  again.kind = TV_KIND_CALIBRATED;
  again.verdict = TV_VERDICT_REFUSED;
  TEST_ASSERT_FALSE(tv::takes_guided_estimate(first, &again));
}

}  // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_each_reason_has_its_threshold);
  RUN_TEST(test_inliers_are_crowded_where_they_are_in_both_images_or_on_a_line_in_one);
  RUN_TEST(test_a_second_model_is_a_motion_or_a_lattice);
  RUN_TEST(test_without_a_translation_the_pair_is_refused);
  RUN_TEST(test_an_uncalibrated_pair_is_judged_by_its_inliers_alone);
  RUN_TEST(test_after_guided_matching_the_first_verdict_stays);
  return UNITY_END();
}
