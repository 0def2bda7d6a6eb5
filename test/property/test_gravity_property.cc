// Gravity in two-view estimation, on synthetic pairs with 30 to 60 per cent of true matches: how
// much gravity lowers the error where its own error agrees with its sigma, how much it raises the
// error where gravity is wrong, and which input is refused.
#include <cmath>
#include <cstring>
#include <limits>

#include "support/api.h"
#include "support/calls.h"
#include "support/sanitized.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Vec3;

constexpr int kPairs = kSanitized ? 20 : 200, kWrongPairs = kSanitized ? 10 : 40;
constexpr int kMatches = 150, kSigmas = 4;
constexpr double kSigmasDeg[kSigmas] = {0.1, 0.5, 1, 2};
constexpr double kRadians = tv::kPi / 180;
// Larger errors count as this one, in degrees; a pair without a pose has this error.
constexpr double kMostDeg = 10;

api_context api;
scene::Scene pair;

struct Gravity {
  Vec3 down[2];
  double sigma_rad;
};

tv_estimate_options options_of(int method, const Gravity& gravity) {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  options.method = method;
  options.gravity_sigma_rad = gravity.sigma_rad;
  for (int k = 0; k < 3; ++k) {
    options.gravity0[k] = gravity.down[0][k];
    options.gravity1[k] = gravity.down[1][k];
  }
  return options;
}

tv_status estimate(const tv_estimate_options& options, tv_two_view* result) {
  tv_two_view_init(result);
  return estimate_pixels(api.context, &pair.options.camera[0], &pair.options.camera[1],
                         pair.pixels[0], pair.pixels[1], nullptr, pair.options.num, &options,
                         result, nullptr);
}

tv_two_view estimated(int method, const Gravity& gravity) {
  tv_two_view result;
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate(options_of(method, gravity), &result));
  return result;
}

void make_pair(int k, Gravity* truth) {
  tv::Random random = tv::random_seeded(static_cast<uint64_t>(900 + k));
  scene::Options options;
  options.num = kMatches;
  options.inlier_share = uniform(&random, 0.3, 0.6);
  options.seed = static_cast<uint64_t>(5000 + k);
  scene::make(options, &pair);
  truth->down[0] = scene::direction(&random);
  truth->down[1] = pair.R * truth->down[0];
  truth->sigma_rad = 0;
}

Gravity noisy(const Gravity& truth, double sigma_deg, uint64_t seed) {
  tv::Random random = tv::random_seeded(seed);
  Gravity gravity{{}, sigma_deg * kRadians};
  for (int v = 0; v < 2; ++v) {
    Vec3 b1, b2;
    tv::tangent_basis(truth.down[v], &b1, &b2);
    const double u = scene::normal(&random), w = scene::normal(&random);
    gravity.down[v] = (truth.down[v] + gravity.sigma_rad * (u * b1 + w * b2)).normalized();
  }
  return gravity;
}

double rotation_error_deg(const tv_two_view& result) {
  return result.has_R ? std::fmin(scene::rotation_error_deg(result.R, pair.R), kMostDeg) : kMostDeg;
}

double pose_error_deg(const tv_two_view& result) {
  if (!result.has_t) return kMostDeg;
  const double moved = scene::translation_error_deg(result.t, pair.t);
  return std::fmin(std::fmax(rotation_error_deg(result), moved), kMostDeg);
}

struct Sum {
  double sum = 0, squares = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
  }
  double mean() const { return sum / kPairs; }
  double error_of_mean() const {
    return std::sqrt(std::fmax(squares / kPairs - mean() * mean(), 0) / kPairs);
  }
};

// The sums over all pairs. Arrays are indexed by sigma, then by method: five-point, upright.
struct Statistics {
  Sum base_pose, base_rotation;
  // The gain in accuracy, in degrees: the error of the five-point solver without gravity less the
  // error of the method with gravity. It is positive where gravity helps.
  Sum pose_gain[kSigmas][2], rotation_gain[kSigmas][2];
  int base_covered = 0, covered[kSigmas][2] = {};
  int64_t base_samples = 0, samples[kSigmas][2] = {};
};

Statistics statistics;

void gather_statistics() {
  if (statistics.base_samples > 0) return;
  constexpr int kMethods[2] = {TV_SOLVER_FIVE_POINT, TV_SOLVER_UPRIGHT};
  for (int k = 0; k < kPairs; ++k) {
    Gravity truth;
    make_pair(k, &truth);
    const tv_two_view base = estimated(TV_SOLVER_FIVE_POINT, truth);
    statistics.base_pose.add(pose_error_deg(base));
    statistics.base_rotation.add(rotation_error_deg(base));
    statistics.base_covered += scene::within_ellipsoid_95(base, pair.R, pair.t);
    statistics.base_samples += base.num_iterations;
    for (int s = 0; s < kSigmas; ++s) {
      const Gravity gravity = noisy(truth, kSigmasDeg[s], static_cast<uint64_t>(10 * k + s));
      for (int m = 0; m < 2; ++m) {
        const tv_two_view result = estimated(kMethods[m], gravity);
        statistics.pose_gain[s][m].add(pose_error_deg(base) - pose_error_deg(result));
        statistics.rotation_gain[s][m].add(rotation_error_deg(base) - rotation_error_deg(result));
        statistics.covered[s][m] += scene::within_ellipsoid_95(result, pair.R, pair.t);
        statistics.samples[s][m] += result.num_iterations;
      }
    }
  }
}

void test_gravity_that_is_true_to_its_sigma_does_not_cost_accuracy(void) {
  gather_statistics();
  if (kSanitized) return;
  for (int s = 0; s < kSigmas; ++s) {
    for (int m = 0; m < 2; ++m) {
      const Sum& gain = statistics.pose_gain[s][m];
      TEST_ASSERT_TRUE(gain.mean() > -3 * gain.error_of_mean() - 0.005);
    }
  }
}

void test_gravity_of_a_tenth_of_a_degree_makes_the_pose_better(void) {
  gather_statistics();
  if (kSanitized) return;
  for (int m = 0; m < 2; ++m) {
    const Sum& gain = statistics.rotation_gain[0][m];
    TEST_ASSERT_TRUE(gain.mean() > 2 * gain.error_of_mean());
    TEST_ASSERT_TRUE(gain.mean() > 0.1 * statistics.base_rotation.mean());
  }
}

void test_the_ellipsoid_holds_the_truth_as_often_as_without_gravity(void) {
  gather_statistics();
  if (kSanitized) return;
  for (int s = 0; s < kSigmas; ++s) {
    for (int m = 0; m < 2; ++m) {
      TEST_ASSERT_TRUE(statistics.covered[s][m] >= statistics.base_covered - kPairs / 20);
    }
  }
}

void test_the_upright_method_needs_fewer_samples(void) {
  gather_statistics();
  if (kSanitized) return;
  for (int s = 0; s < kSigmas; ++s) {
    TEST_ASSERT_TRUE(3 * statistics.samples[s][1] < statistics.base_samples);
  }
}

// Gravity is five degrees wrong, and its sigma is given as half a degree.
void test_wrong_gravity_does_not_ruin_the_pose(void) {
  Sum base, with;
  for (int k = 0; k < kWrongPairs; ++k) {
    Gravity gravity;
    make_pair(k, &gravity);
    base.add(rotation_error_deg(estimated(TV_SOLVER_FIVE_POINT, gravity)));
    Vec3 b1, b2;
    tv::tangent_basis(gravity.down[1], &b1, &b2);
    gravity.down[1] = tv::rotation_about(b1, 5 * kRadians) * gravity.down[1];
    gravity.sigma_rad = 0.5 * kRadians;
    with.add(rotation_error_deg(estimated(TV_SOLVER_FIVE_POINT, gravity)));
  }
  if (kSanitized) return;
  TEST_ASSERT_TRUE(with.sum < 1.1 * base.sum);
}

void test_swapped_views_with_swapped_gravity_give_the_inverse(void) {
  for (int method : {TV_SOLVER_FIVE_POINT, TV_SOLVER_UPRIGHT}) {
    for (int k = 0; k < 5; ++k) {
      Gravity truth;
      make_pair(k, &truth);
      const Gravity gravity = noisy(truth, 0.5, 3);
      const tv_two_view forward = estimated(method, gravity);
      static scene::Scene swapped;
      std::memcpy(swapped.pixels[0], pair.pixels[1], sizeof swapped.pixels[0]);
      std::memcpy(swapped.pixels[1], pair.pixels[0], sizeof swapped.pixels[1]);
      std::memcpy(pair.pixels, swapped.pixels, sizeof pair.pixels);
      const tv_two_view backward =
          estimated(method, Gravity{{gravity.down[1], gravity.down[0]}, gravity.sigma_rad});
      TEST_ASSERT_TRUE(forward.has_R);
      for (int i = 0; i < 9; ++i) {
        TEST_ASSERT_EQUAL_DOUBLE(forward.R[i], backward.R[3 * (i % 3) + i / 3]);
      }
    }
  }
}

void test_vectors_of_any_length_mean_their_direction(void) {
  Gravity truth;
  make_pair(1, &truth);
  const Gravity gravity = noisy(truth, 0.5, 4);
  const tv_two_view unit = estimated(TV_SOLVER_FIVE_POINT, gravity);
  const Gravity stretched{{4 * gravity.down[0], 0.5 * gravity.down[1]}, gravity.sigma_rad};
  const tv_two_view twice = estimated(TV_SOLVER_FIVE_POINT, stretched);
  TEST_ASSERT_EQUAL_MEMORY(unit.R, twice.R, sizeof unit.R);
  TEST_ASSERT_EQUAL_MEMORY(unit.covariance, twice.covariance, sizeof unit.covariance);
}

void test_vectors_without_a_sigma_are_not_read(void) {
  Gravity truth;
  make_pair(2, &truth);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const tv_two_view plain =
      estimated(TV_SOLVER_FIVE_POINT, Gravity{{Vec3::Zero(), Vec3::Zero()}, 0});
  const tv_two_view unread =
      estimated(TV_SOLVER_FIVE_POINT, Gravity{{Vec3(nan, 0, 0), Vec3(1, 2, 3)}, 0});
  TEST_ASSERT_EQUAL_MEMORY(&plain, &unread, sizeof plain);
}

void test_what_is_no_gravity_is_refused(void) {
  Gravity good;
  make_pair(3, &good);
  good.sigma_rad = 0.01;
  const double inf = std::numeric_limits<double>::infinity(), nan = std::nan("");
  tv_two_view result;
  for (int view = 0; view < 2; ++view) {
    for (double bad : {nan, inf, -inf}) {
      Gravity gravity = good;
      gravity.down[view][1] = bad;
      TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE,
                            estimate(options_of(TV_SOLVER_FIVE_POINT, gravity), &result));
    }
    Gravity gravity = good;
    gravity.down[view].setZero();
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                          estimate(options_of(TV_SOLVER_FIVE_POINT, gravity), &result));
  }
  for (double bad : {nan, inf, -inf}) {
    good.sigma_rad = bad;
    TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE,
                          estimate(options_of(TV_SOLVER_FIVE_POINT, good), &result));
  }
  for (double bad : {-1e-9, 3.2}) {
    good.sigma_rad = bad;
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                          estimate(options_of(TV_SOLVER_FIVE_POINT, good), &result));
  }
  good.sigma_rad = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, estimate(options_of(TV_SOLVER_UPRIGHT, good), &result));
}

void test_the_upright_method_needs_cameras(void) {
  Gravity good;
  make_pair(3, &good);
  good.sigma_rad = 0.01;
  const tv_estimate_options options = options_of(TV_SOLVER_UPRIGHT, good);
  tv_two_view result;
  tv_two_view_init(&result);
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_ARGUMENT,
      estimate_pixels(api.context, nullptr, nullptr, pair.pixels[0], pair.pixels[1], nullptr,
                      pair.options.num, &options, &result, nullptr));
}

// With extreme sigmas and opposite gravities the call returns, and every output is finite.
void test_extreme_sigmas_and_opposite_gravities_give_finite_results(void) {
  Gravity truth;
  make_pair(4, &truth);
  for (int method : {TV_SOLVER_FIVE_POINT, TV_SOLVER_UPRIGHT}) {
    for (double sigma_rad : {1e-300, 1e-6, 3.1}) {
      for (double sign : {1.0, -1.0}) {
        const tv_two_view result =
            estimated(method, Gravity{{truth.down[0], sign * truth.down[1]}, sigma_rad});
        for (double entry : result.R) TEST_ASSERT_TRUE(std::isfinite(entry));
        for (double entry : result.t) TEST_ASSERT_TRUE(std::isfinite(entry));
        for (double entry : result.covariance) TEST_ASSERT_TRUE(std::isfinite(entry));
      }
    }
  }
}

}  // namespace

int main(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  api = api_make(&limits);
  UNITY_BEGIN();
  RUN_TEST(test_gravity_that_is_true_to_its_sigma_does_not_cost_accuracy);
  RUN_TEST(test_gravity_of_a_tenth_of_a_degree_makes_the_pose_better);
  RUN_TEST(test_the_ellipsoid_holds_the_truth_as_often_as_without_gravity);
  RUN_TEST(test_the_upright_method_needs_fewer_samples);
  RUN_TEST(test_wrong_gravity_does_not_ruin_the_pose);
  RUN_TEST(test_swapped_views_with_swapped_gravity_give_the_inverse);
  RUN_TEST(test_vectors_of_any_length_mean_their_direction);
  RUN_TEST(test_vectors_without_a_sigma_are_not_read);
  RUN_TEST(test_what_is_no_gravity_is_refused);
  RUN_TEST(test_the_upright_method_needs_cameras);
  RUN_TEST(test_extreme_sigmas_and_opposite_gravities_give_finite_results);
  api_release(&api);
  return UNITY_END();
}
