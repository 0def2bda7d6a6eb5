// The kind that tv_estimate_two_view reports, for many synthetic pairs, lenses and hostile inputs.
// TWOVIEW_SEED selects other pairs.
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "robust/covariance.h"
#include "support/calls.h"
#include "support/estimator.h"
#include "support/sanitized.h"
#include "support/scene.h"
#include "twoview/two_view.h"

namespace {

using scene::Kind;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr int kCapMatches = 4000, kTrials = kSanitized ? 2 : 20;
tv_context* context;
scene::Scene pair;
uint8_t mask[kCapMatches];
uint64_t base_seed = 1000;

tv_estimate_options defaults(int method) {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  options.method = method;
  options.max_iterations = 3000;
  return options;
}

EstimatedPair estimate(const tv_camera* cameras, const double* pixels0, const double* pixels1,
                       const float* ratios, int num, const tv_estimate_options& options) {
  EstimatedPair result;
  tv_two_view_init_sized(&result, sizeof(tv_two_view));
  const tv_camera* second = cameras == nullptr ? nullptr : cameras + 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_evidence(context, cameras, second, pixels0, pixels1, ratios,
                                                 num, &options, &result, &result.evidence, mask));
  const double* arrays[] = {result.R,
                            result.t,
                            result.E,
                            result.F,
                            result.H,
                            result.alternative_R,
                            result.alternative_t,
                            result.covariance};
  const int sizes[] = {9, 3, 9, 9, 9, 9, 3, 25};
  double sum = result.evidence.coverage + result.median_parallax_rad + result.rms_error_px;
  for (int a = 0; a < 8; ++a) {
    for (int k = 0; k < sizes[a]; ++k) sum += arrays[a][k];
  }
  TEST_ASSERT_TRUE(std::isfinite(sum));
  int inliers = 0;
  for (int i = 0; i < num; ++i) inliers += mask[i];
  TEST_ASSERT_EQUAL_INT(result.num_inliers, inliers);
  TEST_ASSERT_TRUE(result.evidence.coverage >= 0 && result.evidence.coverage <= 1);
  return result;
}

EstimatedPair estimate_pair(bool calibrated, int method) {
  return estimate(calibrated ? pair.options.camera : nullptr, pair.pixels[0], pair.pixels[1],
                  pair.ratios, pair.options.num, defaults(method));
}

scene::Options options_of(Kind kind, int num, double inlier_share, uint64_t seed) {
  scene::Options options;
  options.kind = kind;
  options.num = num;
  options.inlier_share = inlier_share;
  options.seed = base_seed + seed;
  return options;
}

// The kind must be right for nine pairs in ten, over shares of inliers and noise up to half the
// threshold.
void test_config_names_the_kind_of_pair(void) {
  const Kind kinds[5] = {Kind::kGeneral, Kind::kForward, Kind::kPlanar, Kind::kRotation,
                         Kind::kStill};
  const int configs[2][5] = {
      {TV_KIND_UNCALIBRATED, TV_KIND_UNCALIBRATED, TV_KIND_PLANAR_OR_PANORAMIC,
       TV_KIND_PLANAR_OR_PANORAMIC, TV_KIND_NO_MOTION},
      {TV_KIND_CALIBRATED, TV_KIND_CALIBRATED, TV_KIND_PLANAR, TV_KIND_PANORAMIC,
       TV_KIND_NO_MOTION}};
  for (int calibrated = 0; calibrated < 2; ++calibrated) {
    for (int k = 0; k < 5; ++k) {
      int right = 0;
      for (int trial = 0; trial < kTrials; ++trial) {
        scene::Options options =
            options_of(kinds[k], 300, trial % 2 == 0 ? 0.6 : 0.9, 20 * k + trial);
        options.noise_px = trial % 4 < 2 ? 0.2 : 0.5;
        scene::make(options, &pair);
        const EstimatedPair r = estimate_pair(
            calibrated == 1, calibrated == 1 ? TV_SOLVER_FIVE_POINT : TV_SOLVER_SEVEN_POINT);
        right += r.kind == configs[calibrated][k];
      }
      TEST_ASSERT_TRUE(kSanitized || 10 * right >= 9 * kTrials);
    }
  }
}

void test_each_kind_has_what_it_promises(void) {
  for (Kind kind : {Kind::kGeneral, Kind::kPlanar, Kind::kRotation, Kind::kStill}) {
    scene::make(options_of(kind, 300, 0.7, 200), &pair);
    for (int calibrated = 0; calibrated < 2; ++calibrated) {
      const EstimatedPair r = estimate_pair(
          calibrated == 1, calibrated == 1 ? TV_SOLVER_FIVE_POINT : TV_SOLVER_SEVEN_POINT);
      const bool full = r.kind == TV_KIND_CALIBRATED || r.kind == TV_KIND_PLANAR;
      const bool rotation =
          calibrated == 1 && (r.kind == TV_KIND_PANORAMIC || r.kind == TV_KIND_NO_MOTION);
      TEST_ASSERT_EQUAL_INT(full || rotation, r.has_R);
      TEST_ASSERT_EQUAL_INT(full, r.has_t);
      TEST_ASSERT_EQUAL_INT(full, r.has_E);
      TEST_ASSERT_EQUAL_INT(full || r.kind == TV_KIND_UNCALIBRATED, r.has_F);
      TEST_ASSERT_EQUAL_INT(r.kind == TV_KIND_PLANAR || r.kind == TV_KIND_PLANAR_OR_PANORAMIC,
                            r.has_H);
      TEST_ASSERT_EQUAL_INT(r.verdict != TV_VERDICT_OK, r.reasons != 0);
      TEST_ASSERT_EQUAL_INT(calibrated == 1 ? -1 : 0, r.evidence.fundamental_inliers < 0 ? -1 : 0);
      if (rotation) {
        TEST_ASSERT_TRUE(scene::rotation_error_deg(r.R, pair.R) < 0.2);
        TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, r.verdict);
      }
    }
  }
}

// The test against chance accepts random matches with a probability of at most 0.01. Each of 72
// pairs is estimated by three solvers; three of these 216 estimates may be accepted.
void test_random_matches_are_degenerate(void) {
  const int num[9] = {5, 6, 7, 8, 10, 20, 50, 100, 500};
  const int methods[3] = {TV_SOLVER_FIVE_POINT, TV_SOLVER_SEVEN_POINT, TV_SOLVER_EIGHT_POINT};
  int accepted = 0;
  for (int k = 0; k < 9; ++k) {
    for (int trial = 0; trial < 8; ++trial) {
      scene::make(options_of(Kind::kGeneral, num[k], 0, 300 + 20 * k + trial), &pair);
      for (int m = 0; m < 3; ++m) {
        const EstimatedPair r = estimate_pair(m == 0 || trial % 2 == 0, methods[m]);
        accepted += r.kind != TV_KIND_DEGENERATE;
        TEST_ASSERT_EQUAL_INT(r.kind == TV_KIND_DEGENERATE, r.verdict == TV_VERDICT_REFUSED);
        TEST_ASSERT_EQUAL_INT(r.kind == TV_KIND_DEGENERATE, r.num_inliers == 0);
      }
    }
  }
  TEST_ASSERT_LESS_OR_EQUAL_INT(3, accepted);
}

void test_every_pair_of_lenses_gives_the_pose(void) {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      double sum = 0;
      for (int trial = 0; trial < 4; ++trial) {
        scene::Options options =
            options_of(Kind::kGeneral, 400, 0.6, 500 + 10 * (3 * a + b) + trial);
        options.camera[0] = lenses[a];
        options.camera[1] = lenses[b];
        scene::make(options, &pair);
        const EstimatedPair r = estimate_pair(true, TV_SOLVER_FIVE_POINT);
        TEST_ASSERT_EQUAL_INT(TV_KIND_CALIBRATED, r.kind);
        sum += std::fmax(scene::rotation_error_deg(r.R, pair.R),
                         scene::translation_error_deg(r.t, pair.t));
      }
      TEST_ASSERT_TRUE(sum / 4 < 1);
    }
  }
}

void test_degenerate_points_end_and_give_no_pose(void) {
  static double a[2000], b[2000];
  const tv_camera lenses[3][2] = {{scene::pinhole(), scene::pinhole()},
                                  {scene::distorted(), scene::distorted()},
                                  {scene::fisheye(), scene::fisheye()}};
  tv::Random random = tv::random_seeded(base_seed);
  for (int kind = 0; kind < 7; ++kind) {
    for (int i = 0; i < 1000; ++i) {
      const double x = scene::uniform(&random, 0, 600), y = scene::uniform(&random, 0, 470);
      double p[4] = {x, y, x, y};                          // kind 0: the same image twice
      if (kind == 1) p[0] = p[1] = p[2] = p[3] = 100;      // all matches are one point
      if (kind == 2) p[1] = p[3] = 0.5 * x, p[2] = x + 3;  // pixels on a line, moved by 3 px
      if (kind == 3) p[1] = p[3] = 7, p[2] = 600 - x;      // pixels on a line, in reverse order
      // all matches have the same pixel in view 0
      if (kind == 4) p[0] = p[1] = 10;
      // eight different matches, each repeated many times
      if (kind == 5) p[0] = i % 4 * 50, p[1] = p[3] = i % 2, p[2] = p[0] + 4;
      if (kind == 6) p[2] = x + 2;  // all pixels move by 2 px: a plane, or far points
      for (int k = 0; k < 2; ++k) a[2 * i + k] = p[k], b[2 * i + k] = p[2 + k];
    }
    for (int c = 0; c < 3; ++c) {
      const EstimatedPair r =
          estimate(lenses[c], a, b, nullptr, 1000, defaults(TV_SOLVER_FIVE_POINT));
      if (kind == 0 || kind == 1 || kind == 4 || kind == 5) {
        TEST_ASSERT_EQUAL_INT(0, r.has_t);
      }
    }
    estimate(nullptr, a, b, nullptr, 1000, defaults(TV_SOLVER_EIGHT_POINT));
    estimate(nullptr, a, b, nullptr, 1000, defaults(TV_SOLVER_SEVEN_POINT));
  }
}

// Over scenes with fresh noise, more than seven true poses in ten must lie within the 90 %
// ellipsoid of the estimate's covariance.
void test_covariance_covers_the_error(void) {
  using Mat5 = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;
  int inside = 0, total = 0;
  for (int trial = 0; trial < 3 * kTrials; ++trial) {
    scene::Options options = options_of(Kind::kGeneral, 200, 1, 600 + trial);
    options.noise_px = 0.3;
    scene::make(options, &pair);
    const EstimatedPair r = estimate_pair(true, TV_SOLVER_FIVE_POINT);
    if (r.kind != TV_KIND_CALIBRATED) continue;
    TEST_ASSERT_EQUAL_INT(1, r.has_covariance);
    const tv::Mat3 d = pair.R * tv::Mat3(Eigen::Map<const tv::Mat3>(r.R)).transpose();
    const tv::Vec3 t(r.t[0], r.t[1], r.t[2]);
    tv::Vec3 b1, b2;
    tv::tangent_basis(t, &b1, &b2);
    Eigen::Matrix<double, 5, 1> e;
    e << 0.5 * (d(2, 1) - d(1, 2)), 0.5 * (d(0, 2) - d(2, 0)), 0.5 * (d(1, 0) - d(0, 1)),
        b1.dot(pair.t) / t.dot(pair.t), b2.dot(pair.t) / t.dot(pair.t);
    const Mat5 information = Mat5(Eigen::Map<const Mat5>(r.covariance)).inverse();
    inside += e.dot(information * e) < 9.236;  // 90 per cent quantile of chi-square with 5 dof
    ++total;
  }
  if (kSanitized) return;
  TEST_ASSERT_GREATER_THAN_INT(50, total);
  TEST_ASSERT_GREATER_THAN_INT(7 * total / 10, inside);
}

// A smooth error of the second picture's pixels, as of a wrong lens, moves the pose by more than
// the noise tells, and wrong matches add to it: the direction's standard deviation in the result
// decides, not that of the noise alone. Above 13.5 degrees the parallax is low.
void test_a_direction_that_is_stated_to_be_uncertain_is_low_parallax(void) {
  int uncertain = 0;
  for (int trial = 0; trial < (kSanitized ? 15 : 150); ++trial) {
    scene::Options options = options_of(Kind::kGeneral, 200, 0.2, 800 + trial);
    options.noise_px = 0.1;
    scene::make(options, &pair);
    for (int i = 0; i < options.num; ++i) {
      double* const pixel = pair.pixels[1] + 2 * i;
      const double x = pixel[0] / 60, y = pixel[1] / 60;
      pixel[0] += 1.6 * std::sin(x);
      pixel[1] += 1.6 * std::cos(y + x / 1.5);
    }
    const EstimatedPair r = estimate_pair(true, TV_SOLVER_FIVE_POINT);
    if (r.has_covariance == 0) continue;
    const tv::Vec3 t(r.t[0], r.t[1], r.t[2]);
    if (!(tv::direction_sigma(t, r.covariance) > 13.5 * tv::kPi / 180)) continue;
    TEST_ASSERT_TRUE((r.reasons & TV_REASON_LOW_PARALLAX) != 0);
    ++uncertain;
  }
  TEST_ASSERT_TRUE(kSanitized || uncertain >= 5);
}

// Posts that stand a period apart in rows along x, and the camera moves along the rows. Puts count
// matches into pair, from `first` on: each of a post and its image after a step of `periods`.
void put_posts(int first, int count, double periods, const Mat3& R, tv::Random* random) {
  const tv::Camera camera = tv::prepare_camera(pair.options.camera[0]);
  for (int i = first; i < first + count;) {
    const Vec2 p0 = scene::random_pixel(random, pair.options.camera[0]);
    Vec3 X;
    if (!tv::unproject(camera, p0, &X, nullptr)) continue;
    X *= scene::uniform(random, 4, 10) / X[2];
    Vec2 p1;
    if (!tv::project(camera, R * (X - periods * Vec3(1, 0, 0)), &p1, nullptr)) continue;
    for (int k = 0; k < 2; ++k) {
      pair.pixels[0][2 * i + k] = p0[k] + 0.3 * scene::normal(random);
      pair.pixels[1][2 * i + k] = p1[k] + 0.3 * scene::normal(random);
    }
    ++i;
  }
}

// A step of three quarters of a period looks like one of a quarter the other way, if most posts
// are matched with the next one. The few that are matched with themselves show it.
void test_matches_that_ask_for_the_opposite_direction_are_repeated_structure(void) {
  constexpr int kCopies = 80, kSame = 12;
  const tv_estimate_options options = defaults(TV_SOLVER_FIVE_POINT);
  for (int trial = 0; trial < 20; ++trial) {
    tv::Random random = tv::random_seeded(base_seed + 700 + trial);
    const Mat3 R = scene::rotation(&random, 0, 0.1);
    pair.options.camera[0] = pair.options.camera[1] = scene::pinhole();
    put_posts(0, kCopies, -0.25, R, &random);
    put_posts(kCopies, kSame, 0.75, R, &random);
    // The same pose without the posts that are matched with themselves: nothing contradicts it.
    for (int num : {kCopies, kCopies + kSame}) {
      const EstimatedPair r =
          estimate(pair.options.camera, pair.pixels[0], pair.pixels[1], nullptr, num, options);
      TEST_ASSERT_TRUE(Eigen::Map<const Vec3>(r.t).dot(R * Vec3(1, 0, 0)) > 0);
      TEST_ASSERT_EQUAL_HEX32(num == kCopies ? 0 : TV_REASON_REPEATED_STRUCTURE, r.reasons);
    }
    // A few wrong matches of small parallax behind the cameras do not: noise alone can make them.
    put_posts(kCopies, kSame, 0.3, R, &random);
    const EstimatedPair r = estimate(pair.options.camera, pair.pixels[0], pair.pixels[1], nullptr,
                                     kCopies + kSame, options);
    TEST_ASSERT_EQUAL_HEX32(0, r.reasons);
  }
}

}  // namespace

void setUp(void) { context = estimator::make_context(kCapMatches); }

void tearDown(void) {}

int main(void) {
  const char* seed = std::getenv("TWOVIEW_SEED");
  if (seed != nullptr) base_seed = std::strtoull(seed, nullptr, 10);
  std::printf("TWOVIEW_SEED=%llu\n", static_cast<unsigned long long>(base_seed));
  UNITY_BEGIN();
  RUN_TEST(test_config_names_the_kind_of_pair);
  RUN_TEST(test_each_kind_has_what_it_promises);
  RUN_TEST(test_random_matches_are_degenerate);
  RUN_TEST(test_every_pair_of_lenses_gives_the_pose);
  RUN_TEST(test_degenerate_points_end_and_give_no_pose);
  RUN_TEST(test_covariance_covers_the_error);
  RUN_TEST(test_a_direction_that_is_stated_to_be_uncertain_is_low_parallax);
  RUN_TEST(test_matches_that_ask_for_the_opposite_direction_are_repeated_structure);
  return UNITY_END();
}
