// What stands still in the picture of the odometry (odometry/still_cells.h): text over a flight is
// found, and what has gone is used again.

#include "odometry/still_cells.h"

#include <unity.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "support/room_scene.h"

namespace {

constexpr int kFrames = 60;
alignas(64) uint8_t memory[2][24 << 20];
uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT], mask[ROOM_WIDTH * ROOM_HEIGHT];

tv_odometry* begin(int which) {
  const tv_camera camera = room_camera();
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  tv_odometry* odometry = nullptr;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_odometry_init(&odometry, &camera, &options, memory[which], sizeof memory[which]));
  return odometry;
}

// Lines of text at the left.
bool is_text(int x, int y) { return y % 40 >= 20 && y % 40 < 32 && x < 90; }

// Black and white in blocks of 4 pixels, by chance.
uint8_t text_at(int x, int y) {
  uint32_t h = static_cast<uint32_t>(x / 4) * 2654435761u + static_cast<uint32_t>(y / 4) * 40503u;
  h = (h ^ (h >> 15)) * 2246822519u;
  return (h >> 28 & 1) != 0 ? 250 : 5;
}

// Frame n of the flight.
tv_odometry_state track(tv_odometry* odometry, int n, bool has_text) {
  room_flight(n, pixels);
  for (int y = 0; has_text && y < ROOM_HEIGHT; ++y) {
    for (int x = 0; x < ROOM_WIDTH; ++x) {
      if (is_text(x, y)) pixels[y * ROOM_WIDTH + x] = text_at(x, y);
    }
  }
  tv_odometry_frame frame;
  tv_odometry_frame_init(&frame);
  frame.image = {pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
  frame.time_s = n / 30.0;
  tv_odometry_state state;
  tv_odometry_state_init(&state);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
  return state;
}

// The turn of the camera in the room, of frame n.
double yaw_of(int n) { return 0.12 * std::sin(0.06 * n); }

void test_text_is_found_and_does_not_hold_the_camera() {
  tv_odometry* const odometry = begin(0);
  int first = -1;
  tv_odometry_state state{}, at_first{};
  for (int n = 0; n < kFrames; ++n) {
    state = track(odometry, n, true);
    if (first >= 0 || !state.has_pose) continue;
    first = n;
    at_first = state;
  }
  TEST_ASSERT_TRUE(first >= 0 && state.has_pose);
  TEST_ASSERT_TRUE(state.still_share > 0.03);
  // Its turn since the first pose is the true one; text alone would hold it at 0.
  double c = 0;
  for (int k = 0; k < 3; ++k) {
    c += state.world_from_cam_R[3 * k + 2] * at_first.world_from_cam_R[3 * k + 2];
  }
  const double turned = std::fabs(yaw_of(kFrames - 1) - yaw_of(first));
  TEST_ASSERT_TRUE(turned > 0.045);
  TEST_ASSERT_DOUBLE_WITHIN(0.02, turned, std::acos(std::fmin(c, 1.0)));
  // What is left out lies where the text is.
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_still_mask(odometry, mask, sizeof mask));
  for (int x = 110; x < ROOM_WIDTH; ++x) {
    for (int y = 0; y < ROOM_HEIGHT; ++y) TEST_ASSERT_EQUAL_UINT8(255, mask[y * ROOM_WIDTH + x]);
  }
}

void test_a_flight_without_text_has_nothing_that_stands_still() {
  tv_odometry* const odometry = begin(0);
  for (int n = 0; n < kFrames; ++n) TEST_ASSERT_TRUE(track(odometry, n, false).still_share == 0);
}

// A cell is left out for 300 frames, and twice as long when it is found to stand still again.
void test_a_cell_is_looked_into_again() {
  tv_odometry* const odometry = begin(1);
  tv_keypoint keypoint{};
  keypoint.x = 52;
  keypoint.y = 36;
  keypoint.size = 1;
  tv_correspondence match{};
  const double share = 1.0 / (40 * 30);
  for (int times = 0; times < 2; ++times) {
    const int32_t before = odometry->num_frames;
    tv::mark_still(odometry, &keypoint, &keypoint, &match, 1);
    tv::mark_still(odometry, &keypoint, &keypoint, &match, 1);  // once counts
    TEST_ASSERT_TRUE(tv::still_share(*odometry) == share);
    const tv_image given = {pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
    std::memset(pixels, 9, sizeof pixels);
    tv::write_mask(*odometry, &given, mask);
    for (int k = 0; k < ROOM_WIDTH * ROOM_HEIGHT; ++k) {
      const bool is_left_out = k % ROOM_WIDTH / 8 == 6 && k / ROOM_WIDTH / 8 == 4;
      TEST_ASSERT_EQUAL_UINT8(is_left_out ? 0 : 9, mask[k]);
    }
    odometry->num_frames = before + (300 << times) - 1;
    TEST_ASSERT_TRUE(tv::still_share(*odometry) == share);
    odometry->num_frames += 1;
    TEST_ASSERT_TRUE(tv::still_share(*odometry) == 0);
  }
}

void test_a_match_that_moves_marks_nothing() {
  tv_odometry* const odometry = begin(1);
  tv_keypoint keypoints[2] = {};
  keypoints[0].x = keypoints[1].x = 52;
  keypoints[0].y = 36;
  keypoints[1].y = 38.1f;
  keypoints[0].size = keypoints[1].size = 4;
  tv_correspondence match{};
  tv::mark_still(odometry, &keypoints[0], &keypoints[1], &match, 1);
  TEST_ASSERT_TRUE(tv::still_share(*odometry) == 0);
}

}  // namespace

void setUp() {}

void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_text_is_found_and_does_not_hold_the_camera);
  RUN_TEST(test_a_flight_without_text_has_nothing_that_stands_still);
  RUN_TEST(test_a_cell_is_looked_into_again);
  RUN_TEST(test_a_match_that_moves_marks_nothing);
  return UNITY_END();
}
