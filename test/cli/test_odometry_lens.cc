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

constexpr int kWidth = 640, kHeight = 480, kViews = 24, kPoints = 320, kFewPoints = 120;
constexpr double kFocal = 500, kWrong = 1.12;

constexpr double kFrames = 4;  // from one keyframe to the next

struct Scene {
  std::vector<FlightKeyframe> keyframes;
  std::vector<LensKeyframe> moving;  // of the same keyframes
  std::vector<tv_map_point> points;
};

struct Flown {
  double turn_rad = 0;  // of the whole flight, about the vertical
  SimpleLens lens{kFocal};
  double nod_rad = 0;  // up and down, three times
  double readout = 0;  // from the first row to the last, in times between two frames
  int num_points = kPoints;
};

// The distance from the middle of a ray of the slope rho, over the focal length: by bisection.
double bent(const SimpleLens& lens, double rho) {
  double low = 0, high = 2;
  for (int k = 0; k < 60; ++k) {
    const double d = (low + high) / 2;
    const double sq = d * d;
    (d / (1 + sq * (lens.k1 + sq * (lens.k2 + sq * lens.k3))) < rho ? low : high) = d;
  }
  return low;
}

// The pixel of a point of the camera's frame.
bool pixel_of(const SimpleLens& lens, const cv::Vec3d& x, double pixel[2]) {
  if (x[2] < 0.3) return false;
  const double a = x[0] / x[2], b = x[1] / x[2], rho = std::hypot(a, b);
  const double s = rho > 1e-9 ? bent(lens, rho) / rho * lens.focal_px : lens.focal_px;
  const double tangential[2] = {2 * lens.p1 * a * b + lens.p2 * (rho * rho + 2 * a * a),
                                lens.p1 * (rho * rho + 2 * b * b) + 2 * lens.p2 * a * b};
  pixel[0] = (kWidth - 1) / 2.0 + lens.cx + s * a + lens.focal_px * tangential[0];
  pixel[1] = (kHeight - 1) / 2.0 + lens.cy + s * b + lens.focal_px * tangential[1];
  return pixel[0] > 0 && pixel[0] < kWidth && pixel[1] > 0 && pixel[1] < kHeight;
}

struct CameraPose {
  cv::Matx33d world_from_cam;
  cv::Vec3d centre;
};

// The camera at `share` of the flight.
CameraPose pose_at(const Flown& flown, double share) {
  const double angle = flown.turn_rad * (share - 0.5), nod = flown.nod_rad * std::sin(19 * share);
  const cv::Matx33d turned(std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0,
                           std::cos(angle));
  const cv::Matx33d nodded(1, 0, 0, 0, std::cos(nod), -std::sin(nod), 0, std::sin(nod),
                           std::cos(nod));
  return {turned * nodded, {3 * share, 0.2 * std::sin(5 * share), 0}};
}

// The pixel at which the row of the picture meets the point that is exposed with it.
bool pixel_at(const Flown& flown, double share, double frame_share, const cv::Vec3d& point,
              double pixel[2]) {
  constexpr int kTimes = 5;
  double row = 0;
  for (int k = 0; k < kTimes; ++k) {
    const CameraPose pose = pose_at(flown, share + flown.readout * row * frame_share);
    if (!pixel_of(flown.lens, pose.world_from_cam.t() * (point - pose.centre), pixel)) return false;
    row = (pixel[1] - (kHeight - 1) / 2.0) / kHeight;
  }
  return true;
}

// How points at rest move in the camera's frame from one frame to the next.
LensKeyframe moving(const Flown& flown, double share, double frame_share) {
  const CameraPose before = pose_at(flown, share - frame_share / 2);
  const CameraPose after = pose_at(flown, share + frame_share / 2);
  const cv::Matx33d R = after.world_from_cam.t() * before.world_from_cam;  // nearly no turn
  const cv::Vec3d t = after.world_from_cam.t() * (before.centre - after.centre);
  return {nullptr,
          {(R(2, 1) - R(1, 2)) / 2, (R(0, 2) - R(2, 0)) / 2, (R(1, 0) - R(0, 1)) / 2},
          {t[0], t[1], t[2]}};
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
  for (int i = 0; i < flown.num_points; ++i) {
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
  constexpr double kFrameShare = 1 / (kFrames * (kViews - 1));
  for (int k = 0; k < kViews; ++k) {
    const double share = k / (kViews - 1.0);
    const CameraPose pose = pose_at(flown, share);
    FlightKeyframe key{};
    tv_keyframe_init(&key.keyframe);
    key.keyframe.id = k;
    std::copy(pose.world_from_cam.val, pose.world_from_cam.val + 9, key.keyframe.world_from_cam_R);
    std::copy(pose.centre.val, pose.centre.val + 3, key.keyframe.world_from_cam_t);
    for (int i = 0; i < flown.num_points; ++i) {
      double pixel[2];
      if (!pixel_at(flown, share, kFrameShare, points[static_cast<size_t>(i)], pixel)) continue;
      tv_map_observation seen{};
      seen.idx_point = i;
      seen.x = static_cast<float>(pixel[0] + uniform(-0.5, 0.5));
      seen.y = static_cast<float>(pixel[1] + uniform(-0.5, 0.5));
      seen.sigma = 1;
      key.observations.push_back(seen);
    }
    scene.keyframes.push_back(key);
    scene.moving.push_back(moving(flown, share, kFrameShare));
  }
  return scene;
}

LensEstimate adjusted(Scene scene) {
  for (size_t k = 0; k < scene.keyframes.size(); ++k) scene.moving[k].key = &scene.keyframes[k];
  scene.moving.resize(scene.keyframes.size());
  return adjust_lens(scene.moving, scene.points, kWidth, kHeight, {kFocal * kWrong});
}

void test_a_camera_that_turns_shows_its_focal_length(void) {
  const LensEstimate found = adjusted(fly({0.9}));
  TEST_ASSERT_TRUE(found.is_known);
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * kFocal, kFocal, found.lens.focal_px);
  TEST_ASSERT_DOUBLE_WITHIN(0.02, 0, found.lens.k1);
  TEST_ASSERT_TRUE(std::sqrt(found.focal_variance) < kMostFocalSigma);
}

void test_a_bent_lens_is_found_with_its_coefficients(void) {
  for (const SimpleLens& lens : {SimpleLens{kFocal, -0.25, 0}, SimpleLens{kFocal, -0.2, 0.1}}) {
    const LensEstimate found = adjusted(fly({0.9, lens}));
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * kFocal, kFocal, found.lens.focal_px);
    // The two share what a picture shows of them: together they bend its edge as the lens does.
    const double slope = 0.7;
    TEST_ASSERT_DOUBLE_WITHIN(0.01, bent(lens, slope), bent(found.lens, slope));
  }
}

void test_a_principal_point_away_from_the_middle_is_found(void) {
  const LensEstimate found = adjusted(fly({0.9, {kFocal, 0, 0, 0, -14, 11}, 0.2}));
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * kFocal, kFocal, found.lens.focal_px);
  TEST_ASSERT_DOUBLE_WITHIN(4, -14, found.lens.cx);
  TEST_ASSERT_DOUBLE_WITHIN(4, 11, found.lens.cy);
}

// The tangential coefficients and the principal point look alike in the middle of the picture, and
// each takes a part of the other's: two thirds of the coefficients are found.
void test_a_lens_that_is_not_centred_is_found(void) {
  const SimpleLens lens{kFocal, -0.1, 0, 0, -6, 4, 0.003, -0.002};
  const LensEstimate found = adjusted(fly({0.9, lens, 0.3}));
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * kFocal, kFocal, found.lens.focal_px);
  TEST_ASSERT_DOUBLE_WITHIN(0.001, lens.p1, found.lens.p1);
  TEST_ASSERT_DOUBLE_WITHIN(0.001, lens.p2, found.lens.p2);
}

// 0.6 times between two frames from the first row to the last: without it the focal length is off
// by 1.8 per cent, and k1 is -0.02.
void test_a_rolling_shutter_does_not_change_the_focal_length(void) {
  const LensEstimate found = adjusted(fly({0.9, {kFocal}, 0.3, 0.6}));
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * kFocal, kFocal, found.lens.focal_px);
  TEST_ASSERT_DOUBLE_WITHIN(0.03, 0, found.lens.k1);
}

void test_a_camera_that_goes_straight_does_not_show_it(void) {
  const LensEstimate found = adjusted(fly({0}));
  TEST_ASSERT_TRUE(std::sqrt(found.focal_variance) > kMostFocalSigma);
}

CameraEvidence evidence(Scene scene, const tv_camera& camera) {
  for (size_t k = 0; k < scene.keyframes.size(); ++k) scene.moving[k].key = &scene.keyframes[k];
  scene.moving.resize(scene.keyframes.size());
  return evidence_on_camera(scene.moving, scene.points, camera);
}

tv_camera camera_with(const SimpleLens& lens) { return camera_of_lens(lens, kWidth, kHeight); }

void test_the_right_camera_is_not_contradicted(void) {
  for (const SimpleLens& lens : {SimpleLens{kFocal}, SimpleLens{kFocal, -0.25, 0.05},
                                 SimpleLens{kFocal, 0.1, 0, 0, 9, -7}}) {
    const CameraEvidence found = evidence(fly({0.9, lens, 0.2, 0, kFewPoints}), camera_with(lens));
    TEST_ASSERT_TRUE(found.is_known);
    TEST_ASSERT_FALSE(found.contradicts());
    TEST_ASSERT_DOUBLE_WITHIN(3 * std::hypot(found.focal_sigma, 0.003), 0, found.focal_change);
    TEST_ASSERT_DOUBLE_WITHIN(3 * std::hypot(found.edge_sigma, 0.003), 0, found.edge_change);
  }
}

void test_a_wrong_focal_length_is_contradicted(void) {
  constexpr double kFactor = 0.85;
  const SimpleLens lens{kFocal, -0.2, 0.05}, wrong{kFactor * kFocal, -0.2, 0.05};
  const CameraEvidence found = evidence(fly({0.9, lens, 0, 0, kFewPoints}), camera_with(wrong));
  TEST_ASSERT_TRUE(found.contradicts_focal());
  TEST_ASSERT_DOUBLE_WITHIN(3 * found.focal_sigma, 1 / kFactor - 1, found.focal_change);
}

void test_a_lens_that_was_left_out_is_contradicted(void) {
  const SimpleLens lens{kFocal, -0.3, 0.05};
  const CameraEvidence found = evidence(fly({0.9, lens, 0, 0, kFewPoints}), camera_with({kFocal}));
  TEST_ASSERT_TRUE(found.contradicts_lens());
  TEST_ASSERT_FALSE(found.contradicts_focal());
  TEST_ASSERT_FALSE(found.contradicts_centre());
  // Four fifths of the way to a corner.
  const double d = 0.8 * std::hypot(kWidth, kHeight) / 2 / kFocal;
  TEST_ASSERT_DOUBLE_WITHIN(0.02, -0.3 * d * d + 0.05 * d * d * d * d, found.edge_change);
}

void test_a_principal_point_elsewhere_is_contradicted(void) {
  constexpr double kShift = 0.1 * kFocal;
  const CameraEvidence found = evidence(
      fly({0.9, {kFocal, 0, 0, 0, kShift, -kShift}, 0, 0, kFewPoints}), camera_with({kFocal}));
  TEST_ASSERT_TRUE(found.contradicts_centre());
  TEST_ASSERT_FALSE(found.contradicts_focal());
  TEST_ASSERT_FALSE(found.contradicts_lens());
  TEST_ASSERT_DOUBLE_WITHIN(3 * found.centre_sigma_px[0] + 2, kShift, found.centre_shift_px[0]);
  TEST_ASSERT_DOUBLE_WITHIN(3 * found.centre_sigma_px[1] + 2, -kShift, found.centre_shift_px[1]);
}

void test_pixels_that_are_not_square_are_the_cameras(void) {
  constexpr double kStretch = 1.15;
  Scene scene = fly({0.9, {kFocal}, 0, 0, kFewPoints});
  for (FlightKeyframe& key : scene.keyframes)
    for (tv_map_observation& seen : key.observations)
      seen.y = static_cast<float>((kHeight - 1) / 2.0 +
                                  kStretch * (static_cast<double>(seen.y) - (kHeight - 1) / 2.0));
  tv_camera camera = camera_with({kFocal});
  camera.fy *= kStretch;
  const CameraEvidence found = evidence(scene, camera);
  TEST_ASSERT_TRUE(found.is_known);
  TEST_ASSERT_FALSE(found.contradicts());
}

void test_a_camera_that_goes_straight_contradicts_no_focal_length(void) {
  const CameraEvidence found =
      evidence(fly({0, {kFocal}, 0, 0, kFewPoints}), camera_with({kFocal * kWrong}));
  TEST_ASSERT_TRUE(found.is_known);
  TEST_ASSERT_FALSE(found.contradicts());
}

void test_few_keyframes_tell_nothing(void) {
  Scene scene = fly({0.9});
  scene.keyframes.resize(7);
  const LensEstimate found = adjusted(scene);
  TEST_ASSERT_FALSE(found.is_known);
  TEST_ASSERT_EQUAL_DOUBLE(kFocal * kWrong, found.lens.focal_px);
  TEST_ASSERT_EQUAL_DOUBLE(kPriorLogFocal, std::sqrt(found.focal_variance));
  TEST_ASSERT_FALSE(evidence(scene, camera_with({kFocal * kWrong})).is_known);
}

void test_the_librarys_camera_has_the_lens_of_the_estimate(void) {
  for (const double k1 : {0.0, -0.3, -0.1, 0.1}) {
    const SimpleLens lens{kFocal, k1, 0.2 * k1, 0.1 * k1, 5, -3, 0.002, -0.001};
    const tv_camera camera = camera_of_lens(lens, kWidth, kHeight);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_check(&camera));
    for (double x = -0.55; x < 0.6; x += 0.1) {
      const double ray[3] = {x, 0.7 * x, 1};
      double pixel[2], expected[2];
      TEST_ASSERT_TRUE(pixel_of(lens, {ray[0], ray[1], ray[2]}, expected));
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, ray, pixel, nullptr));
      TEST_ASSERT_DOUBLE_WITHIN(0.01, expected[0], pixel[0]);
      TEST_ASSERT_DOUBLE_WITHIN(0.01, expected[1], pixel[1]);
    }
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_camera_that_turns_shows_its_focal_length);
  RUN_TEST(test_a_bent_lens_is_found_with_its_coefficients);
  RUN_TEST(test_a_principal_point_away_from_the_middle_is_found);
  RUN_TEST(test_a_lens_that_is_not_centred_is_found);
  RUN_TEST(test_a_rolling_shutter_does_not_change_the_focal_length);
  RUN_TEST(test_a_camera_that_goes_straight_does_not_show_it);
  RUN_TEST(test_the_right_camera_is_not_contradicted);
  RUN_TEST(test_a_wrong_focal_length_is_contradicted);
  RUN_TEST(test_a_lens_that_was_left_out_is_contradicted);
  RUN_TEST(test_a_principal_point_elsewhere_is_contradicted);
  RUN_TEST(test_pixels_that_are_not_square_are_the_cameras);
  RUN_TEST(test_a_camera_that_goes_straight_contradicts_no_focal_length);
  RUN_TEST(test_few_keyframes_tell_nothing);
  RUN_TEST(test_the_librarys_camera_has_the_lens_of_the_estimate);
  return UNITY_END();
}
