// Each rule of robust/verdict just below and just above its threshold, with evidence that the test
// sets itself.
#include <unity.h>

#include <cmath>
#include <utility>

#include "pipeline/pair_result.h"
#include "pipeline/reconstruct.h"
#include "robust/belief.h"
#include "robust/verdict.h"

namespace {

using tv::AbsoluteEvidence;
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
  e.agreement = 0.85;
  e.region_shift_rad = 0.002;
  e.sigma_rad = 0.005;
  e.direction_sigma_rad = 0.02;
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
  for (const double stated : {0.2355, 0.2357}) {  // the limit is 13.5 degrees, 0.23562
    e = good();
    e.direction_sigma_rad = stated;
    assert_reason(stated > 0.23562 ? TV_REASON_LOW_PARALLAX : 0, e);
  }
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

void test_a_camera_is_contradicted_where_the_direction_would_be_another_one(void) {
  Evidence e = good();
  e.misfit.direction_rad = 9.99 * tv::kPi / 180;
  assert_reason(0, e);
  e.misfit.direction_rad = 10.01 * tv::kPi / 180;
  assert_reason(TV_REASON_CAMERA_CONTRADICTED, e);
}

void test_a_camera_that_is_assumed_is_contradicted_by_any_misfit(void) {
  Evidence e = good();
  e.is_camera_assumed = true;
  assert_reason(0, e);
  e.misfit.direction_rad = 0.01 * tv::kPi / 180;
  assert_reason(TV_REASON_CAMERA_CONTRADICTED, e);
}

void test_a_focal_length_that_is_open_by_more_than_an_eighth_is_doubtful(void) {
  Evidence e = good();
  e.focal_sigma = 0.124;
  assert_reason(0, e);
  e.focal_sigma = 0.126;
  assert_reason(TV_REASON_LOW_PARALLAX, e);
  e.kind = TV_KIND_PLANAR;
  assert_reason(TV_REASON_LOW_PARALLAX, e);
}

void test_no_rung_mends_the_cameras(void) {
  tv::PairResult pose = {};
  pose.evidence.num_places[0] = 20;
  pose.evidence.num_places[1] = 40;
  pose.view.reasons = TV_REASON_SECOND_MOTION;
  TEST_ASSERT_TRUE(tv::more_could_help(pose));
  pose.evidence.misfit.direction_rad = 0.01;  // the matches contradict the cameras
  TEST_ASSERT_FALSE(tv::more_could_help(pose));
  pose.view.reasons |= TV_REASON_TOO_FEW_MATCHES;
  TEST_ASSERT_TRUE(tv::more_could_help(pose));
  pose.view.reasons = TV_REASON_LOW_PARALLAX | TV_REASON_CAMERA_CONTRADICTED;
  TEST_ASSERT_FALSE(tv::more_could_help(pose));
  pose.evidence.num_places[0] = 19;
  TEST_ASSERT_TRUE(tv::more_could_help(pose));
}

void test_a_rotation_that_hangs_on_one_region_is_doubtful(void) {
  Evidence e = good();
  e.region_shift_rad = 2.49 * tv::kPi / 180;
  assert_reason(0, e);
  e.region_shift_rad = 2.51 * tv::kPi / 180;
  TEST_ASSERT_TRUE(judge(e).probability_wrong <= tv::kMostProbabilityWrong);
  assert_reason(TV_REASON_CROWDED_MATCHES, e);
}

void test_a_second_model_is_a_motion_or_a_lattice_and_the_opposite_motion_a_repetition(void) {
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
  e = good();
  e.has_opposite_motion = true;
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

double probability_of(const Evidence& e) { return judge(e).probability_wrong; }

// Each step of the evidence, from very good to very bad, raises the probability or leaves it.
template <typename Change>
void assert_rises(const char* name, Change change) {
  double before = 0;
  for (int step = 0; step <= 100; ++step) {
    Evidence e = good();
    change(&e, 0.01 * step);
    const double p = probability_of(e);
    TEST_ASSERT_TRUE_MESSAGE(p > 0 && p < 1 && p >= before, name);
    before = p;
  }
  Evidence best = good();
  change(&best, 0);
  TEST_ASSERT_TRUE_MESSAGE(before > 2 * probability_of(best), name);
}

void test_the_probability_rises_with_each_kind_of_bad_evidence(void) {
  assert_rises("agreement", [](Evidence* e, double bad) { e->agreement = 1 - bad; });
  assert_rises("noise", [](Evidence* e, double bad) { e->noise_px = bad; });
  assert_rises("places 0",
               [](Evidence* e, double bad) { e->num_places[0] = static_cast<int>(40 - 40 * bad); });
  assert_rises("places 1",
               [](Evidence* e, double bad) { e->num_places[1] = static_cast<int>(40 - 40 * bad); });
  assert_rises("region", [](Evidence* e, double bad) { e->region_shift_rad = 3.14159 * bad; });
  assert_rises("alternative", [](Evidence* e, double bad) { e->has_alternative = bad > 0.5; });
}

void test_the_probability_is_the_logistic_function_of_the_documented_sum(void) {
  Evidence e = good();
  e.num_places[0] = 12;
  e.threshold_px = 2;
  const double logit = 9.609 + 1.528 * std::log(1.02 - 0.85) + 1.986 * 0.3 / 2 -
                       3.085 * std::log(12.0) + 0.510 * std::log(0.002);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1 / (1 + std::exp(-logit)), probability_of(e));
}

// "ok" up to the limit, and beyond it the reasons of the evidence that raises the probability most.
void test_a_pose_that_is_probably_wrong_is_doubtful_for_what_makes_it_so(void) {
  Evidence e = good();
  e.agreement = 0.2;
  e.noise_px = 0.9;
  TEST_ASSERT_TRUE(probability_of(e) > tv::kMostProbabilityWrong);
  assert_reason(TV_REASON_LOW_INLIER_RATIO, e);
  e = good();
  e.num_places[1] = 6;
  TEST_ASSERT_TRUE(probability_of(e) > tv::kMostProbabilityWrong);
  assert_reason(TV_REASON_TOO_FEW_MATCHES, e);
  e = good();
  e.region_shift_rad = 1;
  e.agreement = 0.7;
  TEST_ASSERT_TRUE(probability_of(e) > tv::kMostProbabilityWrong);
  assert_reason(TV_REASON_CROWDED_MATCHES, e);
  e.num_places[0] = 9;
  assert_reason(TV_REASON_CROWDED_MATCHES | TV_REASON_TOO_FEW_MATCHES, e);
  int believed = 0;
  for (int step = 1; step < 200; ++step) {
    e = good();
    e.num_places[0] = 12;
    e.noise_px = 0.6;
    e.agreement = 1 - 0.005 * step;
    const bool ok = judge(e).verdict == TV_VERDICT_OK;
    TEST_ASSERT_EQUAL_INT(probability_of(e) <= tv::kMostProbabilityWrong, ok);
    believed += ok;
  }
  TEST_ASSERT_TRUE(believed > 0 && believed < 199);
}

void test_views_that_change_places_give_the_same_bits(void) {
  Evidence e = good();
  e.num_places[0] = 11;
  e.num_places[1] = 17;
  const double p = probability_of(e);
  std::swap(e.num_places[0], e.num_places[1]);
  TEST_ASSERT_TRUE(p == probability_of(e));
}

// Evidence at its bounds and beyond: what the estimate writes where there is none of it.
void test_no_evidence_gives_a_probability(void) {
  Evidence e = good();
  e.num_places[0] = e.num_places[1] = 0;
  e.agreement = 0;
  e.noise_px = 0;
  e.region_shift_rad = 0;
  TEST_ASSERT_TRUE(probability_of(e) > 0 && probability_of(e) < 1);
  Evidence nothing;
  TEST_ASSERT_TRUE(judge(nothing).probability_wrong == 1);
  for (const tv_kind kind : {TV_KIND_PANORAMIC, TV_KIND_NO_MOTION, TV_KIND_UNCALIBRATED,
                             TV_KIND_PLANAR_OR_PANORAMIC, TV_KIND_DEGENERATE}) {
    e = good();
    e.kind = kind;
    TEST_ASSERT_TRUE(judge(e).probability_wrong == 1);
  }
}

// An uncalibrated pair has neither parallax nor lines nor a second model.
void test_an_uncalibrated_pair_is_judged_by_its_inliers_alone(void) {
  Evidence e;
  e.kind = TV_KIND_UNCALIBRATED;
  e.threshold_px = 1;
  e.num_matches = e.num_inliers = e.num_different = e.num_different_inliers = 50;
  e.coverage[0] = e.coverage[1] = 0.5;
  assert_reason(0, e);
  e.num_matches = 201;
  assert_reason(TV_REASON_LOW_INLIER_RATIO, e);
}

// What descriptors are evidence for is judged with the rest, in one judgement.
void test_descriptors_are_evidence_like_the_rest(void) {
  const double probability = judge(good()).probability_wrong;
  TEST_ASSERT_TRUE(probability < 0.1);
  Evidence repeated = good(), mirrored = good();
  repeated.looks_repeated = mirrored.looks_mirrored = true;
  assert_reason(TV_REASON_REPEATED_STRUCTURE, repeated);
  assert_reason(TV_REASON_LOW_INLIER_RATIO, mirrored);
  TEST_ASSERT_EQUAL_DOUBLE(0.5, judge(repeated).probability_wrong);
  TEST_ASSERT_EQUAL_DOUBLE(0.5, judge(mirrored).probability_wrong);
  // Beside a second model, and where the pose is more probably wrong by itself.
  repeated.has_second_model = true;
  assert_reason(TV_REASON_SECOND_MOTION | TV_REASON_REPEATED_STRUCTURE, repeated);
  mirrored.agreement = 0.01;
  mirrored.noise_px = 0.69;
  mirrored.num_places[0] = mirrored.num_places[1] = 2;
  TEST_ASSERT_TRUE(judge(mirrored).probability_wrong > 0.5);
  // A pair that is refused has its kind as its reason.
  for (const tv_kind kind : {TV_KIND_PANORAMIC, TV_KIND_NO_MOTION, TV_KIND_DEGENERATE}) {
    Evidence e = good(), seen = good();
    e.kind = seen.kind = kind;
    seen.looks_repeated = seen.looks_mirrored = true;
    TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, judge(seen).verdict);
    TEST_ASSERT_EQUAL_HEX32(judge(e).reasons, judge(seen).reasons);
  }
}

AbsoluteEvidence good_absolute() {
  AbsoluteEvidence e;
  e.has_pose = true;
  e.threshold_px = 4;
  e.num_matches = 120;
  e.num_different = 100;
  e.num_inliers = 80;
  e.num_different_inliers = 70;
  e.coverage = 0.5;
  e.width_px = 100;
  e.noise_px = 1;
  e.sigma_rad = 0.005;
  return e;
}

void assert_absolute(uint32_t reasons, const AbsoluteEvidence& e) {
  const tv::Judgement judgement = judge(e);
  TEST_ASSERT_EQUAL_HEX32(reasons, judgement.reasons);
  TEST_ASSERT_EQUAL_INT(!e.has_pose    ? TV_VERDICT_REFUSED
                        : reasons == 0 ? TV_VERDICT_OK
                                       : TV_VERDICT_DOUBTFUL,
                        judgement.verdict);
}

void test_an_absolute_pose_is_judged_by_the_same_rules(void) {
  assert_absolute(0, good_absolute());
  AbsoluteEvidence e = good_absolute();
  e.num_different_inliers = 14;
  assert_absolute(TV_REASON_TOO_FEW_MATCHES, e);
  e = good_absolute();
  e.num_inliers = 29;
  assert_absolute(TV_REASON_LOW_INLIER_RATIO, e);
  e.num_inliers = 30;
  e.noise_px = 2.81;
  assert_absolute(TV_REASON_LOW_INLIER_RATIO, e);
  e.noise_px = 2.79;
  e.sigma_rad = 0.0219;
  assert_absolute(TV_REASON_LOW_PARALLAX, e);
  e.sigma_rad = tv::kUnknown;
  assert_absolute(TV_REASON_LOW_PARALLAX, e);
  e.sigma_rad = 0.0218;
  assert_absolute(0, e);
  e.coverage = 4 / 64.0;
  assert_absolute(TV_REASON_CROWDED_MATCHES, e);
  e.coverage = 5 / 64.0;
  e.width_px = 11.9;
  assert_absolute(TV_REASON_CROWDED_MATCHES, e);
  e.width_px = 12.1;
  e.has_alternative = true;
  assert_absolute(TV_REASON_TWO_PLANAR_SOLUTIONS, e);
}

void test_without_an_absolute_pose_there_is_one_reason(void) {
  AbsoluteEvidence e;
  e.num_different = 14;
  e.is_on_line = true;
  assert_absolute(TV_REASON_TOO_FEW_MATCHES, e);
  e.num_different = 15;
  assert_absolute(TV_REASON_CROWDED_MATCHES, e);
  e.is_on_line = false;
  assert_absolute(TV_REASON_LOW_INLIER_RATIO, e);
}

void test_after_guided_matching_the_first_judgement_stays(void) {
  tv::PairResult of_first{}, of_again{};
  tv_two_view &first = of_first.view, &again = of_again.view;
  first.has_R = first.has_t = again.has_R = again.has_t = 1;
  first.kind = again.kind = TV_KIND_CALIBRATED;
  first.num_inliers = again.num_inliers = 50;
  first.verdict = TV_VERDICT_DOUBTFUL;
  first.reasons = TV_REASON_LOW_PARALLAX;
  of_first.evidence.num_places[0] = of_first.evidence.num_places[1] = 30;
  of_first.evidence.misfit.chi2 = 7;
  of_first.evidence.essential_inliers = 50;
  of_again.evidence.kind = of_first.evidence.kind = TV_KIND_CALIBRATED;
  of_again.evidence.essential_inliers = 60;
  again.verdict = TV_VERDICT_OK;
  TEST_ASSERT_TRUE(tv::takes_guided_estimate(first, again));
  tv::keep_judgement(of_first, &of_again);
  tv_evidence kept;
  tv::write_evidence(of_again.evidence, &kept);
  TEST_ASSERT_TRUE(kept.num_places == 30 && kept.camera_chi2 == 7 && kept.essential_inliers == 60);
  TEST_ASSERT_TRUE(again.verdict == first.verdict && again.reasons == first.reasons);
  TEST_ASSERT_TRUE(tv::takes_guided_estimate(first, again));
  first.verdict = TV_VERDICT_OK;
  TEST_ASSERT_FALSE(tv::takes_guided_estimate(first, again));
  first.verdict = TV_VERDICT_DOUBTFUL;
  again.num_inliers = 49;
  TEST_ASSERT_FALSE(tv::takes_guided_estimate(first, again));
  again.num_inliers = 50;
  again.kind = TV_KIND_PLANAR;
  TEST_ASSERT_FALSE(tv::takes_guided_estimate(first, again));
}

}  // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_each_reason_has_its_threshold);
  RUN_TEST(test_inliers_are_crowded_where_they_are_in_both_images_or_on_a_line_in_one);
  RUN_TEST(test_a_camera_is_contradicted_where_the_direction_would_be_another_one);
  RUN_TEST(test_a_camera_that_is_assumed_is_contradicted_by_any_misfit);
  RUN_TEST(test_a_focal_length_that_is_open_by_more_than_an_eighth_is_doubtful);
  RUN_TEST(test_no_rung_mends_the_cameras);
  RUN_TEST(test_a_rotation_that_hangs_on_one_region_is_doubtful);
  RUN_TEST(test_a_second_model_is_a_motion_or_a_lattice_and_the_opposite_motion_a_repetition);
  RUN_TEST(test_without_a_translation_the_pair_is_refused);
  RUN_TEST(test_the_probability_rises_with_each_kind_of_bad_evidence);
  RUN_TEST(test_the_probability_is_the_logistic_function_of_the_documented_sum);
  RUN_TEST(test_a_pose_that_is_probably_wrong_is_doubtful_for_what_makes_it_so);
  RUN_TEST(test_views_that_change_places_give_the_same_bits);
  RUN_TEST(test_no_evidence_gives_a_probability);
  RUN_TEST(test_an_uncalibrated_pair_is_judged_by_its_inliers_alone);
  RUN_TEST(test_descriptors_are_evidence_like_the_rest);
  RUN_TEST(test_an_absolute_pose_is_judged_by_the_same_rules);
  RUN_TEST(test_without_an_absolute_pose_there_is_one_reason);
  RUN_TEST(test_after_guided_matching_the_first_judgement_stays);
  return UNITY_END();
}
