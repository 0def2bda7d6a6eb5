// When two frames begin a map (odometry/start.h).

#include <unity.h>

#include <algorithm>
#include <cstdint>

#include "odometry/find_points.h"
#include "odometry/start.h"
#include "support/odometry.h"
#include "support/random.h"

namespace {

constexpr int32_t kNumPoints = 60;

alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;
double points[kNumPoints][3];
uint8_t descriptors[kNumPoints][TV_DESCRIPTOR_BYTES];

// Points in a box before the camera, 1.35 m wide and high, and 4 to 12 m off.
void make_points() {
  uint64_t seed = 7;
  for (int32_t k = 0; k < kNumPoints; ++k) {
    points[k][0] = 0.675 * (2 * random_unit(&seed) - 1);
    points[k][1] = 0.675 * (2 * random_unit(&seed) - 1);
    points[k][2] = 4 + 8 * random_unit(&seed);
    for (uint8_t& byte : descriptors[k]) byte = static_cast<uint8_t>(random_int(&seed, 0, 90));
  }
}

// What a camera at x metres sees, with errors of up to error_px pixels.
void see(int32_t number, double x, double error_px, tv::Frame* frame) {
  uint64_t seed = x > 0 ? 12 : 11;
  for (int32_t k = 0; k < kNumPoints; ++k) {
    const double u = 500 * (points[k][0] - x) / points[k][2] + 320;
    const double v = 500 * points[k][1] / points[k][2] + 240;
    tv_keypoint keypoint{};
    keypoint.x = static_cast<float>(u + error_px * (2 * random_unit(&seed) - 1));
    keypoint.y = static_cast<float>(v + error_px * (2 * random_unit(&seed) - 1));
    keypoint.size = 9;
    keypoint.score = 40;
    frame->keypoints[k] = keypoint;
    frame->sigmas[k] = 1;
    std::copy_n(descriptors[k], TV_DESCRIPTOR_BYTES, frame->descriptors + k * TV_DESCRIPTOR_BYTES);
  }
  frame->num = kNumPoints;
  frame->number = number;
  frame->time_s = number / 30.0;
  frame->sensors = tv::Sensors{};
  frame->cam_from_world = tv::kIdentity;
  tv::forget_points(frame);
}

// Whether frame 0 and the one of that number, seen from 24 cm beside it, begin a map.
bool begins(int32_t number, double error_px) {
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  uint32_t reasons = 0;
  tv::Frame* const frame = &odometry->frame;
  see(0, 0, error_px, frame);
  TEST_ASSERT_FALSE(tv::start_map(odometry, frame, &reasons));
  see(number, 0.24, error_px, frame);
  const bool is_begun = tv::start_map(odometry, frame, &reasons);
  TEST_ASSERT_EQUAL_UINT32(is_begun ? 0 : TV_REASON_LOW_PARALLAX, reasons);
  return is_begun;
}

// The field of view is 16 degrees and the parallax 2: a turn looks much like a step.
void test_near_frames_wait_where_the_turn_is_unsure() {
  TEST_ASSERT_TRUE(begins(3, 0.05));
  TEST_ASSERT_TRUE(begins(6, 0.05));
  TEST_ASSERT_FALSE(begins(5, 0.2));
  TEST_ASSERT_TRUE(begins(6, 0.2));
}

// Frame 0 is matched with 1, 2, 4, 8 and then each sixth frame while nothing moves. A step in frame
// 3 begins a map in frame 4.
void test_a_frame_from_which_nothing_moves_is_tried_less_often() {
  tv::Frame* const frame = &odometry->frame;
  uint32_t reasons = 0;
  for (int32_t number = 0; number <= 20; ++number) {
    see(number, 0, 0.05, frame);
    TEST_ASSERT_FALSE(tv::start_map(odometry, frame, &reasons));
    const int32_t expected = number == 0  ? 0
                             : number < 2 ? 2
                             : number < 4 ? 4
                             : number < 8 ? 8
                                          : 14 + (number - 8) / 6 * 6;
    TEST_ASSERT_EQUAL_INT32(0, odometry->starts[0].number);
    TEST_ASSERT_EQUAL_INT32(expected, odometry->starts[0].next_try);
    TEST_ASSERT_EQUAL(number > 0, (reasons & TV_REASON_LOW_PARALLAX) != 0);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  for (int32_t number = 0; number <= 4; ++number) {
    see(number, number < 3 ? 0 : 0.24, 0.05, frame);
    TEST_ASSERT_EQUAL(number == 4, tv::start_map(odometry, frame, &reasons));
  }
}

}  // namespace

extern "C" void setUp(void) {
  odometry = make_vga_odometry(memory, sizeof memory);
  make_points();
}
extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_near_frames_wait_where_the_turn_is_unsure);
  RUN_TEST(test_a_frame_from_which_nothing_moves_is_tried_less_often);
  return UNITY_END();
}
