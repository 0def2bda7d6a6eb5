// The gravity prior: its rows of the normal equations against finite differences, its weight, and
// how a pose and its covariance change by it.
#include <cmath>
#include <limits>

#include "robust/gravity.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::GravityPrior;
using tv::Mat3;
using tv::Pose;
using tv::Vec3;

constexpr double kSigma = 0.01;

GravityPrior any_prior(tv::Random* random) {
  const Vec3 down0 = scene::direction(random), down1 = scene::direction(random);
  return tv::gravity_prior(down0.data(), down1.data(), kSigma);
}

Pose any_pose(tv::Random* random) {
  return Pose{tv::rotation_about(scene::direction(random), uniform(random, -3, 3)),
              scene::direction(random)};
}

struct Rows {
  double upper[15] = {}, gradient[5] = {}, cost = 0;
};

Rows rows_at(const GravityPrior& prior, const Mat3& R, double noise_px, double scale_px) {
  Rows rows;
  rows.cost = tv::add_gravity_prior(prior, R, noise_px, scale_px, rows.upper, rows.gradient);
  return rows;
}

void test_vectors_of_any_length_give_unit_directions(void) {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::nan("");
  const double up[3] = {0, -9.81, 0}, long_one[3] = {3e300, 0, -4e300}, none[3] = {0, 0, 0},
               infinite[3] = {0, inf, 0}, no_number[3] = {nan, 0, 1};
  const GravityPrior prior = tv::gravity_prior(up, long_one, kSigma);
  TEST_ASSERT_TRUE(prior.known);
  TEST_ASSERT_EQUAL_DOUBLE(-1, prior.down[0][1]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.6, prior.down[1][0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, -0.8, prior.down[1][2]);
  TEST_ASSERT_EQUAL_DOUBLE(1, prior.weight);
  TEST_ASSERT_FALSE(tv::gravity_prior(up, long_one, 0).known);
  TEST_ASSERT_FALSE(tv::gravity_prior(up, long_one, nan).known);
  TEST_ASSERT_FALSE(tv::gravity_prior(none, up, kSigma).known);
  TEST_ASSERT_FALSE(tv::gravity_prior(up, infinite, kSigma).known);
  TEST_ASSERT_FALSE(tv::gravity_prior(no_number, up, kSigma).known);
  TEST_ASSERT_TRUE(tv::gravity_prior(up, up, 1e-300).sigma_rad > 1e-9);
}

// The cost is weight |R down0 - down1|^2 / (2 sigma^2) times (noise / scale)^2; the gradient is
// half the cost's derivative times scale^2.
void test_gradient_follows_differences_of_the_cost(void) {
  tv::Random random = tv::random_seeded(21);
  constexpr double kStep = 1e-6, kNoise = 0.4, kScale = 1.5;
  for (int trial = 0; trial < 500; ++trial) {
    GravityPrior prior = any_prior(&random);
    prior.weight = uniform(&random, 0.1, 1);
    const Pose pose = any_pose(&random);
    const Rows rows = rows_at(prior, pose.R, kNoise, kScale);
    const double expected = prior.weight * (pose.R * prior.down[0] - prior.down[1]).squaredNorm() /
                            (2 * kSigma * kSigma) * (kNoise * kNoise) / (kScale * kScale);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * (1 + expected), expected, rows.cost);
    for (int p = 0; p < 5; ++p) {
      double step[5] = {};
      step[p] = kStep;
      const Rows ahead = rows_at(prior, tv::PoseModel{pose}.stepped(step).pose.R, kNoise, kScale);
      step[p] = -kStep;
      const Rows behind = rows_at(prior, tv::PoseModel{pose}.stepped(step).pose.R, kNoise, kScale);
      const double slope = (ahead.cost - behind.cost) / (2 * kStep) * (kScale * kScale) / 2;
      TEST_ASSERT_DOUBLE_WITHIN(1e-5 * (1 + std::fabs(rows.cost)), slope, rows.gradient[p]);
    }
  }
}

// The matrix is noise^2 / (2 sigma^2) J'J, J the derivative of the residual R down0 - down1 by
// finite differences.
void test_matrix_follows_differences_of_the_residual(void) {
  tv::Random random = tv::random_seeded(22);
  constexpr double kStep = 1e-6, kNoise = 0.4;
  const double weight = kNoise * kNoise / (2 * kSigma * kSigma);
  for (int trial = 0; trial < 500; ++trial) {
    const GravityPrior prior = any_prior(&random);
    const Pose pose = any_pose(&random);
    const Rows rows = rows_at(prior, pose.R, kNoise, 1);
    Vec3 columns[5];
    for (int p = 0; p < 5; ++p) {
      double step[5] = {};
      step[p] = kStep;
      const Mat3 ahead = tv::PoseModel{pose}.stepped(step).pose.R;
      step[p] = -kStep;
      const Mat3 behind = tv::PoseModel{pose}.stepped(step).pose.R;
      columns[p] = (ahead * prior.down[0] - behind * prior.down[0]) / (2 * kStep);
    }
    int slot = 0;
    for (int p = 0; p < 5; ++p) {
      for (int r = p; r < 5; ++r) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-7 * weight, weight * columns[p].dot(columns[r]),
                                  rows.upper[slot++]);
      }
    }
  }
}

void test_rows_are_added_to_what_is_there(void) {
  tv::Random random = tv::random_seeded(23);
  const GravityPrior prior = any_prior(&random);
  const Pose pose = any_pose(&random);
  const Rows alone = rows_at(prior, pose.R, 1, 1);
  double upper[15], gradient[5];
  for (int k = 0; k < 15; ++k) upper[k] = 100 + k;
  for (int k = 0; k < 5; ++k) gradient[k] = -k;
  tv::add_gravity_prior(prior, pose.R, 1, 1, upper, gradient);
  for (int k = 0; k < 15; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100 + k + alone.upper[k], upper[k]);
  for (int k = 0; k < 5; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9, -k + alone.gradient[k], gradient[k]);
}

// Returns the weight of gravity beside a pose whose tilt differs from gravity's by `angle` and has
// a standard deviation of sigma_pose, both in radians.
double weight_at(double angle, double sigma_pose) {
  tv::Random random = tv::random_seeded(24);
  const Pose pose = any_pose(&random);
  const Vec3 down0 = scene::direction(&random);
  const Vec3 down1 = pose.R * down0;
  Vec3 b1, b2;
  tv::tangent_basis(down1, &b1, &b2);
  const Vec3 off = tv::rotation_about(b2, angle) * down1;
  const GravityPrior prior = tv::gravity_prior(down0.data(), off.data(), kSigma);
  double covariance[25] = {};
  for (int k = 0; k < 5; ++k) covariance[6 * k] = sigma_pose * sigma_pose;
  return tv::gravity_weight(prior, pose.R, covariance);
}

void test_gravity_that_agrees_has_its_full_weight(void) {
  const double deviation = std::sqrt(2.0) * kSigma;
  TEST_ASSERT_EQUAL_DOUBLE(1, weight_at(0, 0));
  TEST_ASSERT_EQUAL_DOUBLE(1, weight_at(3.0 * deviation, 0));
  TEST_ASSERT_TRUE(weight_at(3.1 * deviation, 0) < 1);
  // A pose with a large standard deviation does not contradict gravity.
  TEST_ASSERT_EQUAL_DOUBLE(1, weight_at(0.5, 0.2));
}

void test_gravity_that_disagrees_pulls_less_the_farther_it_is(void) {
  const double deviation = std::sqrt(2.0) * kSigma;
  double before = 1e300;
  for (double angle = 3.1 * deviation; angle < 3; angle *= 1.2) {
    const double weight = weight_at(angle, 0);
    TEST_ASSERT_TRUE(weight > 0);
    TEST_ASSERT_TRUE(weight * angle < before);
    before = weight * angle;
  }
  const double chord = 2 * std::sin(0.1 / 2), z_sq = chord * chord / (2 * kSigma * kSigma);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, (9.21 / z_sq) * (9.21 / z_sq), weight_at(0.1, 0));
  // The weight is small where measured and predicted gravity are opposite.
  TEST_ASSERT_TRUE(weight_at(tv::kPi, 0) < 1e-4);
  const double down[3] = {0, 0, 1}, up[3] = {0, 0, -1}, covariance[25] = {};
  const GravityPrior opposite = tv::gravity_prior(down, up, kSigma);
  TEST_ASSERT_TRUE(tv::gravity_weight(opposite, Mat3::Identity(), covariance) < 1e-4);
}

// Reference: the inverse of the summed informations, each the inverse of its covariance.
void test_information_of_gravity_is_added_to_that_of_the_points(void) {
  using Matrix5 = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;
  tv::Random random = tv::random_seeded(26);
  for (int trial = 0; trial < 200; ++trial) {
    GravityPrior prior = any_prior(&random);
    prior.weight = uniform(&random, 0.1, 1);
    const Pose pose = any_pose(&random);
    Matrix5 C;
    for (int k = 0; k < 25; ++k) C(k / 5, k % 5) = 2 * kSigma * uniform(&random, -1, 1);
    C = (C * C.transpose() + 1e-6 * Matrix5::Identity()).eval();
    // With scale 1 and noise 1, the rows are J'J divided by gravity's variance.
    const Rows rows = rows_at(prior, pose.R, 1, 1);
    Matrix5 information = C.inverse();
    int slot = 0;
    for (int p = 0; p < 5; ++p) {
      for (int r = p; r < 5; ++r) {
        information(p, r) += rows.upper[slot];
        if (r != p) information(r, p) += rows.upper[slot];
        ++slot;
      }
    }
    const Matrix5 expected = information.inverse();
    double covariance[25];
    for (int k = 0; k < 25; ++k) covariance[k] = C(k / 5, k % 5);
    tv::add_gravity_information(prior, pose.R, covariance);
    for (int k = 0; k < 25; ++k) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-9 * C.trace(), expected(k / 5, k % 5), covariance[k]);
      TEST_ASSERT_EQUAL_DOUBLE(covariance[k], covariance[5 * (k % 5) + k / 5]);
    }
  }
}

// The pose that add_gravity returns must be at the minimum of the sum of two costs: the squared
// Mahalanobis distance from the pose before, and gravity's. There the sum's gradient is zero.
void test_a_pose_with_a_covariance_moves_to_where_both_agree_best(void) {
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Matrix5 = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;
  tv::Random random = tv::random_seeded(27);
  for (int trial = 0; trial < 300; ++trial) {
    const Pose pose = any_pose(&random);
    const Vec3 down0 = scene::direction(&random);
    // The disagreement is small, so that all is linear to first order.
    const Vec3 down1 = tv::rotation_about(scene::direction(&random), 1e-4) * (pose.R * down0);
    GravityPrior prior = tv::gravity_prior(down0.data(), down1.data(), kSigma);
    prior.weight = uniform(&random, 0.1, 1);
    Matrix5 C;
    for (int k = 0; k < 25; ++k) C(k / 5, k % 5) = kSigma * uniform(&random, -1, 1);
    C = (C * C.transpose() + 1e-2 * kSigma * kSigma * Matrix5::Identity()).eval();
    double covariance[25], expected[25];
    for (int k = 0; k < 25; ++k) covariance[k] = expected[k] = C(k / 5, k % 5);
    Pose moved = pose;
    tv::add_gravity(prior, &moved, covariance);
    // The step that was taken, in the parameters of the pose before it.
    const Mat3 turn = moved.R * pose.R.transpose();
    Vec3 b1, b2, c1, c2;
    tv::tangent_basis(pose.t, &b1, &b2);
    tv::tangent_basis(moved.t, &c1, &c2);
    Vector5 step;
    step << 0.5 * (turn(2, 1) - turn(1, 2)), 0.5 * (turn(0, 2) - turn(2, 0)),
        0.5 * (turn(1, 0) - turn(0, 1)), moved.t.dot(b1), moved.t.dot(b2);
    const Rows rows = rows_at(prior, moved.R, 1, 1);
    Vector5 gradient = C.inverse() * step;
    const double size = gradient.norm();
    for (int p = 0; p < 5; ++p) gradient[p] += rows.gradient[p];
    TEST_ASSERT_TRUE(gradient.norm() < 1e-3 * size);
    // The covariance must be that of the sum of both costs, in the basis at the new pose.
    tv::add_gravity_information(prior, pose.R, expected);
    Matrix5 basis = Matrix5::Identity();
    basis.block<2, 2>(3, 3) << c1.dot(b1), c1.dot(b2), c2.dot(b1), c2.dot(b2);
    for (int k = 0; k < 25; ++k) C(k / 5, k % 5) = expected[k];
    const Matrix5 turned = basis * C * basis.transpose();
    for (int k = 0; k < 25; ++k) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-12 * C.trace(), turned(k / 5, k % 5), covariance[k]);
      TEST_ASSERT_EQUAL_DOUBLE(covariance[k], covariance[5 * (k % 5) + k / 5]);
    }
  }
}

void test_a_prior_that_is_not_known_changes_nothing(void) {
  constexpr int kNum = 40;
  static double memory[40000];
  tv::Arena arena = tv::arena_over(memory, sizeof memory);
  tv::RayPairs pairs = tv::alloc_ray_pairs(arena, kNum, true);
  pairs.num = kNum;
  tv::Random random = tv::random_seeded(25);
  tv::Mat32 jacobian;
  jacobian << 0.002, 0, 0, 0.002, 0, 0;
  for (int i = 0; i < kNum; ++i) {
    for (int v = 0; v < 2; ++v) {
      tv::set_ray(pairs, v, i, Vec3(uniform(&random, -1, 1), uniform(&random, -1, 1), 1), jacobian);
    }
  }
  tv::finish_rays(pairs, kNum);
  const Pose pose = any_pose(&random);
  const GravityPrior known = any_prior(&random), unknown;
  const tv::RobustLoss loss{tv::Loss::kCauchy, 100};
  double upper[4][15], gradient[4][5], cost[4];
  cost[0] = tv::PoseModel{pose}.normal_equations(pairs, nullptr, kNum, loss, upper[0], gradient[0]);
  const GravityPrior* priors[3] = {nullptr, &unknown, &known};
  for (int k = 0; k < 3; ++k) {
    const tv::GravityPoseModel model{pose, priors[k], 0.5};
    cost[k + 1] = model.normal_equations(pairs, nullptr, kNum, loss, upper[k + 1], gradient[k + 1]);
  }
  for (int k = 1; k < 3; ++k) {
    TEST_ASSERT_EQUAL_MEMORY(upper[0], upper[k], sizeof upper[0]);
    TEST_ASSERT_EQUAL_MEMORY(gradient[0], gradient[k], sizeof gradient[0]);
    TEST_ASSERT_EQUAL_MEMORY(&cost[0], &cost[k], sizeof cost[0]);
  }
  const Rows alone = rows_at(known, pose.R, 0.5, 100);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, cost[0] + alone.cost, cost[3]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, gradient[0][0] + alone.gradient[0], gradient[3][0]);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_vectors_of_any_length_give_unit_directions);
  RUN_TEST(test_gradient_follows_differences_of_the_cost);
  RUN_TEST(test_matrix_follows_differences_of_the_residual);
  RUN_TEST(test_rows_are_added_to_what_is_there);
  RUN_TEST(test_gravity_that_agrees_has_its_full_weight);
  RUN_TEST(test_gravity_that_disagrees_pulls_less_the_farther_it_is);
  RUN_TEST(test_information_of_gravity_is_added_to_that_of_the_points);
  RUN_TEST(test_a_pose_with_a_covariance_moves_to_where_both_agree_best);
  RUN_TEST(test_a_prior_that_is_not_known_changes_nothing);
  return UNITY_END();
}
