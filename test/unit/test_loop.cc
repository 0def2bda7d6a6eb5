// What a loop does to the scale that sensors gave (odometry/loop.h), with keyframes that see no
// points.

#include <unity.h>

#include <cstdint>

#include "odometry/loop.h"
#include "odometry/map.h"

namespace {

constexpr int kNum = 20;
alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;

// Keyframes on a line, 0.1 apart.
void add_keyframes() {
  const tv_keypoint no_keypoint{};
  const uint8_t no_descriptor = 0;
  for (int k = 0; k < kNum; ++k) {
    const int32_t at = tv::add_keyframe(&odometry->map, &no_keypoint, &no_descriptor, 0);
    odometry->map.keyframes[at].cam_from_world = tv::kIdentity;
    odometry->map.keyframes[at].cam_from_world.t[0] = -0.1 * k;
  }
}

double path_length() {
  const tv::MapKeyframe* k = odometry->map.keyframes;
  double length = 0;
  for (int i = 1; i < kNum; ++i) {
    length += tv::way_between(k[i - 1].cam_from_world, k[i].cam_from_world);
  }
  return length;
}

void test_the_metre_keeps_its_length_when_a_loop_stretches_the_path() {
  add_keyframes();
  odometry->scale.product = 40;
  odometry->scale.square = 50;
  const double before_m = 0.8 * path_length();
  tv::LoopEnd end = {0, tv::kIdentity, 1.2};
  end.cam_from_world.t[0] = -2.2;  // it was at 1.9
  const tv::Frame nothing{};
  tv::close_loop(odometry, kNum - 1, nothing, end);
  TEST_ASSERT_TRUE(path_length() > 2.1);
  const double scale = odometry->scale.product / odometry->scale.square;
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, before_m, scale * path_length());
  // The relative precision of the scale is the same.
  const double product = odometry->scale.product;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 50.0 / (40 * 40), odometry->scale.square / (product * product));
}

}  // namespace

extern "C" void setUp(void) {
  const tv_camera camera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {0}};
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_odometry_init(&odometry, &camera, nullptr, memory, sizeof memory));
}

extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_the_metre_keeps_its_length_when_a_loop_stretches_the_path);
  return UNITY_END();
}
