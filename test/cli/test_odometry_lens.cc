// Tests of the lens that a map is adjusted with: simulated keyframes and points of a known camera,
// mapped as a tracker with another focal length maps them.
#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "odometry/lens_adjustment.h"

#include <unity.h>  // comes last, since unity.h defines isnan and isinf as macros

using namespace cli;

extern "C" {
void setUp(void) {}
void tearDown(void) {}
}

namespace {

constexpr int kWidth = 640, kHeight = 480, kViews = 24, kPoints = 500;
constexpr double kFocal = 500, kWrong = 1.12;

struct Scene {
  std::vector<FlightKeyframe> keyframes;
  std::vector<tv_map_point> points;
};

struct Flown {
  double turn_rad = 0;  // of the whole flight, about the vertical
  SimpleLens lens{kFocal, 0};
};

// The pixel of a point of the camera's frame.
bool pixel_of(const SimpleLens& lens, const cv::Vec3d& x, double pixel[2]) {
  if (x[2] < 0.3) return false;
  const double a = x[0] / x[2], b = x[1] / x[2], r_sq = a * a + b * b;
  const double s = 2 / (1 + std::sqrt(1 - 4 * lens.k1 * r_sq)) * lens.focal_px;
  pixel[0] = (kWidth - 1) / 2.0 + s * a;
  pixel[1] = (kHeight - 1) / 2.0 + s * b;
  return pixel[0] > 0 && pixel[0] < kWidth && pixel[1] > 0 && pixel[1] < kHeight;
}

// The map as a tracker whose focal length is kWrong times the true one has it at first: depths and
// forward motions are longer by as much.
Scene fly(const Flown& flown) {
  std::mt19937 random(7);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * random() / 4294967296.0;
  };
  std::vector<cv::Vec3d> points;
  Scene scene;
  for (int i = 0; i < kPoints; ++i) {
    const double x = uniform(-6, 10);
    const double y = uniform(-2, 2);
    const double z = uniform(3, 8);
    points.emplace_back(x, y, z);
    tv_map_point point{};
    point.id = i;
    const double at[3] = {x, y, z * kWrong};
    std::copy(at, at + 3, point.position);
    scene.points.push_back(point);
  }
  for (int k = 0; k < kViews; ++k) {
    const double share = k / (kViews - 1.0), angle = flown.turn_rad * (share - 0.5);
    const cv::Vec3d centre(3 * share, 0.2 * std::sin(5 * share), 0);
    const cv::Matx33d world_from_cam(std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle),
                                     0, std::cos(angle));
    FlightKeyframe key{};
    tv_keyframe_init(&key.keyframe);
    key.keyframe.id = k;
    std::copy(world_from_cam.val, world_from_cam.val + 9, key.keyframe.world_from_cam_R);
    std::copy(centre.val, centre.val + 3, key.keyframe.world_from_cam_t);
    for (int i = 0; i < kPoints; ++i) {
      double pixel[2];
      if (!pixel_of(flown.lens, world_from_cam.t() * (points[static_cast<size_t>(i)] - centre),
                    pixel))
        continue;
      tv_map_observation seen{};
      seen.idx_point = i;
      seen.x = static_cast<float>(pixel[0] + uniform(-0.5, 0.5));
      seen.y = static_cast<float>(pixel[1] + uniform(-0.5, 0.5));
      seen.sigma = 1;
      key.observations.push_back(seen);
    }
    scene.keyframes.push_back(key);
  }
  return scene;
}

LensEstimate adjusted(const Scene& scene) {
  return adjust_lens(scene.keyframes, scene.points, kWidth, kHeight, {kFocal * kWrong, 0});
}

void test_a_camera_that_turns_shows_its_focal_length(void) {
  const LensEstimate found = adjusted(fly({0.9, {kFocal, 0}}));
  TEST_ASSERT_TRUE(found.is_known);
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * kFocal, kFocal, found.lens.focal_px);
  TEST_ASSERT_EQUAL_DOUBLE(0, found.lens.k1);
  TEST_ASSERT_TRUE(std::sqrt(found.focal_variance) < 0.02);
}

void test_a_bent_lens_is_found_with_its_coefficient(void) {
  const LensEstimate found = adjusted(fly({0.9, {kFocal, -0.25}}));
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * kFocal, kFocal, found.lens.focal_px);
  TEST_ASSERT_DOUBLE_WITHIN(0.02, -0.25, found.lens.k1);
}

void test_a_camera_that_goes_straight_does_not_show_it(void) {
  const LensEstimate found = adjusted(fly({0, {kFocal, 0}}));
  TEST_ASSERT_TRUE(std::sqrt(found.focal_variance) > kMostFocalSigma);
}

void test_few_keyframes_tell_nothing(void) {
  Scene scene = fly({0.9, {kFocal, 0}});
  scene.keyframes.resize(7);
  const LensEstimate found = adjusted(scene);
  TEST_ASSERT_FALSE(found.is_known);
  TEST_ASSERT_EQUAL_DOUBLE(kFocal * kWrong, found.lens.focal_px);
  TEST_ASSERT_EQUAL_DOUBLE(kPriorLogFocal, std::sqrt(found.focal_variance));
}

void test_the_librarys_camera_has_the_lens_of_the_estimate(void) {
  for (const double k1 : {0.0, -0.3, -0.1, 0.1}) {
    const SimpleLens lens{kFocal, k1};
    const tv_camera camera = camera_of_lens(lens, kWidth, kHeight);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_check(&camera));
    for (double x = -0.55; x < 0.6; x += 0.1) {
      const double ray[3] = {x, 0.7 * x, 1};
      double pixel[2], expected[2];
      TEST_ASSERT_TRUE(pixel_of(lens, {ray[0], ray[1], ray[2]}, expected));
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, ray, pixel, nullptr));
      TEST_ASSERT_DOUBLE_WITHIN(0.1, expected[0], pixel[0]);
      TEST_ASSERT_DOUBLE_WITHIN(0.1, expected[1], pixel[1]);
    }
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_camera_that_turns_shows_its_focal_length);
  RUN_TEST(test_a_bent_lens_is_found_with_its_coefficient);
  RUN_TEST(test_a_camera_that_goes_straight_does_not_show_it);
  RUN_TEST(test_few_keyframes_tell_nothing);
  RUN_TEST(test_the_librarys_camera_has_the_lens_of_the_estimate);
  return UNITY_END();
}
