// What the odometry tries for a frame in each of its states, where each outcome leads
// (odometry/tracking_state.h), and what waits until a frame has time for it (odometry/work.h).

#include <unity.h>

#include <cstdint>

#include "odometry/spread.h"
#include "odometry/tracking_state.h"
#include "odometry/work.h"
#include "support/odometry_flight.h"

namespace {

using tv::Tracking;
using tv::TrackingEvent;
using tv::TrackingState;

// After so many frames of which nothing else was found out.
Tracking after(Tracking tracking, TrackingEvent event, int num_times) {
  for (int n = 0; n < num_times; ++n) {
    TEST_ASSERT_TRUE(event == TrackingEvent::kMissed || tv::may_try(tracking, event));
    tv::move_on(event, &tracking);
  }
  return tracking;
}

constexpr Tracking kAtStart = {TrackingState::kStarting, 0};
constexpr Tracking kOnMap = {TrackingState::kTracked, 0};

void test_without_a_map_only_a_start_is_tried() {
  for (const int num_frames : {0, 1, 100}) {
    const Tracking tracking = after(kAtStart, TrackingEvent::kMissed, num_frames);
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_STARTING, tv::status_of(tracking.state, 0));
    TEST_ASSERT_TRUE(tv::may_try(tracking, TrackingEvent::kBegan));
    TEST_ASSERT_FALSE(tv::may_try(tracking, TrackingEvent::kFollowed));
    TEST_ASSERT_FALSE(tv::may_try(tracking, TrackingEvent::kFound));
    TEST_ASSERT_FALSE(tv::may_try(tracking, TrackingEvent::kTurned));
    const Tracking begun = after(tracking, TrackingEvent::kBegan, 1);
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_WEAK, tv::status_of(begun.state, TV_REASON_LOW_PARALLAX));
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, tv::status_of(begun.state, 0));
    TEST_ASSERT_EQUAL_INT(0, begun.num_away);
  }
}

void test_a_tracked_frame_is_followed_searched_and_turned_but_begins_no_segment() {
  TEST_ASSERT_TRUE(tv::may_try(kOnMap, TrackingEvent::kFollowed));
  TEST_ASSERT_TRUE(tv::may_try(kOnMap, TrackingEvent::kFound));
  TEST_ASSERT_TRUE(tv::may_try(kOnMap, TrackingEvent::kTurned));
  TEST_ASSERT_FALSE(tv::may_try(kOnMap, TrackingEvent::kBegan));
}

// The camera may come back to what the map shows, at the place that is predicted or at another.
void test_a_turn_keeps_its_pose_for_sixty_frames() {
  const Tracking turned = after(kOnMap, TrackingEvent::kTurned, 60);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_ROTATION, tv::status_of(turned.state, 0));
  TEST_ASSERT_TRUE(tv::has_pose(turned.state));
  TEST_ASSERT_TRUE(tv::may_try(turned, TrackingEvent::kFollowed));
  TEST_ASSERT_FALSE(tv::may_try(turned, TrackingEvent::kTurned));
  const Tracking back = after(turned, TrackingEvent::kFollowed, 1);
  TEST_ASSERT_TRUE(tv::may_try(back, TrackingEvent::kTurned));
  TEST_ASSERT_EQUAL_INT(0, back.num_away);
}

void test_a_lost_frame_is_only_looked_for_in_the_map() {
  const Tracking lost = after(kOnMap, TrackingEvent::kMissed, 1);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, tv::status_of(lost.state, 0));
  TEST_ASSERT_FALSE(tv::has_pose(lost.state));
  TEST_ASSERT_FALSE(tv::may_try(lost, TrackingEvent::kFollowed));
  TEST_ASSERT_FALSE(tv::may_try(lost, TrackingEvent::kTurned));
  TEST_ASSERT_TRUE(tv::may_try(lost, TrackingEvent::kFound));
  TEST_ASSERT_EQUAL_INT(0, after(lost, TrackingEvent::kFound, 1).num_away);
}

// Turned frames have no pose from the map, either.
void test_a_segment_is_begun_in_the_ninth_frame_away_from_the_map() {
  for (const TrackingEvent event : {TrackingEvent::kMissed, TrackingEvent::kTurned}) {
    TEST_ASSERT_FALSE(tv::may_try(after(kOnMap, event, 7), TrackingEvent::kBegan));
    TEST_ASSERT_TRUE(tv::may_try(after(kOnMap, event, 8), TrackingEvent::kBegan));
  }
}

void test_a_frame_in_which_the_map_is_contradicted_is_the_first_one_away() {
  for (const int num_missed : {0, 20}) {
    Tracking tracking = after(kOnMap, TrackingEvent::kMissed, num_missed);
    tv::move_on(TrackingEvent::kContradicted, &tracking);
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, tv::status_of(tracking.state, 0));
    TEST_ASSERT_EQUAL_INT(1, tracking.num_away);
  }
}

alignas(64) uint8_t memory[24 << 20];

// The newest keyframe comes before what a loop left, and each frame does one piece.
void test_a_piece_of_work_is_done_for_each_frame_the_newest_keyframe_first() {
  tv_odometry* odometry = begin_room_flight(memory, sizeof memory);
  TEST_ASSERT_TRUE(tv::next_work(*odometry) == tv::Work::kNone);
  int n = 0;
  while (track_room(odometry, n).status != TV_ODOMETRY_TRACKING || n < 30) ++n;
  while (!track_room(odometry, ++n).is_keyframe) continue;
  TEST_ASSERT_TRUE(tv::next_work(*odometry) == tv::Work::kFinishKeyframe);
  tv::begin_spread(odometry, 0, 0);
  TEST_ASSERT_TRUE(tv::next_work(*odometry) == tv::Work::kFinishKeyframe);
  const int32_t num_steps = odometry->spread.num_steps;
  track_room(odometry, ++n);
  TEST_ASSERT_TRUE(odometry->done == tv::Work::kFinishKeyframe);
  TEST_ASSERT_EQUAL_INT(num_steps, odometry->spread.num_steps);
  TEST_ASSERT_TRUE(tv::next_work(*odometry) == tv::Work::kStepSpread);
  track_room(odometry, ++n);
  TEST_ASSERT_TRUE(odometry->done == tv::Work::kStepSpread);
  TEST_ASSERT_TRUE(odometry->spread.num_steps < num_steps);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
  TEST_ASSERT_TRUE(tv::next_work(*odometry) == tv::Work::kNone);
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_without_a_map_only_a_start_is_tried);
  RUN_TEST(test_a_tracked_frame_is_followed_searched_and_turned_but_begins_no_segment);
  RUN_TEST(test_a_turn_keeps_its_pose_for_sixty_frames);
  RUN_TEST(test_a_lost_frame_is_only_looked_for_in_the_map);
  RUN_TEST(test_a_segment_is_begun_in_the_ninth_frame_away_from_the_map);
  RUN_TEST(test_a_frame_in_which_the_map_is_contradicted_is_the_first_one_away);
  RUN_TEST(test_a_piece_of_work_is_done_for_each_frame_the_newest_keyframe_first);
  return UNITY_END();
}
