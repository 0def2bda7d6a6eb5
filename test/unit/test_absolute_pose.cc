// Tests of the parts of the absolute pose: matches made ready, the error to first order, the fast
// cost against its definition, and the normal equations against finite differences.
#include <cmath>

#include "pose/absolute_pose.h"
#include "pose/reprojection.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Pose;
using tv::Vec2;
using tv::Vec3;

constexpr int kMost = 400;

struct Scene {
  tv_camera camera;
  Pose pose;  // cam_from_world
  double pixels[2 * kMost], points[3 * kMost];
  float sigmas[kMost], ratios[kMost];
  tv::SightingInput input;
  tv::Sightings sightings;
  Pose scaled;  // `pose` for the points as Sightings has them
  alignas(64) uint8_t memory[kMost * 400];
};

Scene scene_;

tv_camera fisheye() {
  return tv_camera{TV_CAMERA_KANNALA_BRANDT,      640, 480, 0, 200, 201, 318, 242,
                   {-0.02, 0.004, -0.001, 0.0002}};
}

// Pixels over the whole image with noise, and the points that they see.
void make(uint64_t seed, const tv_camera& camera, int num, double noise_px, bool with_sigmas,
          const Vec3& shift = Vec3::Zero(), double unit = 1) {
  Scene& s = scene_;
  tv::Random random = tv::random_seeded(seed);
  s.camera = camera;
  const tv::Camera prepared = tv::prepare_camera(camera);
  s.pose.R = tv::rotation_about(scene::direction(&random), uniform(&random, 0, 2));
  s.pose.t = unit * scene::direction(&random) - s.pose.R * shift;
  for (int i = 0; i < num;) {
    const Vec2 pixel(uniform(&random, 0, camera.width - 1), uniform(&random, 0, camera.height - 1));
    Vec3 ray;
    if (!tv::unproject(prepared, pixel, &ray, nullptr)) continue;
    const Vec3 point = s.pose.R.transpose() * (unit * uniform(&random, 2, 8) * ray - s.pose.t);
    s.sigmas[i] = static_cast<float>(uniform(&random, 1, 3));
    s.ratios[i] = static_cast<float>(uniform(&random, 0, 1));
    for (int d = 0; d < 2; ++d) {
      s.pixels[2 * i + d] =
          pixel[d] + noise_px * (with_sigmas ? s.sigmas[i] : 1) * scene::normal(&random);
    }
    for (int d = 0; d < 3; ++d) s.points[3 * i + d] = point[d];
    ++i;
  }
  s.input =
      tv::SightingInput{tvk_select(TV_KERNELS_AUTO),      prepared, s.pixels, s.points, nullptr,
                        with_sigmas ? s.sigmas : nullptr, num};
}

void prepare() {
  Scene& s = scene_;
  TEST_ASSERT_TRUE(tv::sightings_bytes(static_cast<size_t>(s.input.num)) <= sizeof s.memory);
  tv::Arena arena = tv::arena_over(s.memory, sizeof s.memory);
  s.sightings = tv::Sightings();
  tv::prepare_sightings(s.input, arena, &s.sightings);
  s.scaled.R = s.pose.R;
  const double* c = s.sightings.centre;
  s.scaled.t = s.sightings.scale * (s.pose.R * Vec3(c[0], c[1], c[2]) + s.pose.t);
}

// The error by the lens model, in sigmas.
double exact_sq(int k, const Pose& pose) {
  const Scene& s = scene_;
  const int32_t i = s.sightings.order[k];
  double p[3];
  Vec2 pixel;
  tv::place(pose, s.sightings.all[k].point, p);
  if (!tv::project(s.input.camera, Vec3(p[0], p[1], p[2]), &pixel, nullptr)) return INFINITY;
  return (pixel - Vec2(s.pixels[2 * i], s.pixels[2 * i + 1])).squaredNorm() /
         (s.input.sigma(i) * s.input.sigma(i));
}

void test_the_error_is_that_of_projection(void) {
  // Exact for a pinhole; with a lens exact to first order, so that the difference is a small part
  // of an error of a few pixels.
  const struct {
    tv_camera camera;
    double limit;
  } cases[] = {{scene::pinhole(), 1e-8}, {scene::distorted(), 0.03}, {fisheye(), 0.03}};
  for (const auto& c : cases) {
    make(5, c.camera, kMost, 1, true, Vec3(3, -70, 20), 11);
    prepare();
    TEST_ASSERT_EQUAL_INT(kMost, scene_.sightings.num);
    for (int k = 0; k < kMost; ++k) {
      const double expected = std::sqrt(exact_sq(k, scene_.scaled));
      const double error = std::sqrt(tv::reprojection_sq(scene_.sightings.all[k], scene_.scaled));
      TEST_ASSERT_DOUBLE_WITHIN(c.limit * (expected + 1e-3), expected, error);
      double ray[3];
      Vec3 true_ray;
      const int32_t i = scene_.sightings.order[k];
      tv::unit_ray(scene_.sightings.all[k], ray);
      tv::unproject(scene_.input.camera, Vec2(scene_.pixels[2 * i], scene_.pixels[2 * i + 1]),
                    &true_ray, nullptr);
      TEST_ASSERT_TRUE((Vec3(ray[0], ray[1], ray[2]) - true_ray).norm() < 1e-12);
    }
  }
}

void test_points_behind_the_camera_have_no_error_that_is_finite(void) {
  // Points on the optical axis, whose pixel fits them behind the camera, too.
  make(6, scene::pinhole(), 20, 0, false);
  for (int i = 0; i < 20; ++i) {
    const Vec3 point = scene_.pose.R.transpose() * (Vec3(0, 0, 2 + i) - scene_.pose.t);
    for (int d = 0; d < 3; ++d) scene_.points[3 * i + d] = point[d];
    scene_.pixels[2 * i] = scene_.camera.cx;
    scene_.pixels[2 * i + 1] = scene_.camera.cy;
  }
  prepare();
  TEST_ASSERT_TRUE(tv::reprojection_cost(scene_.sightings, scene_.scaled, 4, INT64_MAX) < 20);
  const Mat3 half_turn = Vec3(1, -1, -1).asDiagonal();
  const Pose behind{half_turn * scene_.scaled.R, half_turn * scene_.scaled.t};
  for (int k = 0; k < 20; ++k) {
    TEST_ASSERT_FALSE(tv::reprojection_sq(scene_.sightings.all[k], behind) < 1e300);
  }
  TEST_ASSERT_EQUAL_INT64(20 * tv::kSightingCost,
                          tv::reprojection_cost(scene_.sightings, behind, 4, INT64_MAX));
}

void test_the_fast_cost_is_the_truncated_sum(void) {
  tv::Random random = tv::random_seeded(7);
  const tv_camera cameras[] = {scene::pinhole(), scene::distorted(), fisheye()};
  for (int trial = 0; trial < 60; ++trial) {
    const int num = trial < 30 ? 3 + trial : kMost;
    make(100 + static_cast<uint64_t>(trial), cameras[trial % 3], num, 1.5, trial % 2 != 0);
    prepare();
    Pose pose = scene_.scaled;
    pose.R = tv::rotation_about(scene::direction(&random), uniform(&random, 0, 0.01)) * pose.R;
    const double T = uniform(&random, 0.5, 5);
    double expected = 0;
    for (int k = 0; k < num; ++k) {
      expected += std::fmin(1, tv::reprojection_sq(scene_.sightings.all[k], pose) / (T * T));
    }
    const int64_t cost = tv::reprojection_cost(scene_.sightings, pose, T, INT64_MAX);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * num, expected, static_cast<double>(cost) / tv::kSightingCost);
    // A bound above the cost changes nothing in nearly all cases; one far below it stops early.
    TEST_ASSERT_EQUAL_INT64(
        cost, tv::reprojection_cost(scene_.sightings, pose, T, 2 * cost + 20 * tv::kSightingCost));
    if (num == kMost && cost > 200 * tv::kSightingCost) {
      TEST_ASSERT_EQUAL_INT64(INT64_MAX, tv::reprojection_cost(scene_.sightings, pose, T, 1000));
    }
  }
}

Pose stepped(const Pose& pose, int parameter, double step) {
  Vec3 axis = Vec3::Zero();
  axis[parameter % 3] = step;
  Pose moved = pose;
  if (parameter < 3) {
    moved.R = tv::rotation_step(axis) * pose.R;
  } else {
    moved.t = pose.t + axis;
  }
  return moved;
}

void test_the_gradient_is_that_of_the_cost(void) {
  static int32_t indices[kMost];
  for (int i = 0; i < kMost; ++i) indices[i] = i;
  const tv_camera cameras[] = {scene::pinhole(), scene::distorted(), fisheye()};
  for (int trial = 0; trial < 12; ++trial) {
    make(50 + static_cast<uint64_t>(trial), cameras[trial % 3], 60, 2, trial % 2 != 0);
    prepare();
    const double c = 3;
    tv::PoseProblem problem{
        trial < 6 ? &scene_.input : nullptr, scene_.sightings, indices, 60, c, {}, 0};
    if (trial % 4 == 3) {
      problem.gravity = {1e3, Vec3(0.6, 0, 0.8), Vec3(0, 0.8, 0.6)};
      problem.noise_sq = 2;
    }
    const Pose pose = stepped(scene_.scaled, 1, 0.003);
    tv::PoseEquations at, above, below;
    tv::pose_equations(problem, pose, &at);
    for (int p = 0; p < 6; ++p) {
      const double h = 1e-6;
      tv::pose_equations(problem, stepped(pose, p, h), &above);
      tv::pose_equations(problem, stepped(pose, p, -h), &below);
      // d cost / d parameter = 2 gradient / c^2
      const double slope = (above.cost - below.cost) / (2 * h) * c * c / 2;
      const double size = std::sqrt(at.upper[p == 0 ? 0 : p * 6 - p * (p - 1) / 2] * 60);
      TEST_ASSERT_DOUBLE_WITHIN(1e-5 * size, slope, at.gradient[p]);
    }
  }
}

void test_refinement_finds_the_exact_pose(void) {
  static int32_t indices[kMost];
  for (int i = 0; i < kMost; ++i) indices[i] = i;
  const tv_camera cameras[] = {scene::pinhole(), scene::distorted(), fisheye()};
  for (int trial = 0; trial < 9; ++trial) {
    make(80 + static_cast<uint64_t>(trial), cameras[trial % 3], 40, 0, false);
    prepare();
    const tv::PoseProblem problem{&scene_.input, scene_.sightings, indices, 40, 20, {}, 0};
    Pose pose = stepped(stepped(scene_.scaled, trial % 3, 0.01), 3 + trial % 3, 0.02);
    tv::refine_absolute(problem, 30, 1e-12, &pose, nullptr);
    TEST_ASSERT_TRUE((pose.R - scene_.scaled.R).norm() + (pose.t - scene_.scaled.t).norm() < 1e-9);
  }
}

void test_equal_matches_come_last_and_the_most_precise_stays(void) {
  make(9, scene::pinhole(), 30, 0, true);
  for (int i = 20; i < 30; ++i) {  // matches 20 to 29 repeat 0 to 9, with half the sigma
    for (int d = 0; d < 2; ++d) scene_.pixels[2 * i + d] = scene_.pixels[2 * (i - 20) + d];
    for (int d = 0; d < 3; ++d) scene_.points[3 * i + d] = scene_.points[3 * (i - 20) + d];
    scene_.sigmas[i] = 0.5f * scene_.sigmas[i - 20];
  }
  for (const bool with_ratios : {false, true}) {
    scene_.input.ratios = with_ratios ? scene_.ratios : nullptr;
    prepare();
    const tv::Sightings& s = scene_.sightings;
    TEST_ASSERT_EQUAL_INT(20, s.num);
    TEST_ASSERT_EQUAL_INT(30, s.num_all);
    for (int k = 0; k < 30; ++k) {
      TEST_ASSERT_TRUE(k < 20 ? s.order[k] >= 10 : s.order[k] < 10);
      if (with_ratios && k > 0 && k < 20) {
        TEST_ASSERT_TRUE(scene_.ratios[s.order[k - 1]] <= scene_.ratios[s.order[k]]);
      }
    }
  }
}

void test_matches_that_cannot_be_seen_are_left_out(void) {
  make(10, fisheye(), 40, 0, false);
  const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
  for (int i = 0; i < 25; ++i) {
    if (i % 5 < 2) scene_.pixels[2 * i + i % 5] = bad[i / 5];
    if (i % 5 >= 2) scene_.points[3 * i + i % 5 - 2] = bad[i / 5];
  }
  scene_.pixels[2 * 25] = 5000;      // outside the lens
  scene_.points[3 * 26 + 1] = 1e12;  // too far from the others
  prepare();
  TEST_ASSERT_EQUAL_INT(13, scene_.sightings.num_all);
  for (int k = 0; k < 13; ++k) TEST_ASSERT_TRUE(scene_.sightings.order[k] >= 27);
}

void test_points_are_scaled_to_about_one(void) {
  for (const double unit : {1e-12, 1e-3, 1.0, 1e3, 1e12}) {
    make(11, scene::pinhole(), 101, 0, false, unit * Vec3(100, -2000, 7), unit);
    prepare();
    double largest = 0;
    for (int k = 0; k < 101; ++k) {
      for (const double x : scene_.sightings.all[k].point)
        largest = std::fmax(largest, std::fabs(x));
    }
    TEST_ASSERT_TRUE(largest > 0.2 && largest < 20);
    int exponent;
    TEST_ASSERT_TRUE(std::frexp(scene_.sightings.scale, &exponent) == 0.5);
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_error_is_that_of_projection);
  RUN_TEST(test_points_behind_the_camera_have_no_error_that_is_finite);
  RUN_TEST(test_the_fast_cost_is_the_truncated_sum);
  RUN_TEST(test_the_gradient_is_that_of_the_cost);
  RUN_TEST(test_refinement_finds_the_exact_pose);
  RUN_TEST(test_equal_matches_come_last_and_the_most_precise_stays);
  RUN_TEST(test_matches_that_cannot_be_seen_are_left_out);
  RUN_TEST(test_points_are_scaled_to_about_one);
  return UNITY_END();
}
