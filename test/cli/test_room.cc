// The rendered room (tools/room): its pictures and depths must agree with its poses.
#include <unity.h>

#include <cmath>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "room/room.h"
#include "twoview/alloc.h"
#include "twoview/twoview.h"

using room::CameraPose;
using room::Vec3;

namespace {

constexpr int kWidth = 640, kHeight = 360;

// A lens similar to that of the AR.Drone's front camera.
const tv_camera camera{TV_CAMERA_BROWN_CONRADY, kWidth, kHeight, 0, 560, 560, 320, 180,
                       {-0.5, 0.25, 0, 0, 0}};

struct Film {
  std::vector<uint8_t> luma = std::vector<uint8_t>(kWidth * kHeight);
  std::vector<float> depth = std::vector<float>(kWidth * kHeight);
};

const room::Room& the_room() {
  static const room::Room room;
  return room;
}

const room::Eye& eye() {
  static const room::Eye eye(camera);
  return eye;
}

CameraPose pose(double yaw, double pitch, double roll, const Vec3& position) {
  return room::camera_pose(room::world_from_body(yaw, pitch, roll), room::kForwardCamera, position);
}

Film film(const CameraPose& at) {
  Film film;
  the_room().render(eye(), at, film.luma.data(), kWidth, film.depth.data());
  return film;
}

// Projects the point of a pixel of view 0, given by its ray and depth, into view 1, and writes its
// depth there. False where view 1 does not see it.
bool carry(const float* ray, float depth, const room::Mat3& R, const Vec3& t, double pixel[2],
           double* depth1) {
  const double scale = depth / ray[2];
  double point[3];
  for (size_t i = 0; i < 3; ++i) {
    point[i] = t[i];
    for (size_t k = 0; k < 3; ++k) point[i] += R[3 * i + k] * scale * ray[k];
  }
  *depth1 = point[2];
  return tv_camera_project(&camera, point, pixel, nullptr) == TV_OK && pixel[0] >= 0 &&
         pixel[1] >= 0 && pixel[0] < kWidth - 1 && pixel[1] < kHeight - 1;
}

float bilinear(const Film& film, const double at[2]) {
  const int x = static_cast<int>(at[0]), y = static_cast<int>(at[1]);
  const float a = static_cast<float>(at[0] - x), b = static_cast<float>(at[1] - y);
  const uint8_t* p = &film.luma[static_cast<size_t>(y * kWidth + x)];
  return (static_cast<float>(p[0]) * (1 - a) + static_cast<float>(p[1]) * a) * (1 - b) +
         (static_cast<float>(p[kWidth]) * (1 - a) + static_cast<float>(p[kWidth + 1]) * a) * b;
}

void test_a_view_is_the_other_one_carried_by_depth_and_pose() {
  const CameraPose pose0 = pose(0, 0, 0, {0, 0, -1.2});
  const CameraPose pose1 = pose(0.04, -0.03, 0.05, {0.15, 0.2, -1.25});
  const Film film0 = film(pose0), film1 = film(pose1);
  room::Mat3 R;
  Vec3 t;
  room::relative_pose(pose0, pose1, R, t);
  int seen = 0, alike = 0;
  for (int y = 0; y < kHeight; y += 3) {
    for (int x = 0; x < kWidth; x += 3) {
      const size_t i = static_cast<size_t>(y * kWidth + x);
      double pixel[2], depth1;
      if (!carry(eye().ray(x, y), film0.depth[i], R, t, pixel, &depth1)) continue;
      const size_t j = static_cast<size_t>(static_cast<int>(pixel[1] + 0.5) * kWidth +
                                           static_cast<int>(pixel[0] + 0.5));
      // View 1 shows another depth at this pixel: a nearer object hides the point.
      if (std::abs(film1.depth[j] - depth1) > 0.02 * depth1) continue;
      ++seen;
      alike += std::abs(bilinear(film1, pixel) - static_cast<float>(film0.luma[i])) < 16;
    }
  }
  TEST_ASSERT_TRUE_MESSAGE(seen > 10000, "too little of the room is in both views");
  TEST_ASSERT_TRUE_MESSAGE(alike > 0.9 * seen, "greys differ");
}

double angle_deg(double cosine) {
  return std::acos(std::fmin(1.0, cosine)) * 180 / 3.14159265358979323846;
}

void test_a_ray_along_an_axis_hits_something() {
  // The rays of the middle column and of the middle row have a component of 0, and the renderer
  // divides by the components. Each pixel must still have a finite depth.
  const Film level = film(pose(0, 0, 0, {0, 0, -1.2}));
  for (const float depth : level.depth) TEST_ASSERT_TRUE(depth > 0 && depth < 20);
}

void test_a_reconstruction_finds_the_true_motion() {
  const CameraPose pose0 = pose(0, 0, 0, {0, -0.3, -1.2}),
                   pose1 = pose(0.03, 0.02, 0, {0, 0.2, -1.2});
  Film films[2] = {film(pose0), film(pose1)};
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = kWidth;
  limits.max_height = kHeight;
  tv_context* context = nullptr;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_new(&context, &limits));
  tv_view views[2];
  for (int k = 0; k < 2; ++k) {
    room::add_sensor_noise(films[k].luma.data(), kWidth, kHeight, kWidth, 2,
                           static_cast<uint64_t>(k));
    tv_view_init(&views[k]);
    views[k].image = tv_image{films[k].luma.data(), kWidth, kHeight, kWidth};
    views[k].camera = &camera;
  }
  tv_two_view two_view;
  tv_two_view_init(&two_view);
  tv_reconstruction result;
  tv_reconstruction_init(&result);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_reconstruct(context, &views[0], &views[1], nullptr, &two_view, nullptr, &result));
  tv_context_free(context);
  TEST_ASSERT_EQUAL_INT(TV_KIND_CALIBRATED, two_view.kind);
  room::Mat3 R;
  Vec3 t;
  room::relative_pose(pose0, pose1, R, t);
  double trace = 0, along = 0, length = 0;
  for (size_t i = 0; i < 9; ++i) trace += R[i] * two_view.R[i];
  for (size_t i = 0; i < 3; ++i) {
    along += t[i] * two_view.t[i];
    length += t[i] * t[i];
  }
  TEST_ASSERT_TRUE(angle_deg((trace - 1) / 2) < 0.1);
  TEST_ASSERT_TRUE(angle_deg(along / std::sqrt(length)) < 0.5);
}

void test_axes_are_forward_right_down() {
  // Nose up: the camera looks above the horizon, so its z axis has a negative world z.
  TEST_ASSERT_TRUE(pose(0, 0.1, 0, {0, 0, -1}).world_from_camera[8] < -0.09);
  // A positive yaw turns the nose to the right, so the camera looks towards +y.
  TEST_ASSERT_TRUE(pose(0.1, 0, 0, {0, 0, -1}).world_from_camera[5] > 0.09);
  // A positive roll lowers the right side, so the camera's x axis points down.
  TEST_ASSERT_TRUE(pose(0, 0, 0.1, {0, 0, -1}).world_from_camera[6] > 0.09);
}

void test_ground_and_free_space_know_the_furniture() {
  TEST_ASSERT_TRUE(std::abs(the_room().height_above_ground({0, 0, -1.5}) - 1.5) < 1e-12);
  TEST_ASSERT_TRUE(std::abs(the_room().height_above_ground({4.4, 2.4, -1.5}) - 0.75) < 1e-12);
  TEST_ASSERT_TRUE(the_room().is_free({0, 0, -1.5}, 0.4));
  TEST_ASSERT_FALSE(the_room().is_free({0, 0, -0.3}, 0.4));
  TEST_ASSERT_FALSE(the_room().is_free({4.45, -1.75, -1.5}, 0.4));
}

void test_a_seed_gives_the_same_room_and_another_one_another() {
  const room::Room same(1), other(2);
  const CameraPose at = pose(0, 0, 0, {0, 0, -1.2});
  const Film first = film(at);
  Film second;
  same.render(eye(), at, second.luma.data(), kWidth);
  TEST_ASSERT_TRUE(first.luma == second.luma);
  other.render(eye(), at, second.luma.data(), kWidth);
  TEST_ASSERT_FALSE(first.luma == second.luma);
}

void test_a_camera_that_is_none_is_refused() {
  tv_camera broken = camera;
  broken.fx = 0;
  bool refused = false;
  try {
    const room::Eye none(broken);
  } catch (const std::invalid_argument&) {
    refused = true;
  }
  TEST_ASSERT_TRUE(refused);
}

}  // namespace

extern "C" void setUp() {}
extern "C" void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_view_is_the_other_one_carried_by_depth_and_pose);
  RUN_TEST(test_a_ray_along_an_axis_hits_something);
  RUN_TEST(test_a_reconstruction_finds_the_true_motion);
  RUN_TEST(test_axes_are_forward_right_down);
  RUN_TEST(test_ground_and_free_space_know_the_furniture);
  RUN_TEST(test_a_seed_gives_the_same_room_and_another_one_another);
  RUN_TEST(test_a_camera_that_is_none_is_refused);
  return UNITY_END();
}
