// The covariance beyond independent noise, against references that do not use its formulas: errors
// that neighbours share (simulated), what a wrong calibration does to the pose (differences of the
// estimate itself), and a focal length that is off by its stated deviation (simulated).
// TWOVIEW_PAIRS: simulated pairs of each test, default 120. TWOVIEW_SEED selects other pairs.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "support/calls.h"
#include "support/estimator.h"
#include "support/pair_kinds.h"
#include "twoview/two_view.h"

namespace {

using scene::Vec5;
using tv::Vec3;
using Mat5 = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;

constexpr double kChiSq95 = 11.070;
tv_context* context;
pair_kinds::Pair pair;
int num_pairs = 120;
uint64_t base_seed = 1;

tv_camera pinhole() {
  tv_camera camera{};
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

// Draws a general pair of one pinhole camera, or one of a plane.
void draw(uint64_t number, double noise_px, int num, bool plane) {
  pair_kinds::Maker maker{tv::random_seeded(base_seed * 1000003 + number), {}, &pair};
  bool made = false;
  while (!made) {
    pair.num = 0;
    pair.kind = plane ? pair_kinds::kPlanar : pair_kinds::kGeneral;
    pair.noise_px = noise_px;
    for (int v = 0; v < 2; ++v) {
      pair.camera[v] = pinhole();
      maker.cameras[v] = tv::prepare_camera(pair.camera[v]);
    }
    const pair_kinds::Ranges ranges;
    maker.draw_motion(ranges);
    made = plane ? maker.put_plane(num) : maker.put_general(num, 1);
  }
}

constexpr uint32_t kRefineAll = TV_REFINE_FOCAL_LENGTH | TV_REFINE_PRINCIPAL_POINT;

tv_two_view estimate(const tv_camera& camera0, const tv_camera& camera1,
                     const tv_estimate_options& options) {
  tv_two_view r;
  tv_two_view_init(&r);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, estimate_pixels(context, &camera0, &camera1, pair.pixels[0], pair.pixels[1], nullptr,
                             pair.num, &options, &r, nullptr));
  return r;
}

tv_estimate_options defaults() {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  return options;
}

Mat5 covariance_of(const tv_two_view& r) { return Eigen::Map<const Mat5>(r.covariance); }

double distance_of(const tv_two_view& r, const Mat5& C) {
  const Vec5 e = scene::pose_error(r.R, r.t, pair.R, pair.t);
  return e.dot(C.ldlt().solve(e));
}

// Every match within the same sixteenth of image 0 shares an error of 0.2 px in image 1, of another
// direction for each sixteenth, beside 0.2 px of its own.
void test_errors_that_neighbours_share_are_in_the_covariance(void) {
  int within = 0, total = 0;
  for (int k = 0; k < num_pairs; ++k) {
    draw(static_cast<uint64_t>(k), 0.2, 300, false);
    tv::Random random = tv::random_seeded(base_seed * 77 + static_cast<uint64_t>(k));
    double shared[16][2];
    for (auto& error : shared) {
      for (double& e : error) e = 0.2 * scene::normal(&random);
    }
    for (int i = 0; i < pair.num; ++i) {
      const double* p = pair.pixels[0] + 2 * i;
      const int column = std::clamp(static_cast<int>(4 * p[0] / 640), 0, 3);
      const int row = std::clamp(static_cast<int>(4 * p[1] / 480), 0, 3);
      for (int d = 0; d < 2; ++d) pair.pixels[1][2 * i + d] += shared[4 * row + column][d];
    }
    const tv_two_view r = estimate(pair.camera[0], pair.camera[1], defaults());
    if (r.has_covariance == 0 || r.kind != TV_KIND_CALIBRATED) continue;
    ++total;
    within += distance_of(r, covariance_of(r)) <= kChiSq95;
  }
  std::printf("shared errors: truth within the ellipsoid in %d of %d\n", within, total);
  TEST_ASSERT_TRUE(10 * total > 9 * num_pairs);
  TEST_ASSERT_TRUE(within > 0.80 * total);
}

// The third power of the share of matches that are no inliers, over 0.3; at least 1.
double growth_of(const tv_two_view& r) {
  const double others = 1 - r.num_inliers / static_cast<double>(r.num_matches);
  return std::max(1.0, std::pow(others / 0.3, 3));
}

// Matches far from the pose's epipolar lines leave the pose where it is. Up to 30 per cent of them
// leave the covariance as well; with more it grows by the documented factor.
void test_the_covariance_grows_with_the_share_of_wrong_matches(void) {
  int grown = 0;
  for (int k = 0; k < 12; ++k) {
    draw(500 + static_cast<uint64_t>(k), 0.3, 120, false);
    const tv_two_view alone = estimate(pair.camera[0], pair.camera[1], defaults());
    if (alone.has_covariance == 0 || alone.kind != TV_KIND_CALIBRATED) continue;
    TEST_ASSERT_TRUE(growth_of(alone) == 1);
    tv::Random random = tv::random_seeded(base_seed * 91 + static_cast<uint64_t>(k));
    const int wrong = k % 2 == 0 ? 25 : 180;
    for (int i = 0; i < wrong;) {
      const double x = scene::uniform(&random, 0, 639), y = scene::uniform(&random, 0, 479);
      const double u = scene::uniform(&random, 0, 639), v = scene::uniform(&random, 0, 479);
      const double* F = alone.F;
      const double a = F[0] * x + F[1] * y + F[2], b = F[3] * x + F[4] * y + F[5];
      const double c = F[6] * x + F[7] * y + F[8];
      if (std::fabs(a * u + b * v + c) < 30 * std::hypot(a, b)) continue;
      const double both[2][2] = {{x, y}, {u, v}};
      for (int view = 0; view < 2; ++view) {
        for (int d = 0; d < 2; ++d) pair.pixels[view][2 * pair.num + d] = both[view][d];
      }
      ++pair.num;
      ++i;
    }
    const tv_two_view r = estimate(pair.camera[0], pair.camera[1], defaults());
    TEST_ASSERT_TRUE(r.has_covariance != 0 && r.num_inliers < 130);
    const double growth = growth_of(r);
    TEST_ASSERT_TRUE(wrong == 25 ? growth == 1 : growth > 6 && growth < 10);
    grown += growth > 1;
    for (int i = 0; i < 25; i += 6) {
      TEST_ASSERT_DOUBLE_WITHIN(0.1 * growth * alone.covariance[i], growth * alone.covariance[i],
                                r.covariance[i]);
    }
  }
  TEST_ASSERT_TRUE(grown >= 4);
}

// The covariance with one sigma less the one without it is sigma^2 g g', where g is what the
// estimate does when the camera is changed, by differences of two estimates.
void check_slopes(bool plane, bool one_camera, int parameter) {
  constexpr double kSigma = 0.01, kStep = 0.002;
  int compared = 0;
  std::vector<double> errors;
  for (int k = 0; k < 12; ++k) {
    draw(9000 + static_cast<uint64_t>(k), 0.2, 250, plane);
    tv_camera cameras[2] = {pair.camera[0], pair.camera[1]};
    // Two cameras that differ, though not in what they see.
    if (!one_camera) cameras[1].height += 1;
    tv_estimate_options options = defaults();
    const tv_two_view without = estimate(cameras[0], cameras[1], options);
    if (parameter == 0) {
      options.calibration0.focal_sigma = kSigma;
    } else {
      options.calibration0.center_sigma = kSigma;
    }
    const tv_two_view with = estimate(cameras[0], cameras[1], options);
    if (without.has_covariance == 0 || without.has_alternative != 0) continue;
    TEST_ASSERT_EQUAL_MEMORY(without.R, with.R, sizeof with.R);
    const Mat5 added = covariance_of(with) - covariance_of(without);
    Mat5 expected = Mat5::Zero();
    bool same = true;
    for (int axis = 0; axis < (parameter == 0 ? 1 : 2); ++axis) {
      tv_two_view moved[2];
      for (int side = 0; side < 2; ++side) {
        const double step = side == 0 ? -kStep : kStep;
        tv_camera changed[2] = {cameras[0], cameras[1]};
        for (int v = 0; v < (one_camera ? 2 : 1); ++v) {
          if (parameter == 0) {
            changed[v].fx *= 1 + step;
            changed[v].fy *= 1 + step;
          } else {
            (axis == 0 ? changed[v].cx : changed[v].cy) += step * cameras[v].fx;
          }
        }
        moved[side] = estimate(changed[0], changed[1], defaults());
        same = same && moved[side].kind == without.kind && moved[side].has_t != 0;
      }
      if (!same) break;
      tv::Mat3 R;
      Vec3 t;
      const auto deviation = [&](const tv_two_view& r) {
        for (int i = 0; i < 9; ++i) R(i / 3, i % 3) = r.R[i];
        for (int i = 0; i < 3; ++i) t[i] = r.t[i];
        return scene::pose_error(without.R, without.t, R, t);
      };
      const Vec5 g = (deviation(moved[1]) - deviation(moved[0])) / (2 * kStep);
      expected += kSigma * kSigma * g * g.transpose();
    }
    if (!same) continue;
    ++compared;
    errors.push_back((added - expected).norm() / expected.norm());
  }
  std::sort(errors.begin(), errors.end());
  std::printf("%s, %s, parameter %d: relative difference %.3f in the median of %d\n",
              plane ? "plane" : "general", one_camera ? "one camera" : "two cameras", parameter,
              errors.empty() ? -1.0 : errors[errors.size() / 2], compared);
  TEST_ASSERT_TRUE(compared >= 4);
  TEST_ASSERT_TRUE(errors[errors.size() / 2] < 0.1);
}

void test_a_calibrations_sigmas_propagate_as_changed_cameras_do(void) {
  for (const bool one_camera : {true, false}) {
    for (int parameter = 0; parameter < 2; ++parameter) check_slopes(false, one_camera, parameter);
  }
}

void test_a_planes_pose_follows_the_cameras_as_well(void) {
  for (const bool one_camera : {true, false}) {
    for (int parameter = 0; parameter < 2; ++parameter) check_slopes(true, one_camera, parameter);
  }
}

void test_an_uncertain_focal_length_is_refined_and_its_error_covered(void) {
  int within = 0, exact_within = 0, total = 0, refined = 0;
  std::vector<double> given_off, left_off;
  for (int k = 0; k < num_pairs; ++k) {
    draw(5000 + static_cast<uint64_t>(k), 0.3, 200, false);
    tv::Random random = tv::random_seeded(base_seed * 91 + static_cast<uint64_t>(k));
    const double off = 0.1 * scene::normal(&random);
    tv_camera camera = pair.camera[0];
    camera.fx *= std::exp(off);
    camera.fy *= std::exp(off);
    tv_estimate_options options = defaults();
    const tv_two_view exact = estimate(camera, camera, options);
    options.calibration0 = {0.1, 0.01, kRefineAll, 0};
    const tv_two_view r = estimate(camera, camera, options);
    TEST_ASSERT_TRUE(r.principal_point_shift[0] == 0 && r.principal_point_shift[1] == 0);
    if (r.verdict != TV_VERDICT_OK || r.kind != TV_KIND_CALIBRATED) continue;
    ++total;
    within += distance_of(r, covariance_of(r)) <= kChiSq95;
    exact_within +=
        exact.has_covariance != 0 && distance_of(exact, covariance_of(exact)) <= kChiSq95;
    tv_camera_pair of_result;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_corrected_pair(&r, &camera, &camera, &of_result));
    const tv_camera& corrected = of_result.camera1;
    const double scale = r.focal_scale > 0 ? r.focal_scale : 1;
    TEST_ASSERT_TRUE(corrected.fx == camera.fx * scale && corrected.fy == camera.fy * scale);
    if (r.focal_scale == 0) {
      TEST_ASSERT_TRUE(r.focal_sigma == 0.1);
      continue;
    }
    TEST_ASSERT_TRUE(r.focal_sigma >= 0.03 && r.focal_sigma <= 0.1);
    ++refined;
    given_off.push_back(std::fabs(std::log(camera.fx / 500)));
    left_off.push_back(std::fabs(std::log(corrected.fx / 500)));
  }
  std::printf("focal length: within %d of %d (taken as exact: %d), refined %d\n", within, total,
              exact_within, refined);
  TEST_ASSERT_TRUE(3 * total > num_pairs);
  TEST_ASSERT_TRUE(within > 0.85 * total);
  TEST_ASSERT_TRUE(exact_within < 0.5 * total);
  TEST_ASSERT_TRUE(2 * refined > total);
  std::sort(given_off.begin(), given_off.end());
  std::sort(left_off.begin(), left_off.end());
  TEST_ASSERT_TRUE(left_off[left_off.size() / 2] < 0.5 * given_off[given_off.size() / 2]);
}

// The focal lengths of two cameras are not refined. A pose that is "ok" is then sure of its
// rotation and direction by the covariance that it states, as any other "ok" pose is.
void test_two_uncertain_focal_lengths_count_in_the_verdict(void) {
  constexpr double kDegree = 3.14159265358979324 / 180;
  int doubtful = 0, ok = 0;
  for (int k = 0; k < 24; ++k) {
    draw(9000 + static_cast<uint64_t>(k), 0.3, 200, false);
    tv_camera other = pair.camera[0];
    other.width += 2;
    tv_estimate_options options = defaults();
    TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, estimate(pair.camera[0], other, options).verdict);
    options.calibration0 = {k < 12 ? 0.1 : 0.021, 0, kRefineAll, 0};
    options.calibration1 = options.calibration0;
    const tv_two_view r = estimate(pair.camera[0], other, options);
    TEST_ASSERT_TRUE(r.focal_scale == 0 && r.has_covariance != 0);
    const double* const c = r.covariance;
    const bool sure = std::sqrt(c[0] + c[6] + c[12]) <= 1.25 * kDegree &&
                      std::sqrt(c[18] + c[24]) <= 13.5 * kDegree;
    TEST_ASSERT_TRUE(
        sure || (r.verdict == TV_VERDICT_DOUBTFUL && (r.reasons & TV_REASON_LOW_PARALLAX) != 0));
    ++(r.verdict == TV_VERDICT_OK ? ok : doubtful);
  }
  std::printf("two uncertain focal lengths: %d doubtful, %d ok\n", doubtful, ok);
  TEST_ASSERT_TRUE(doubtful > 0 && ok > 0);
}

void test_exchanged_views_have_the_same_focal_length(void) {
  for (int k = 0; k < 12; ++k) {
    draw(7000 + static_cast<uint64_t>(k), 0.3, 150, false);
    tv_estimate_options options = defaults();
    options.calibration0.focal_sigma = 0.08;
    options.calibration1 = {0, 0.004, TV_REFINE_FOCAL_LENGTH, 0};
    const tv_two_view forward = estimate(pair.camera[0], pair.camera[0], options);
    tv_two_view back;
    tv_two_view_init(&back);
    std::swap(options.calibration0, options.calibration1);
    TEST_ASSERT_EQUAL_INT(
        TV_OK, estimate_pixels(context, &pair.camera[0], &pair.camera[0], pair.pixels[1],
                               pair.pixels[0], nullptr, pair.num, &options, &back, nullptr));
    for (int i = 0; i < 9; ++i) TEST_ASSERT_TRUE(forward.R[i] == back.R[3 * (i % 3) + i / 3]);
    TEST_ASSERT_TRUE(forward.focal_scale == back.focal_scale);
    TEST_ASSERT_TRUE(forward.focal_sigma == back.focal_sigma);
    TEST_ASSERT_EQUAL_INT(forward.verdict, back.verdict);
  }
}

// Without the bit of the focal length nothing of the camera is refined: the pose is that of an
// exact camera, and its covariance and verdict contain how uncertain the focal length is.
void test_what_may_not_be_refined_stays_and_counts(void) {
  int doubtful = 0;
  for (int k = 0; k < 12; ++k) {
    draw(5000 + static_cast<uint64_t>(k), 0.3, 200, false);
    tv_estimate_options options = defaults();
    const tv_two_view exact = estimate(pair.camera[0], pair.camera[0], options);
    options.calibration1 = {0.1, 0.01, TV_REFINE_PRINCIPAL_POINT, 0};
    const tv_two_view r = estimate(pair.camera[0], pair.camera[0], options);
    TEST_ASSERT_TRUE(r.focal_scale == 0 && r.focal_sigma == 0.1);
    TEST_ASSERT_TRUE(r.principal_point_shift[0] == 0 && r.principal_point_shift[1] == 0);
    TEST_ASSERT_EQUAL_MEMORY(exact.R, r.R, sizeof r.R);
    TEST_ASSERT_EQUAL_MEMORY(exact.t, r.t, sizeof r.t);
    for (int i = 0; i < 25; i += 6) TEST_ASSERT_TRUE(r.covariance[i] > exact.covariance[i]);
    doubtful += exact.verdict == TV_VERDICT_OK && r.verdict != TV_VERDICT_OK;
  }
  TEST_ASSERT_TRUE(doubtful > 0);
}

// The principal point's deviation counts once: as it is given where the point stays, else what the
// matches leave of it, which is less.
void test_the_principal_points_sigma_counts_once(void) {
  int stayed = 0, moved = 0;
  for (int k = 0; k < 24; ++k) {
    draw(7300 + static_cast<uint64_t>(k), 0.2, 250, false);
    tv_camera camera = pair.camera[0];
    if (k % 2 == 1) camera.cx += 0.03 * camera.fx;
    tv_estimate_options options = defaults();
    options.calibration0.center_sigma = 0.01;
    const tv_two_view kept = estimate(camera, camera, options);
    options.calibration0.refine = TV_REFINE_PRINCIPAL_POINT;
    const tv_two_view r = estimate(camera, camera, options);
    if (kept.has_covariance == 0 || r.has_covariance == 0) continue;
    if (r.principal_point_shift[0] == 0 && r.principal_point_shift[1] == 0) {
      TEST_ASSERT_EQUAL_MEMORY(&kept, &r, sizeof r);
      ++stayed;
    } else {
      TEST_ASSERT_TRUE(covariance_of(r).trace() < covariance_of(kept).trace());
      ++moved;
    }
  }
  std::printf("principal point: %d stayed, %d moved\n", stayed, moved);
  TEST_ASSERT_TRUE(stayed >= 4 && moved >= 4);
}

}  // namespace

void setUp(void) { context = estimator::make_context(pair_kinds::kMaxMatches); }

void tearDown(void) {}

int main(void) {
  estimator::read_environment(1, &num_pairs, &base_seed);
  UNITY_BEGIN();
  RUN_TEST(test_errors_that_neighbours_share_are_in_the_covariance);
  RUN_TEST(test_the_covariance_grows_with_the_share_of_wrong_matches);
  RUN_TEST(test_a_calibrations_sigmas_propagate_as_changed_cameras_do);
  RUN_TEST(test_a_planes_pose_follows_the_cameras_as_well);
  RUN_TEST(test_an_uncertain_focal_length_is_refined_and_its_error_covered);
  RUN_TEST(test_two_uncertain_focal_lengths_count_in_the_verdict);
  RUN_TEST(test_exchanged_views_have_the_same_focal_length);
  RUN_TEST(test_what_may_not_be_refined_stays_and_counts);
  RUN_TEST(test_the_principal_points_sigma_counts_once);
  return UNITY_END();
}
