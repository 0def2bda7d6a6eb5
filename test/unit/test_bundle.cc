// The parts of two-view bundle adjustment: derivatives against finite differences, the elimination
// against the plain normal equations, points at and beyond infinity, points that cannot take part.
#include <Eigen/Dense>
#include <cstring>

#include "robust/bundle_match.h"
#include "support/bundle_scene.h"
#include "support/calls.h"
#include "twoview/alloc.h"

using bundle_scene::Geometry;
using bundle_scene::Options;
using bundle_scene::Scene;
using tv::BundleFrame;
using tv::BundleMatch;
using tv::BundlePoint;
using tv::Elimination;
using tv::Mat3;
using tv::Pose;
using tv::Vec2;
using tv::Vec3;

static Scene pair;
static tv_point points[bundle_scene::kMaxPoints];
static double R[9], t[3];
static tv_context* context;
static tv_bundle_result result;
static uint64_t seed;

void setUp() { seed = 0; }
void tearDown() {
  if (Unity.CurrentTestFailed) std::printf("seed %d\n", static_cast<int>(seed));
}

namespace {

tv_bundle_options options_of(tv_loss loss) {
  tv_bundle_options options;
  tv_bundle_options_init(&options);
  options.loss = loss;
  return options;
}

void begin() {
  std::memcpy(R, pair.start_R, sizeof R);
  std::memcpy(t, pair.start_t, sizeof t);
  std::memcpy(points, pair.start, sizeof points);
  tv_bundle_result_init(&result);
}

tv_status adjust(const tv_bundle_options& bundle) {
  tv_camera_pair cameras = pair_of(&pair.options.camera[0], &pair.options.camera[1], R, t);
  const tv_status status = adjust_pixels(context, pair.pixels[0], pair.pixels[1], pair.options.num,
                                         &bundle, &cameras, points, &result);
  std::memcpy(R, cameras.cam1_from_cam0_R, sizeof R);
  std::memcpy(t, cameras.cam1_from_cam0_t, sizeof t);
  return status;
}

// ---- tests of one match ----

struct OneMatch {
  tv::Camera cameras[2];
  Pose pose;
  BundlePoint point;
  Vec2 pixel[2];
};

// Pixels that differ by a few pixels from the point's projections.
OneMatch random_match(const tv_camera& first, const tv_camera& second) {
  tv::Random random = tv::random_seeded(++seed);
  OneMatch m{{tv::prepare_camera(first), tv::prepare_camera(second)}, Pose{}, {}, {}};
  for (;;) {
    const Vec3 axis = scene::direction(&random);
    m.pose.R = tv::rotation_about(axis, scene::uniform(&random, 0, 0.3));
    m.pose.t = scene::direction(&random);
    Vec3 ray;
    if (!tv::unproject(m.cameras[0], scene::random_pixel(&random, first), &ray, nullptr)) continue;
    for (int i = 0; i < 3; ++i) m.point.direction[i] = ray[i];
    m.point.inverse_distance = scene::uniform(&random, -0.1, 0.6);
    const Vec3 moved = m.pose.R * ray + m.point.inverse_distance * m.pose.t;
    if (!tv::project(m.cameras[0], ray, &m.pixel[0], nullptr) ||
        !tv::project(m.cameras[1], moved, &m.pixel[1], nullptr)) {
      continue;
    }
    for (Vec2& pixel : m.pixel) pixel = bundle_scene::noisy(&random, pixel, 2);
    return m;
  }
}

using Vec4 = Eigen::Matrix<double, 4, 1>;

// The four residuals after a step of the point (two parameters along sphere_basis, and the inverse
// distance) and of the pose.
Vec4 residuals(const OneMatch& m, const double point_step[3], const double pose_step[5]) {
  const BundleFrame frame = tv::bundle_frame(m.pose);
  double e1[3], e2[3];
  tv::sphere_basis(m.point.direction, e1, e2);
  Vec3 d;
  for (int i = 0; i < 3; ++i) {
    d[i] = m.point.direction[i] + point_step[0] * e1[i] + point_step[1] * e2[i];
  }
  const double rho = (m.point.inverse_distance + point_step[2]) / d.norm();
  d.normalize();
  const Vec3 w(pose_step[0], pose_step[1], pose_step[2]);
  const Mat3 turned =
      w.norm() > 0 ? Mat3(tv::rotation_about(w.normalized(), w.norm()) * m.pose.R) : m.pose.R;
  const Vec3 moved_t = (m.pose.t + pose_step[3] * frame.b1 + pose_step[4] * frame.b2).normalized();
  Vec2 seen[2];
  TEST_ASSERT_TRUE(tv::project(m.cameras[0], d, &seen[0], nullptr));
  TEST_ASSERT_TRUE(tv::project(m.cameras[1], turned * d + rho * moved_t, &seen[1], nullptr));
  Vec4 e;
  e << seen[0] - m.pixel[0], seen[1] - m.pixel[1];
  return e;
}

struct Derivatives {
  Vec4 error;
  Eigen::Matrix<double, 4, 3> point;
  Eigen::Matrix<double, 4, 5> pose;
};

// The Jacobian of the residuals of one match, by central differences.
Derivatives derivatives(const OneMatch& m) {
  const double zero3[3] = {}, zero5[5] = {}, h = 1e-6;
  Derivatives d;
  d.error = residuals(m, zero3, zero5);
  for (int k = 0; k < 8; ++k) {
    double plus3[3] = {}, plus5[5] = {}, minus3[3] = {}, minus5[5] = {};
    (k < 3 ? plus3[k] : plus5[k - 3]) = h;
    (k < 3 ? minus3[k] : minus5[k - 3]) = -h;
    const Vec4 slope = (residuals(m, plus3, plus5) - residuals(m, minus3, minus5)) / (2 * h);
    if (k < 3) {
      d.point.col(k) = slope;
    } else {
      d.pose.col(k - 3) = slope;
    }
  }
  return d;
}

void for_random_matches(void (*check)(const OneMatch&)) {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (const tv_camera& first : lenses) {
    for (const tv_camera& second : lenses) {
      for (int k = 0; k < 100; ++k) check(random_match(first, second));
    }
  }
}

BundleMatch linearised(const OneMatch& m) {
  BundleMatch match;
  TEST_ASSERT_TRUE(
      tv::linearise(m.cameras, tv::bundle_frame(m.pose), m.point, m.pixel[0], m.pixel[1], &match));
  return match;
}

void check_derivatives(const OneMatch& m) {
  const Derivatives d = derivatives(m);
  const BundleMatch match = linearised(m);
  const Elimination e = tv::eliminate(tv::bundle_frame(m.pose), match);
  const double tolerance = 1e-6 * (d.point.norm() + d.pose.norm());
  Eigen::Matrix2d from_pixel0;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      from_pixel0(i, j) = match.from_pixel0[i][j];
      TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 + d.point.norm()), d.error[2 * i + j], match.error[i][j]);
      TEST_ASSERT_DOUBLE_WITHIN(tolerance, d.point(2 + i, j), e.B[i][j]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, d.point(2 + i, 2), e.along[i] * e.length);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0, d.point(i, 2));
  }
  const Eigen::Matrix2d product = from_pixel0 * d.point.topLeftCorner<2, 2>();
  TEST_ASSERT_TRUE((product - Eigen::Matrix2d::Identity()).norm() < 1e-6);
}

void test_derivatives_agree_with_differences() { for_random_matches(check_derivatives); }

// Eliminating the point leaves one equation (a, r) of a match. It must be the match's four
// equations times n, the direction that is orthogonal to the point's derivatives P. With S the
// pose's derivatives: S' (I - P (P'P)^-1 P') S = a a', and the same for the gradient and the error.
void check_elimination(const OneMatch& m) {
  const Derivatives d = derivatives(m);
  const Elimination e = tv::eliminate(tv::bundle_frame(m.pose), linearised(m));
  const Eigen::HouseholderQR<Eigen::Matrix<double, 4, 3>> qr(d.point);
  const Eigen::Matrix4d Q = qr.householderQ();
  const Vec4 n = Q.col(3);  // no step of the point moves the residuals along n
  Eigen::Matrix<double, 5, 1> a;
  for (int k = 0; k < 5; ++k) a[k] = e.a[k];
  const Eigen::Matrix<double, 5, 1> expected = d.pose.transpose() * n;
  const double sign = expected.dot(a) < 0 ? -1 : 1;
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, sign * n.dot(d.error), e.r);
  TEST_ASSERT_TRUE((sign * expected - a).norm() < 1e-5 * (1 + d.pose.norm()));
}

void test_eliminating_a_point_leaves_what_qr_leaves() { for_random_matches(check_elimination); }

void test_the_basis_of_the_sphere_is_orthonormal() {
  tv::Random random = tv::random_seeded(5);
  for (int k = 0; k < 1000; ++k) {
    Vec3 d = scene::direction(&random);
    if (k < 6) d = (k % 2 == 0 ? 1 : -1) * Vec3::Unit(k / 2);
    double e1[3], e2[3];
    tv::sphere_basis(d.data(), e1, e2);
    Mat3 B;
    for (int i = 0; i < 3; ++i) B(0, i) = d[i], B(1, i) = e1[i], B(2, i) = e2[i];
    TEST_ASSERT_TRUE((B * B.transpose() - Mat3::Identity()).norm() < 1e-14);
  }
}

// ---- tests of whole pairs of images ----

void test_exact_pixels_give_the_exact_pose_and_points() {
  for (Geometry geometry : {Geometry::kGeneral, Geometry::kSideways, Geometry::kForward}) {
    Options options;
    options.geometry = geometry;
    options.noise_px = 0;
    options.baseline = 2.5;
    options.seed = ++seed;
    bundle_scene::make(options, &pair);
    begin();
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_CAUCHY)));
    TEST_ASSERT_TRUE(result.converged);
    TEST_ASSERT_TRUE(result.rms_px < 1e-8);
    TEST_ASSERT_TRUE(scene::rotation_error_deg(R, pair.R) < 1e-8);
    TEST_ASSERT_TRUE(scene::translation_error_deg(t, pair.t) < 1e-7);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2.5, Vec3(t[0], t[1], t[2]).norm());
    for (int i = 0; i < options.num; ++i) {
      if (pair.start[i].status != TV_POINT_OK) continue;
      TEST_ASSERT_EQUAL_INT(TV_POINT_OK, points[i].status);
      const Vec3 X(points[i].position[0], points[i].position[1], points[i].position[2]);
      TEST_ASSERT_TRUE((X - pair.truth[i]).norm() < 1e-4);
      TEST_ASSERT_TRUE(points[i].error_px < 1e-6f);
    }
  }
}

void test_the_cost_never_rises_and_the_answer_is_closer() {
  for (int k = 0; k < 30; ++k) {
    Options options;
    options.num = 60;
    options.outlier_share = 0.2;
    options.seed = ++seed;
    bundle_scene::make(options, &pair);
    begin();
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_CAUCHY)));
    TEST_ASSERT_TRUE(result.final_cost <= result.initial_cost);
    TEST_ASSERT_TRUE(scene::rotation_error_deg(R, pair.R) <
                     scene::rotation_error_deg(pair.start_R, pair.R));
  }
}

// Half of the points are at infinity, so that noise decides whether their two rays converge or
// diverge (meet behind the cameras).
void test_points_at_and_beyond_infinity_take_part() {
  Options options;
  options.seed = ++seed;
  bundle_scene::make(options, &pair);
  tv::Random random = tv::random_seeded(9);
  const tv::Camera camera = tv::prepare_camera(options.camera[0]);
  for (int i = 0; i < options.num; i += 2) {
    Vec2 p0, p1;
    TEST_ASSERT_TRUE(tv::project(camera, pair.truth[i], &p0, nullptr));
    TEST_ASSERT_TRUE(tv::project(camera, pair.R * pair.truth[i], &p1, nullptr));
    p1 = bundle_scene::noisy(&random, p1, 0.5);
    for (int k = 0; k < 2; ++k) {
      pair.pixels[0][2 * i + k] = p0[k];
      pair.pixels[1][2 * i + k] = p1[k];
    }
  }
  bundle_scene::triangulate(options, &pair);
  for (int i = 0; i < options.num; i += 2) {
    pair.start[i] = tv_point{};
    const Vec3 d = pair.truth[i].normalized();
    for (int k = 0; k < 3; ++k) pair.start[i].position[k] = d[k];
    pair.start[i].status = TV_POINT_INFINITE;
  }
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_NONE)));
  TEST_ASSERT_TRUE(result.converged);
  TEST_ASSERT_TRUE(result.num_points >= 480);
  TEST_ASSERT_TRUE(scene::rotation_error_deg(R, pair.R) < 0.05);
  int ahead = 0, beyond = 0;
  for (int i = 0; i < options.num; i += 2) {
    ahead += points[i].status == TV_POINT_OK;
    beyond += points[i].status == TV_POINT_BEHIND;
    TEST_ASSERT_TRUE(points[i].error_px < 3);
    for (double x : points[i].position) TEST_ASSERT_TRUE(x - x == 0);
  }
  TEST_ASSERT_TRUE(ahead > 50);
  TEST_ASSERT_TRUE(beyond > 50);
}

void test_nothing_but_infinity_leaves_the_translation_where_it_is() {
  Options options;
  options.noise_px = 0;
  options.seed = ++seed;
  bundle_scene::make(options, &pair);
  const tv::Camera camera = tv::prepare_camera(options.camera[0]);
  for (int i = 0; i < options.num; ++i) {
    Vec2 p0, p1;
    TEST_ASSERT_TRUE(tv::project(camera, pair.truth[i], &p0, nullptr));
    if (!tv::project(camera, pair.R * pair.truth[i], &p1, nullptr)) p1 = p0;
    for (int k = 0; k < 2; ++k) {
      pair.pixels[0][2 * i + k] = p0[k];
      pair.pixels[1][2 * i + k] = p1[k];
    }
    const Vec3 d = pair.truth[i].normalized();
    pair.start[i] = tv_point{};
    for (int k = 0; k < 3; ++k) pair.start[i].position[k] = d[k];
    pair.start[i].status = TV_POINT_INFINITE;
  }
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_NONE)));
  TEST_ASSERT_TRUE(scene::rotation_error_deg(R, pair.R) < 0.01);
  for (int k = 0; k < 3; ++k) TEST_ASSERT_TRUE(t[k] - t[k] == 0);
  TEST_ASSERT_TRUE(result.rms_px < 0.05);
}

void test_holding_the_pose_gives_each_point_its_least_error() {
  Options options;
  options.noise_px = 2;
  options.start_off_rad = 0;
  options.seed = ++seed;
  bundle_scene::make(options, &pair);
  tv_bundle_options hold = options_of(TV_LOSS_NONE);
  hold.hold_pose = 1;
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(hold));
  TEST_ASSERT_TRUE(result.converged);
  TEST_ASSERT_FALSE(result.has_covariance);
  TEST_ASSERT_EQUAL_MEMORY(pair.start_R, R, sizeof R);
  TEST_ASSERT_EQUAL_MEMORY(pair.start_t, t, sizeof t);
  const tv::Camera cameras[2] = {tv::prepare_camera(options.camera[0]),
                                 tv::prepare_camera(options.camera[1])};
  tv::Random random = tv::random_seeded(3);
  for (int i = 0; i < options.num; ++i) {
    if (points[i].status != TV_POINT_OK) continue;
    TEST_ASSERT_TRUE(points[i].error_px <= pair.start[i].error_px + 1e-6f);
    const Vec3 X(points[i].position[0], points[i].position[1], points[i].position[2]);
    for (int trial = 0; trial < 10; ++trial) {  // nearby points must have larger errors
      const Vec3 other = X + 1e-4 * X.norm() * scene::direction(&random);
      Vec2 p[2];
      TEST_ASSERT_TRUE(tv::project(cameras[0], other, &p[0], nullptr));
      TEST_ASSERT_TRUE(tv::project(cameras[1], pair.R * other + pair.t, &p[1], nullptr));
      double sum = 0;
      for (int v = 0; v < 2; ++v) {
        for (int k = 0; k < 2; ++k) {
          const double e = p[v][k] - pair.pixels[v][2 * i + k];
          sum += e * e;
        }
      }
      TEST_ASSERT_TRUE(std::sqrt(sum / 2) >= points[i].error_px - 1e-6);
    }
  }
}

void test_points_that_cannot_take_part_are_left_alone() {
  Options options;
  options.num = 40;
  options.seed = ++seed;
  bundle_scene::make(options, &pair);
  pair.start[0].status = TV_POINT_INVALID;
  pair.start[1].status = TV_POINT_BEHIND;
  pair.start[2].status = 77;
  pair.start[3].position[1] = NAN;
  pair.start[4].position[0] = pair.start[4].position[1] = pair.start[4].position[2] = 0;
  pair.start[5].position[2] = -pair.start[5].position[2];
  pair.start[6].position[2] = 1e300 * 1e300;
  pair.pixels[0][2 * 7] = NAN;
  pair.pixels[1][2 * 8 + 1] = 1e300 * 1e300;
  pair.pixels[1][2 * 9] = 1e7;
  for (double& x : pair.start[10].position) x *= 1e-300;
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_CAUCHY)));
  TEST_ASSERT_EQUAL_MEMORY(pair.start, points, 11 * sizeof(tv_point));
  TEST_ASSERT_TRUE(result.num_points <= 29);
  TEST_ASSERT_TRUE(result.num_points >= 25);
  TEST_ASSERT_TRUE(scene::rotation_error_deg(R, pair.R) < 0.5);
}

void expect_finite() {
  for (double x : R) TEST_ASSERT_TRUE(x - x == 0);
  for (double x : t) TEST_ASSERT_TRUE(x - x == 0);
  for (double x : result.covariance) TEST_ASSERT_TRUE(x - x == 0);
  TEST_ASSERT_TRUE(result.final_cost <= result.initial_cost);
  TEST_ASSERT_TRUE(result.noise_px >= 0 && result.rms_px >= 0);
  for (int i = 0; i < pair.options.num; ++i) {
    for (double x : points[i].position) TEST_ASSERT_TRUE(x - x == 0);
    TEST_ASSERT_TRUE(points[i].error_px >= 0 && points[i].angle_rad >= 0);
  }
}

void test_degenerate_pairs_end_without_a_nan() {
  const tv_loss losses[3] = {TV_LOSS_NONE, TV_LOSS_HUBER, TV_LOSS_CAUCHY};
  for (int kind = 0; kind < 7; ++kind) {
    for (tv_loss loss : losses) {
      for (double scale_px : {1e-9, 1.0, 1e9}) {
        Options options;
        options.num = kind < 4 ? kind : 50;
        options.geometry = Geometry::kForward;
        options.seed = ++seed;
        bundle_scene::make(options, &pair);
        for (int i = 1; i < options.num; ++i) {
          if (kind == 4) {  // kind 4: copies of one match
            for (int v = 0; v < 2; ++v) {
              std::memcpy(pair.pixels[v] + 2 * i, pair.pixels[v], 2 * sizeof(double));
            }
          } else if (kind == 5) {  // kind 5: equal pixels, no motion
            std::memcpy(pair.pixels[1] + 2 * i, pair.pixels[0] + 2 * i, 2 * sizeof(double));
          } else if (kind == 6) {  // kind 6: only wrong matches
            tv::Random random = tv::random_seeded(seed * 1000 + static_cast<uint64_t>(i));
            const Vec2 p = scene::random_pixel(&random, options.camera[1]);
            pair.pixels[1][2 * i] = p[0], pair.pixels[1][2 * i + 1] = p[1];
          }
        }
        bundle_scene::triangulate(options, &pair);
        begin();
        tv_bundle_options bundle = options_of(loss);
        bundle.loss_scale_px = scale_px;
        bundle.max_iterations = 1000;
        TEST_ASSERT_EQUAL_INT(TV_OK, adjust(bundle));
        expect_finite();
        TEST_ASSERT_FALSE(kind < 4 && result.has_covariance);
      }
    }
  }
}

// Points on the baseline: image 1 sees them at its epipole at any depth.
void test_points_on_the_baseline_do_no_harm() {
  Options options;
  options.geometry = Geometry::kForward;
  options.start_off_rad = 0;
  options.noise_px = 0;
  options.seed = ++seed;
  bundle_scene::make(options, &pair);
  const Vec3 forward = -pair.R.transpose() * pair.t;
  const tv::Camera camera = tv::prepare_camera(options.camera[0]);
  for (int i = 0; i < 20; ++i) {
    const Vec3 X = (3.0 + i) * forward;
    Vec2 p0, p1;
    TEST_ASSERT_TRUE(tv::project(camera, X, &p0, nullptr));
    TEST_ASSERT_TRUE(tv::project(camera, pair.R * X + pair.t, &p1, nullptr));
    for (int k = 0; k < 2; ++k) {
      pair.pixels[0][2 * i + k] = p0[k];
      pair.pixels[1][2 * i + k] = p1[k] + (i > 10 ? 0.3 : 0);
      pair.start[i].position[k] = X[k];
    }
    pair.start[i].position[2] = X[2];
    pair.start[i].status = TV_POINT_OK;
  }
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_CAUCHY)));
  expect_finite();
  TEST_ASSERT_TRUE(scene::rotation_error_deg(R, pair.R) < 0.01);
}

void test_the_same_input_gives_the_same_bytes() {
  Options options;
  options.outlier_share = 0.2;
  options.seed = ++seed;
  bundle_scene::make(options, &pair);
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_CAUCHY)));
  static tv_point first[bundle_scene::kMaxPoints];
  const tv_bundle_result first_result = result;
  std::memcpy(first, points, sizeof first);
  begin();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(options_of(TV_LOSS_CAUCHY)));
  TEST_ASSERT_EQUAL_MEMORY(first, points, sizeof first);
  TEST_ASSERT_EQUAL_MEMORY(&first_result, &result, sizeof result);
}

}  // namespace

int main() {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_matches = bundle_scene::kMaxPoints;
  if (tv_context_new(&context, &limits) != TV_OK) return 1;
  UNITY_BEGIN();
  RUN_TEST(test_derivatives_agree_with_differences);
  RUN_TEST(test_eliminating_a_point_leaves_what_qr_leaves);
  RUN_TEST(test_the_basis_of_the_sphere_is_orthonormal);
  RUN_TEST(test_exact_pixels_give_the_exact_pose_and_points);
  RUN_TEST(test_the_cost_never_rises_and_the_answer_is_closer);
  RUN_TEST(test_points_at_and_beyond_infinity_take_part);
  RUN_TEST(test_nothing_but_infinity_leaves_the_translation_where_it_is);
  RUN_TEST(test_holding_the_pose_gives_each_point_its_least_error);
  RUN_TEST(test_points_that_cannot_take_part_are_left_alone);
  RUN_TEST(test_degenerate_pairs_end_without_a_nan);
  RUN_TEST(test_points_on_the_baseline_do_no_harm);
  RUN_TEST(test_the_same_input_gives_the_same_bytes);
  const int failures = UNITY_END();
  tv_context_free(context);
  return failures;
}
