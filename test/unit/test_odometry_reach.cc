// Where a lost frame may be found (odometry/metric.h): as far from the last confirmed keyframe as
// its velocities took it, and turned as the attitudes say.

#include <unity.h>

#include <cmath>
#include <cstdint>

#include "odometry/map.h"
#include "odometry/metric.h"
#include "support/odometry.h"
#include "support/odometry_flight.h"

namespace {

alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;

// cam_from_world after a turn about the vertical axis, from a camera at x.
tv::Rigid camera_at(double x, double turn_rad) {
  const double c = std::cos(turn_rad), s = std::sin(turn_rad);
  return tv::Rigid{{c, 0, s, 0, 1, 0, -s, 0, c}, {-c * x, 0, s * x}};
}

constexpr double kNone = -9;

// A frame whose attitude is the turn `sensed_rad`, if that is not kNone, at a speed in m/s.
tv::Frame frame_at(double x, double turn_rad, double sensed_rad, double speed) {
  tv::Frame frame{};
  frame.cam_from_world = camera_at(x, turn_rad);
  if (sensed_rad != kNone) {
    const tv::Rigid world_from_cam = tv::inverse(camera_at(0, sensed_rad));
    for (int k = 0; k < 9; ++k) frame.sensors.world_from_cam[k] = world_from_cam.R[k];
    frame.sensors.attitude_sigma_rad = 0.02;
  }
  frame.sensors.velocity_m_s[0] = speed;
  frame.sensors.velocity_sigma_m_s = 0.1 * speed;
  return frame;
}

// A keyframe at 0 is confirmed, and three frames, a second apart, follow without a pose.
void begin(double sensed_rad, double speed, bool gap) {
  const tv_keypoint no_keypoint{};
  const uint8_t no_descriptor = 0;
  const int32_t k = tv::add_keyframe(&odometry->map, &no_keypoint, &no_descriptor, 0);
  odometry->map.keyframes[k].cam_from_world = camera_at(0, 0);
  odometry->confirmed_id = odometry->map.keyframes[k].id;
  odometry->scale.source = TV_SCALE_VELOCITY;
  odometry->median_depth = 2;
  const tv::Frame frame = frame_at(0, 0, sensed_rad, speed);
  tv::measure_reach(*odometry, frame, &odometry->confirmed);
  for (int n = 0; n < 3; ++n) {
    tv::Frame next = frame;
    next.time_s = odometry->last_time_s + 1;
    tv::add_reach(odometry, next, gap && n == 1);
    odometry->last_time_s = next.time_s;
  }
}

bool reaches(double x, double turn_rad, double sensed_rad) {
  return tv::is_reachable(*odometry, frame_at(x, turn_rad, sensed_rad, 1));
}

// 3 s at 1 m/s with a standard deviation of 0.1: 3.6 m and a quarter, and half of the median depth.
void test_a_lost_frame_is_as_near_as_its_velocities_took_it() {
  begin(0, 1, false);
  TEST_ASSERT_TRUE(reaches(5.4, 0, 0));
  TEST_ASSERT_TRUE(reaches(-5.4, 0, 0));
  TEST_ASSERT_FALSE(reaches(5.6, 0, 0));
  odometry->scale.source = TV_SCALE_UNIT;  // of a map without a metre
  TEST_ASSERT_TRUE(reaches(5.6, 0, 0));
}

void test_a_lost_frame_is_turned_as_its_attitude_says() {
  begin(0.3, 1, false);
  TEST_ASSERT_TRUE(reaches(1, 0.5, 0.8));
  TEST_ASSERT_TRUE(reaches(1, 0.9, 0.8));
  TEST_ASSERT_FALSE(reaches(1, 1.2, 0.8));
  TEST_ASSERT_FALSE(reaches(1, -0.1, 0.8));
  TEST_ASSERT_TRUE(reaches(1, -0.1, kNone));
}

void test_the_way_is_not_bounded_without_velocities_or_after_a_gap() {
  begin(kNone, 0, false);
  TEST_ASSERT_TRUE(reaches(100, 2, 0));
  begin(0, 1, true);
  TEST_ASSERT_TRUE(reaches(100, 0, 0));
  TEST_ASSERT_FALSE(reaches(100, 2, 0));
}

void test_a_keyframe_of_another_segment_says_nothing() {
  begin(0, 1, false);
  odometry->segment = 1;
  TEST_ASSERT_TRUE(reaches(100, 2, 0));
}

// A loop that turns much is believed only then (odometry/loop_closure.h, is_plausible).
void test_a_lost_frame_that_is_found_again_is_remembered() {
  odometry = begin_room_flight(memory, sizeof memory);
  for (int n = 0; n < 39; ++n) {
    track_room(odometry, n, n == 37 || n == 38);
    TEST_ASSERT_FALSE(odometry->is_found_again);
  }
  TEST_ASSERT_TRUE(track_room(odometry, 39).relocated);
  TEST_ASSERT_TRUE(odometry->is_found_again);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  TEST_ASSERT_FALSE(odometry->is_found_again);
}

}  // namespace

extern "C" void setUp(void) { odometry = make_vga_odometry(memory, sizeof memory); }
extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_lost_frame_is_as_near_as_its_velocities_took_it);
  RUN_TEST(test_a_lost_frame_is_turned_as_its_attitude_says);
  RUN_TEST(test_the_way_is_not_bounded_without_velocities_or_after_a_gap);
  RUN_TEST(test_a_keyframe_of_another_segment_says_nothing);
  RUN_TEST(test_a_lost_frame_that_is_found_again_is_remembered);
  return UNITY_END();
}
