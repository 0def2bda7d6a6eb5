// Monte Carlo test: how often the 95 % ellipsoids of poses and of points contain the truth.
#include <cstdlib>

#include "support/bundle_scene.h"
#include "support/calls.h"
#include "twoview/alloc.h"

using bundle_scene::Geometry;
using bundle_scene::Options;
using bundle_scene::Scene;
using tv::Mat3;
using tv::Vec3;

static Scene pair;
static tv_point points[bundle_scene::kMaxPoints];
static double covariances[9 * bundle_scene::kMaxPoints];
static tv_context* context;

void setUp() {}
void tearDown() {}

namespace {

constexpr double kChiSq95[6] = {0, 3.8415, 5.9915, 7.8147, 9.4877, 11.0705};
constexpr double kNoise = 0.5;

// Returns d' C^-1 d (by Cholesky), or a negative number if C is not positive definite.
template <int N>
double mahalanobis_sq(const double* C, const double* d) {
  double L[N][N] = {}, y[N], sum = 0;
  for (int i = 0; i < N; ++i) {
    y[i] = d[i];
    for (int j = 0; j <= i; ++j) {
      double value = C[N * i + j];
      for (int k = 0; k < j; ++k) value -= L[i][k] * L[j][k];
      if (i == j) {
        if (!(value > 0)) return -1;
        L[i][i] = std::sqrt(value);
      } else {
        L[i][j] = value / L[j][j];
      }
    }
    for (int k = 0; k < i; ++k) y[i] -= L[i][k] * y[k];
    y[i] /= L[i][i];
    sum += y[i] * y[i];
  }
  return sum;
}

struct Count {
  int held = 0, all = 0, unknown = 0;
  double share() const { return static_cast<double>(held) / all; }
};

void expect_coverage(const Count& count, int least, const char* what) {
  char text[160];
  std::snprintf(text, sizeof text, "%s: %d of %d (%.2f %%), %d unknown", what, count.held,
                count.all, 100 * count.share(), count.unknown);
  if (std::getenv("TWOVIEW_VERBOSE") != nullptr) std::printf("%s\n", text);
  TEST_ASSERT_TRUE_MESSAGE(count.all >= least, text);
  TEST_ASSERT_TRUE_MESSAGE(count.unknown * 100 <= count.all, text);
  TEST_ASSERT_TRUE_MESSAGE(count.share() >= 0.93 && count.share() <= 0.97, text);
}

// The pose's error (w, a, b): R_true = exp([w]x) R, t_true = normalise(t + a b1 + b b2).
void pose_error(const double R[9], const double t[3], double error[5]) {
  Mat3 estimate;
  for (int k = 0; k < 9; ++k) estimate(k / 3, k % 3) = R[k];
  const Mat3 d = pair.R * estimate.transpose();
  const Vec3 u = Vec3(t[0], t[1], t[2]).normalized(), truth = pair.t.normalized();
  error[0] = 0.5 * (d(2, 1) - d(1, 2));
  error[1] = 0.5 * (d(0, 2) - d(2, 0));
  error[2] = 0.5 * (d(1, 0) - d(0, 1));
  Vec3 b1, b2;
  tv::tangent_basis(u, &b1, &b2);
  error[3] = truth.dot(b1) / truth.dot(u);
  error[4] = truth.dot(b2) / truth.dot(u);
}

void add_points(const double R[9], const double t[3], const double* pose_covariance, Count* count) {
  const Options& o = pair.options;
  const tv_camera_pair cameras = pair_of(&o.camera[0], &o.camera[1], R, t);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_point_covariances(&cameras, points, o.num, kNoise, pose_covariance, covariances));
  for (int i = 0; i < o.num; ++i) {
    if (pair.outlier[i]) continue;
    if (points[i].status != TV_POINT_OK) {
      ++count->unknown;
      continue;
    }
    double d[3];
    for (int k = 0; k < 3; ++k) d[k] = points[i].position[k] - pair.truth[i][k];
    const double d_sq = mahalanobis_sq<3>(covariances + 9 * i, d);
    ++count->all;
    count->held += d_sq >= 0 && d_sq <= kChiSq95[3];
  }
}

struct Counts {
  Count points, pose;
};

// Adjusts num_pairs pairs and counts how often the ellipsoids hold the truth. The bundle's
// covariance uses the noise estimated from the residuals; with `known_noise` it is scaled to the
// true noise.
Counts run(const Options& base, const tv_bundle_options& bundle, int num_pairs, bool known_noise) {
  Counts counts;
  for (int p = 0; p < num_pairs; ++p) {
    Options options = base;
    options.seed = base.seed + static_cast<uint64_t>(p);
    if (bundle.hold_pose != 0) options.start_off_rad = 0;
    bundle_scene::make(options, &pair);
    tv_camera_pair cameras =
        pair_of(&options.camera[0], &options.camera[1], pair.start_R, pair.start_t);
    const double *const R = cameras.cam1_from_cam0_R, *const t = cameras.cam1_from_cam0_t;
    std::memcpy(points, pair.start, sizeof points);
    tv_bundle_result result;
    tv_bundle_result_init(&result);
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust_pixels(context, pair.pixels[0], pair.pixels[1], options.num,
                                               &bundle, &cameras, points, &result));
    TEST_ASSERT_TRUE(result.converged);
    if (bundle.hold_pose != 0) {
      TEST_ASSERT_EQUAL_MEMORY(pair.start_R, R, sizeof pair.start_R);
      TEST_ASSERT_EQUAL_MEMORY(pair.start_t, t, sizeof pair.start_t);
      add_points(R, t, nullptr, &counts.points);
      continue;
    }
    TEST_ASSERT_TRUE(result.has_covariance);
    if (known_noise) {
      const double scale = kNoise / result.noise_px;
      for (double& value : result.covariance) value *= scale * scale;
    }
    double error[5];
    pose_error(R, t, error);
    ++counts.pose.all;
    counts.pose.held += mahalanobis_sq<5>(result.covariance, error) <= kChiSq95[5];
    add_points(R, t, result.covariance, &counts.points);
  }
  return counts;
}

constexpr Geometry kGeometries[3] = {Geometry::kGeneral, Geometry::kSideways, Geometry::kForward};
constexpr const char* kNames[3] = {"general", "sideways", "forward"};

void test_points_hold_the_truth_when_the_pose_is_exact() {
  for (int g = 0; g < 3; ++g) {
    Options options;
    options.geometry = kGeometries[g];
    options.baseline = 0.3;
    options.seed = 100;
    tv_bundle_options bundle;
    tv_bundle_options_init(&bundle);
    bundle.loss = TV_LOSS_NONE;
    bundle.hold_pose = 1;
    expect_coverage(run(options, bundle, 40, true).points, 19000, kNames[g]);
  }
}

void test_points_and_pose_hold_the_truth_when_the_pose_is_estimated() {
  for (int g = 0; g < 3; ++g) {
    Options options;
    options.geometry = kGeometries[g];
    options.num = 100;
    options.seed = 1000;
    options.start_off_rad = 0.002;
    tv_bundle_options bundle;
    tv_bundle_options_init(&bundle);
    bundle.loss = TV_LOSS_NONE;
    const Counts counts = run(options, bundle, 2000, true);
    expect_coverage(counts.points, 190000, kNames[g]);
    expect_coverage(counts.pose, 2000, kNames[g]);
  }
}

void test_the_robust_pose_covariance_holds_the_truth_with_and_without_outliers() {
  for (double outlier_share : {0.0, 0.2}) {
    Options options;
    options.num = 500;
    options.outlier_share = outlier_share;
    options.seed = 10000;
    options.start_off_rad = 0.002;
    tv_bundle_options bundle;
    tv_bundle_options_init(&bundle);
    const Counts counts = run(options, bundle, 2000, false);
    expect_coverage(counts.pose, 2000, "Cauchy");
  }
}

}  // namespace

int main() {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_matches = bundle_scene::kMaxPoints;
  if (tv_context_new(&context, &limits) != TV_OK) return 1;
  UNITY_BEGIN();
  RUN_TEST(test_points_hold_the_truth_when_the_pose_is_exact);
  RUN_TEST(test_points_and_pose_hold_the_truth_when_the_pose_is_estimated);
  RUN_TEST(test_the_robust_pose_covariance_holds_the_truth_with_and_without_outliers);
  const int failures = UNITY_END();
  tv_context_free(context);
  return failures;
}
