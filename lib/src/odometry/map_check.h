// The map is checked by pairs of keyframes, whose matches do not depend on it.
// docs/algorithms/odometry.md, "The map is checked". Tests: test/unit/test_map_check.cc.
#pragma once

#include "odometry/frame_pair.h"

namespace tv {

// What pairs of keyframes say of the map.
enum class MapVerdict {
  kUnknown,      // the pairs do not determine their motion
  kAgrees,       // a pair that is beyond doubt turned as the map says
  kOnePlane,     // most pairs see one plane, which two motions explain
  kContradicts,  // two pairs that are beyond doubt turned otherwise
};

// Estimates a pair and adds what it says of its keyframes' relative pose cam1_from_cam0.
void add_vote(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
              const tv_correspondence* matches, int32_t num, const Rigid& cam1_from_cam0,
              MapVote* vote);

// Whether another pair may change the verdict.
bool needs_vote(const MapVote& vote);
MapVerdict verdict_of(const MapVote& vote);

// Whether the pairs so far make the map doubtful, so that the next ones should not wait.
bool is_urgent(const MapVote& vote);

// Whether no pair confirmed this keyframe yet, nor the three before it: what is wrong by less than
// a pair notices adds up from one to the next.
bool is_unconfirmed(const MapCheck& check);

// Begins the check of a keyframe.
void begin_check(Odometry* odometry, int32_t keyframe_id);

// A pair with this keyframe takes part later, as long as pairs are needed.
void add_pair(MapCheck* check, int32_t other_id);

// Whether a pair with an earlier keyframe is still to be estimated.
bool is_checking(const MapCheck& check);

// Matches the next pair, and adds its vote. One a frame, so that no frame takes long.
void check_next_pair(Odometry* odometry);

}  // namespace tv
