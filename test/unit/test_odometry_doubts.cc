// When the frames of a flight are "weak" because the map is in doubt (odometry/doubts.cc,
// docs/algorithms/odometry.md, "The map is checked").

#include <unity.h>

#include <cmath>
#include <cstdint>

#include "odometry/metric.h"
#include "support/odometry_flight.h"

namespace {

alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;

// A frame that a check confirms was tracked before, with the map as it was.
void test_the_frame_that_ends_a_doubt_is_in_doubt() {
  int num_ended = 0;
  for (int n = 0; n < 60; ++n) {
    const uint32_t doubts = odometry->doubts;
    const tv_odometry_state state = track_room(odometry, n);
    if (state.status != TV_ODOMETRY_TRACKING && state.status != TV_ODOMETRY_WEAK) continue;
    TEST_ASSERT_EQUAL_UINT32(doubts, state.map_reasons & doubts);
    num_ended += doubts != 0 && odometry->doubts == 0;
  }
  TEST_ASSERT_TRUE(num_ended > 0);
}

// The check of the newest keyframe ends without a decision, because the map does not have the
// keyframe of its last pair.
void test_frames_are_in_doubt_after_keyframes_that_nothing_confirmed() {
  for (const int num_unconfirmed : {2, 3}) {
    odometry = begin_room_flight(memory, sizeof memory);
    int n = 0;
    while (track_room(odometry, n).status != TV_ODOMETRY_TRACKING) ++n;
    tv::MapCheck* check = &odometry->check;
    tv_odometry_state state;
    do {
      check->vote = tv::MapVote{};
      check->num_others = 1;
      check->next = 0;
      check->other_ids[0] = -1;
      check->num_unconfirmed = num_unconfirmed;
      state = track_room(odometry, ++n);
    } while (state.is_keyframe);
    TEST_ASSERT_EQUAL_INT(num_unconfirmed < 3 ? TV_ODOMETRY_TRACKING : TV_ODOMETRY_WEAK,
                          state.status);
    TEST_ASSERT_EQUAL_UINT32(num_unconfirmed < 3 ? 0 : TV_REASON_LOW_PARALLAX, state.reasons);
    TEST_ASSERT_EQUAL_UINT32(num_unconfirmed < 3 ? 0 : TV_MAP_REASON_UNCONFIRMED,
                             state.map_reasons);
    while (!state.is_keyframe) state = track_room(odometry, ++n);
    TEST_ASSERT_EQUAL_UINT32(num_unconfirmed < 3 ? 0 : TV_REASON_LOW_PARALLAX, state.reasons);
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, track_room(odometry, ++n).status);  // confirmed now
  }
}

// Tracks frames until the map is confirmed and has a new keyframe that is adjusted, so that the
// next frames are none and nothing else moves the map.
int confirmed_flight() {
  int n = 0;
  while (track_room(odometry, n).status != TV_ODOMETRY_TRACKING || n < 40) ++n;
  while (!track_room(odometry, ++n).is_keyframe) continue;
  TEST_ASSERT_EQUAL_INT(0, track_room(odometry, ++n).is_keyframe);
  return n;
}

// The newest keyframe's check has this vote, and one pair is left, with this keyframe.
void set_check(const tv::MapVote& vote, int32_t other_id) {
  const tv::Map& map = odometry->map;
  odometry->check.keyframe_id = map.keyframes[map.num_keyframes - 1].id;
  odometry->check.vote = vote;
  odometry->check.num_others = 1;
  odometry->check.next = 0;
  odometry->check.other_ids[0] = other_id;
}

// The last pair, of a keyframe that the map does not have, adds nothing.
void test_frames_are_in_doubt_while_most_pairs_of_a_keyframe_see_one_plane() {
  int n = confirmed_flight();
  tv_odometry_state state;
  for (const int num_planar : {1, 2}) {
    set_check({2, 0, 0, num_planar}, -1);
    state = track_room(odometry, ++n);
    const bool is_doubtful = num_planar == 2;
    TEST_ASSERT_EQUAL_INT(0, state.is_keyframe);
    TEST_ASSERT_EQUAL_INT(is_doubtful ? TV_ODOMETRY_WEAK : TV_ODOMETRY_TRACKING, state.status);
    TEST_ASSERT_EQUAL_UINT32(is_doubtful ? TV_MAP_REASON_ONE_PLANE : 0, state.map_reasons);
    TEST_ASSERT_EQUAL_UINT32(is_doubtful ? TV_REASON_TWO_PLANAR_SOLUTIONS : 0, state.reasons);
  }
  while (!state.is_keyframe) state = track_room(odometry, ++n);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, track_room(odometry, ++n).status);  // confirmed now
}

// An earlier keyframe lies turned in the map, so that each of the newest one's pairs with it
// contradicts the map. The first may be wrong.
void test_the_frame_is_lost_in_which_a_second_pair_contradicts_the_map() {
  int n = confirmed_flight();
  tv::Map& map = odometry->map;
  const int32_t num = map.num_keyframes, confirmed_id = map.keyframes[num - 3].id;
  tv::MapKeyframe& other = map.keyframes[num - 2];
  const double c = std::cos(0.2), s = std::sin(0.2);
  other.cam_from_world =
      tv::compose(tv::Rigid{{c, -s, 0, s, c, 0, 0, 0, 1}, {0, 0, 0}}, other.cam_from_world);
  odometry->confirmed_id = confirmed_id;
  set_check({}, other.id);
  TEST_ASSERT_EQUAL_UINT32(0, track_room(odometry, ++n).map_reasons);
  TEST_ASSERT_EQUAL_INT(1, odometry->check.vote.num_disagree);
  TEST_ASSERT_EQUAL_INT(num, map.num_keyframes);
  set_check(odometry->check.vote, other.id);
  tv_odometry_state state = track_room(odometry, ++n);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, state.status);
  TEST_ASSERT_EQUAL_INT(0, state.has_pose);
  TEST_ASSERT_EQUAL_UINT32(TV_MAP_REASON_CONTRADICTED, state.map_reasons);
  TEST_ASSERT_EQUAL_UINT32(TV_REASON_TWO_PLANAR_SOLUTIONS, state.reasons);
  TEST_ASSERT_EQUAL_INT(confirmed_id, map.keyframes[map.num_keyframes - 1].id);
  // Found again, and in doubt until a keyframe is confirmed. This frame becomes one, whose pairs
  // may be a reason, too.
  state = track_room(odometry, ++n);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_WEAK, state.status);
  TEST_ASSERT_TRUE((state.map_reasons & TV_MAP_REASON_CONTRADICTED) != 0);
  TEST_ASSERT_EQUAL_UINT32(TV_REASON_TWO_PLANAR_SOLUTIONS, state.reasons);
  while (odometry->doubts != 0) state = track_room(odometry, ++n);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, track_room(odometry, ++n).status);
}

// The metres in a unit of the map, by the velocities.
double known_scale() {
  const tv::ScaleEstimate estimate = tv::velocity_estimate(odometry->scale);
  return estimate.product / estimate.square;
}

// Velocities that are believed contradict the map since the last confirmed keyframe, where its ways
// are a fifth of theirs.
void test_a_map_that_is_removed_says_nothing_of_the_scale() {
  constexpr int kWrong = 3;
  int n = 0;
  while (!track_room(odometry, n).is_keyframe || n < 60) ++n;
  track_room(odometry, ++n);  // the keyframe is adjusted
  tv::Map& map = odometry->map;
  const int32_t num = map.num_keyframes;
  TEST_ASSERT_TRUE(num > 2 * kWrong);
  for (int32_t k = 1; k < num; ++k) {
    tv::MapKeyframe& own = map.keyframes[k];
    const tv::Rigid back = tv::motion_between((&own)[-1].cam_from_world, own.cam_from_world);
    for (int c = 0; c < 3; ++c) own.way_m[c] = (k < num - kWrong ? -2 : -10) * back.t[c];
    own.way_variance = 1e-4;
    own.is_followed = true;
  }
  tv::gather_ways(odometry);
  TEST_ASSERT_TRUE(known_scale() > 2.1);
  odometry->confirmed_id = map.keyframes[num - kWrong - 1].id;
  odometry->scale.was_known = true;  // else all of the segment is removed
  odometry->velocity_trust = odometry->num_contrary = 100;
  odometry->travel.is_known = true;
  odometry->travel.way_m[0] = 10;
  const tv_odometry_state lost = track_room(odometry, ++n, false, 0.01);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, lost.status);
  TEST_ASSERT_EQUAL_UINT32(TV_MAP_REASON_VELOCITIES_DISAGREE, lost.map_reasons);
  TEST_ASSERT_EQUAL_UINT32(TV_REASON_SECOND_MOTION, lost.reasons);
  TEST_ASSERT_EQUAL_INT(num - kWrong, map.num_keyframes);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2, known_scale());
}

// A keyframe that is put off its place goes back in its adjustment, before the next frame or when
// the caller asks for it.
void test_the_frame_after_a_large_adjustment_is_weak() {
  for (int k = 0; k < 4; ++k) {
    const bool is_large = k % 2 != 0, is_asked_for = k >= 2;
    odometry = begin_room_flight(memory, sizeof memory);
    int n = 0;
    while (track_room(odometry, n).status != TV_ODOMETRY_TRACKING) ++n;
    while (!track_room(odometry, ++n).is_keyframe) continue;
    tv::Map& map = odometry->map;
    tv::Rigid* pose = &map.keyframes[map.num_keyframes - 1].cam_from_world;
    const double path = tv::way_between(map.keyframes[0].cam_from_world, *pose);
    pose->t[1] += (is_large ? 0.06 : 0.01) * path;
    if (is_asked_for) tv_odometry_finish(odometry);
    tv_odometry_state state = track_room(odometry, ++n);
    TEST_ASSERT_EQUAL_INT(is_large ? TV_ODOMETRY_WEAK : TV_ODOMETRY_TRACKING, state.status);
    TEST_ASSERT_EQUAL_UINT32(is_large ? TV_REASON_LOW_PARALLAX : 0, state.reasons);
    TEST_ASSERT_EQUAL_UINT32(is_large ? TV_MAP_REASON_JUMPED : 0, state.map_reasons);
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, track_room(odometry, ++n).status);
  }
}

// A keyframe adds what its attitude is uncertain by; where a segment begins, nothing is.
void test_frames_are_weak_while_the_keyframes_turns_are_unsure_together() {
  for (const double drift_deg : {1.4, 1.6}) {
    odometry = begin_room_flight(memory, sizeof memory);
    int n = 0;
    while (track_room(odometry, n).status != TV_ODOMETRY_TRACKING) ++n;
    double sum_sq = odometry->drift_sq = drift_deg * drift_deg / (57.29578 * 57.29578);
    for (int num_keyframes = 0; num_keyframes < 3;) {
      const tv_odometry_state state = track_room(odometry, ++n);
      if (state.is_keyframe) {
        ++num_keyframes;
        double largest_sq = 0;
        for (int k = 0; k < 3; ++k)
          largest_sq = fmax(largest_sq, state.cam_from_world_covariance[7 * k]);
        sum_sq += largest_sq;
      }
      TEST_ASSERT_DOUBLE_WITHIN(1e-15, sum_sq, odometry->drift_sq);
      TEST_ASSERT_EQUAL_INT(drift_deg < 1.5 ? TV_ODOMETRY_TRACKING : TV_ODOMETRY_WEAK,
                            state.status);
      TEST_ASSERT_EQUAL_UINT32(drift_deg < 1.5 ? 0 : TV_REASON_LOW_PARALLAX, state.reasons);
      TEST_ASSERT_EQUAL_UINT32(drift_deg < 1.5 ? 0 : TV_MAP_REASON_UNSURE_ATTITUDE,
                               state.map_reasons);
    }
  }
  odometry->drift_sq = 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  TEST_ASSERT_EQUAL_DOUBLE(0, odometry->drift_sq);
  odometry->drift_sq = 1;
  int n = 0;
  while (!track_room(odometry, n).is_keyframe) ++n;
  TEST_ASSERT_EQUAL_DOUBLE(0, odometry->drift_sq);
}

}  // namespace

extern "C" void setUp(void) { odometry = begin_room_flight(memory, sizeof memory); }
extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_the_frame_that_ends_a_doubt_is_in_doubt);
  RUN_TEST(test_frames_are_in_doubt_after_keyframes_that_nothing_confirmed);
  RUN_TEST(test_frames_are_in_doubt_while_most_pairs_of_a_keyframe_see_one_plane);
  RUN_TEST(test_the_frame_is_lost_in_which_a_second_pair_contradicts_the_map);
  RUN_TEST(test_a_map_that_is_removed_says_nothing_of_the_scale);
  RUN_TEST(test_the_frame_after_a_large_adjustment_is_weak);
  RUN_TEST(test_frames_are_weak_while_the_keyframes_turns_are_unsure_together);
  return UNITY_END();
}
