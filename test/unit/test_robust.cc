// Parts of the robust loop: sampler, stopping rule, preparation of matches, the test against
// chance, covariance.
#include <algorithm>
#include <cmath>
#include <limits>

#include "robust/chance.h"
#include "robust/covariance.h"
#include "robust/loop.h"
#include "robust/two_view.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Vec3;

void expect_distinct(const int32_t* sample, int size, int bound) {
  for (int i = 0; i < size; ++i) {
    TEST_ASSERT_TRUE(sample[i] >= 0 && sample[i] < bound);
    for (int j = 0; j < i; ++j) TEST_ASSERT_TRUE(sample[i] != sample[j]);
  }
}

void test_samples_are_distinct_and_in_range(void) {
  for (int num : {5, 6, 8, 100}) {
    for (bool progressive : {false, true}) {
      tv::Sampler sampler = tv::make_sampler(7, num, 5, progressive);
      for (int k = 0; k < 2000; ++k) {
        int32_t sample[5];
        tv::draw_sample(sampler, sample);
        expect_distinct(sample, 5, num);
      }
    }
  }
}

void test_uniform_samples_draw_each_match_equally_often(void) {
  constexpr int kNum = 20, kDraws = 40000;
  int counts[kNum] = {};
  tv::Sampler sampler = tv::make_sampler(8, kNum, 5, false);
  for (int k = 0; k < kDraws; ++k) {
    int32_t sample[5];
    tv::draw_sample(sampler, sample);
    for (int32_t i : sample) ++counts[i];
  }
  // Each index is expected 10000 times; the standard deviation is below 100, so 500 is five of
  // them.
  for (int count : counts) TEST_ASSERT_INT_WITHIN(500, kDraws / 4, count);
}

void test_progressive_samples_start_with_the_surest_and_end_with_all(void) {
  constexpr int kNum = 200;
  tv::Sampler sampler = tv::make_sampler(9, kNum, 5, true);
  int last_pool = 5;
  for (int k = 0; k < static_cast<int>(3 * kNum * tv::kProsacSamples); ++k) {
    int32_t sample[5];
    tv::draw_sample(sampler, sample);
    if (k % 2 == 1) {  // every second sample is uniform
      expect_distinct(sample, 5, kNum);
      continue;
    }
    TEST_ASSERT_TRUE(sampler.pool >= last_pool);
    last_pool = sampler.pool;
    expect_distinct(sample, 5, sampler.pool);
    if (k == 0) {
      TEST_ASSERT_EQUAL_INT(5, sampler.pool);
    }
    if (k == 20) {
      TEST_ASSERT_LESS_THAN_INT(60, sampler.pool);
    }
  }
  TEST_ASSERT_EQUAL_INT(kNum, sampler.pool);
}

void test_samples_needed_follow_the_formula(void) {
  // Half of 1000 matches are true: a sample of five is all true with a probability of about 2^-5.
  TEST_ASSERT_INT_WITHIN(5, 294, tv::samples_needed(0.9999, 500, 1000, 5, 100000));
  TEST_ASSERT_EQUAL_INT(1, tv::samples_needed(0.99, 100, 100, 5, 1000));
  TEST_ASSERT_EQUAL_INT(1000, tv::samples_needed(0.99, 4, 100, 5, 1000));
  TEST_ASSERT_EQUAL_INT(1000, tv::samples_needed(0.9999, 10, 100, 5, 1000));
  TEST_ASSERT_EQUAL_INT(1, tv::samples_needed(0, 50, 100, 5, 1000));
}

alignas(64) uint8_t arena_memory[1 << 21];
scene::Scene pair;

tv::Matches prepare(const double* pixels0, const double* pixels1, const float* ratios, int num) {
  tv::TwoViewProblem problem{};
  problem.calibrated = true;
  problem.camera[0] = problem.camera[1] = tv::prepare_camera(scene::pinhole());
  problem.pixels[0] = pixels0;
  problem.pixels[1] = pixels1;
  problem.ratios = ratios;
  problem.num = num;
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  tv::Matches matches;
  tv::prepare_matches(problem, arena, &matches);
  return matches;
}

void test_matches_are_sorted_and_repeated_ones_put_last(void) {
  const double pixels0[12] = {5, 5, 3, 3, 5, 5, 1, 1, 3, 3, 9, 9};
  const double pixels1[12] = {6, 6, 4, 4, 6, 6, 2, 2, 4, 5, 9, 9};
  const float ratios[6] = {0.5f, 0.2f, 0.1f, 0.5f, 0.2f, std::numeric_limits<float>::quiet_NaN()};
  const tv::Matches matches = prepare(pixels0, pixels1, ratios, 6);
  TEST_ASSERT_EQUAL_INT(6, matches.num_all);
  TEST_ASSERT_EQUAL_INT(5, matches.num_unique());
  const int32_t expected[6] = {2, 1, 4, 3, 5, 0};
  TEST_ASSERT_EQUAL_INT32_ARRAY(expected, matches.order, 6);
}

void test_matches_that_are_no_numbers_are_dropped(void) {
  const double inf = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double pixels0[10] = {1, 2, nan, 1, 1, inf, 7, 7, 1e300, 0};
  const double pixels1[10] = {1, 2, 5, 5, 6, 6, -inf, 7, 1, 1};
  const tv::Matches matches = prepare(pixels0, pixels1, nullptr, 5);
  TEST_ASSERT_EQUAL_INT(1, matches.num_all);
  TEST_ASSERT_EQUAL_INT(0, matches.order[0]);
}

void test_binomials_and_false_alarms_follow_their_formulas(void) {
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, std::log(252.0), tv::log_binomial(10, 5));
  TEST_ASSERT_DOUBLE_WITHIN(1e-8, 66.78384165201743, tv::log_binomial(100, 50));
  TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0, tv::log_binomial(1000000, 0));
  const double expected = std::log(10.0 * 95 * 252.0) - std::log(252.0) +
                          tv::log_binomial(100, 10) + std::log(252.0) + 5 * std::log(0.01);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected, tv::log_false_alarms(100, 10, 5, 10, 0.01));
  TEST_ASSERT_TRUE(tv::log_false_alarms(100, 5, 5, 10, 0.01) > 1e300);
}

void test_chance_of_agreement_is_near_a_bands_share_of_the_image(void) {
  scene::Options options;
  options.num = 1000;
  scene::make(options, &pair);
  const tv::Matches matches = prepare(pair.pixels[0], pair.pixels[1], nullptr, 1000);
  const Mat3 E = tv::essential_from_pose({pair.R, pair.t});
  const double p = tv::chance_of_agreement(matches, E, 1, 1);
  TEST_ASSERT_TRUE(p > 0.001 && p < 0.03);
  TEST_ASSERT_TRUE(tv::chance_of_agreement(matches, E, 1e6, 1) > 0.9);
}

// A pose with a covariance, and its inverse.
struct Known {
  tv::Pose pose, inverse;
  Eigen::Matrix<double, 5, 5, Eigen::RowMajor> covariance;
};

Known random_pose(tv::Random* random) {
  Known known;
  known.pose = {tv::rotation_about(scene::direction(random), uniform(random, 0, 3)),
                scene::direction(random)};
  known.inverse = {known.pose.R.transpose(), -(known.pose.R.transpose() * known.pose.t)};
  Eigen::Matrix<double, 5, 5, Eigen::RowMajor> A;
  for (int k = 0; k < 25; ++k) A(k / 5, k % 5) = uniform(random, -1, 1);
  known.covariance = A * A.transpose();
  return known;
}

void test_covariance_of_the_inverse_of_the_inverse_is_itself(void) {
  tv::Random random = tv::random_seeded(12);
  for (int trial = 0; trial < 100; ++trial) {
    const auto [pose, inverse, A] = random_pose(&random);
    double there[25], back[25];
    tv::invert_covariance(pose, inverse, A.data(), there);
    tv::invert_covariance(inverse, pose, there, back);
    for (int k = 0; k < 25; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-11, A(k / 5, k % 5), back[k]);
  }
}

// The variance of the direction along a step across t is the same in both parameters, also where
// the axes that they are built from are others; what carries it back gives it again.
void test_covariance_is_carried_to_a_direction_near_it(void) {
  tv::Random random = tv::random_seeded(15);
  for (const Vec3& t : {Vec3(0.3, 0.3 - 1e-9, 0.9), Vec3(0.1, 0.7, -0.2)}) {
    const tv::Vec3 from = t.normalized(), to = (t + Vec3(0, 2e-9, 0)).normalized();
    const Eigen::Matrix<double, 5, 5, Eigen::RowMajor> A = random_pose(&random).covariance;
    double there[25], back[25];
    tv::carry_covariance(from, to, A.data(), there);
    Vec3 b[2], c[2];
    tv::tangent_basis(from, &b[0], &b[1]);
    tv::tangent_basis(to, &c[0], &c[1]);
    const Vec3 across = from.cross(Vec3(0.2, -0.5, 0.4));
    double before = 0, after = 0;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        before += across.dot(b[i]) * across.dot(b[j]) * A(3 + i, 3 + j);
        after += across.dot(c[i]) * across.dot(c[j]) * there[5 * (3 + i) + 3 + j];
      }
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, before, after);
    for (int k = 0; k < 3; ++k) TEST_ASSERT_TRUE(there[6 * k] == A(k, k));
    tv::carry_covariance(to, from, there, back);
    for (int k = 0; k < 25; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-12, A(k / 5, k % 5), back[k]);
  }
}

// Of a pose and of its inverse the direction's sigma is the same: the larger of the two, each the
// root of the trace of its covariance's block.
void test_sigma_of_the_direction_is_the_larger_of_the_pose_and_its_inverse(void) {
  tv::Random random = tv::random_seeded(14);
  for (int trial = 0; trial < 100; ++trial) {
    const auto [pose, inverse, A] = random_pose(&random);
    double there[25];
    tv::invert_covariance(pose, inverse, A.data(), there);
    const double sums[2] = {A(3, 3) + A(4, 4), there[18] + there[24]};
    const double expected = std::sqrt(std::max(sums[0], sums[1]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, expected, tv::direction_sigma(pose.t, A.data()));
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, expected, tv::direction_sigma(inverse.t, there));
  }
}

// Reference: the Jacobian of the map from the pose's parameters to the inverse's, by a small step.
void test_covariance_of_the_inverse_follows_a_step_of_the_pose(void) {
  tv::Random random = tv::random_seeded(13);
  const tv::Pose pose{tv::rotation_about(scene::direction(&random), 0.7),
                      scene::direction(&random)};
  const tv::Pose inverse{pose.R.transpose(), -(pose.R.transpose() * pose.t)};
  Vec3 b1, b2, c1, c2;
  tv::tangent_basis(pose.t, &b1, &b2);
  tv::tangent_basis(inverse.t, &c1, &c2);
  constexpr double kStep = 1e-6;
  for (int p = 0; p < 5; ++p) {
    double unit[25] = {}, mapped[25], step[5] = {};
    unit[6 * p] = 1;
    tv::invert_covariance(pose, inverse, unit, mapped);
    Vec3 w = Vec3::Zero();
    if (p < 3) w[p] = kStep;
    const Mat3 R = tv::rotation_step(w) * pose.R;
    const Vec3 t = (pose.t + (p == 3 ? kStep : 0) * b1 + (p == 4 ? kStep : 0) * b2).normalized();
    // The rotation of the inverse pose after the step, relative to that before the step.
    const Mat3 turn = R.transpose() * pose.R;
    const Vec3 moved = -(R.transpose() * t);
    step[0] = 0.5 * (turn(2, 1) - turn(1, 2)) / kStep;
    step[1] = 0.5 * (turn(0, 2) - turn(2, 0)) / kStep;
    step[2] = 0.5 * (turn(1, 0) - turn(0, 1)) / kStep;
    step[3] = (moved - inverse.t).dot(c1) / kStep;
    step[4] = (moved - inverse.t).dot(c2) / kStep;
    for (int r = 0; r < 5; ++r) {
      for (int c = 0; c < 5; ++c) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, step[r] * step[c], mapped[5 * r + c]);
      }
    }
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_samples_are_distinct_and_in_range);
  RUN_TEST(test_uniform_samples_draw_each_match_equally_often);
  RUN_TEST(test_progressive_samples_start_with_the_surest_and_end_with_all);
  RUN_TEST(test_samples_needed_follow_the_formula);
  RUN_TEST(test_matches_are_sorted_and_repeated_ones_put_last);
  RUN_TEST(test_matches_that_are_no_numbers_are_dropped);
  RUN_TEST(test_binomials_and_false_alarms_follow_their_formulas);
  RUN_TEST(test_chance_of_agreement_is_near_a_bands_share_of_the_image);
  RUN_TEST(test_covariance_of_the_inverse_of_the_inverse_is_itself);
  RUN_TEST(test_covariance_is_carried_to_a_direction_near_it);
  RUN_TEST(test_sigma_of_the_direction_is_the_larger_of_the_pose_and_its_inverse);
  RUN_TEST(test_covariance_of_the_inverse_follows_a_step_of_the_pose);
  return UNITY_END();
}
