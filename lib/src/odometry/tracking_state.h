// The states of the odometry: in which of them the newest frame is, what is tried for the next one,
// and where each outcome leads. docs/algorithms/odometry.md, "States". Tests:
// test/unit/test_odometry_state.cc.
#pragma once

#include <cstdint>

#include "twoview/odometry.h"

namespace tv {

// How the pose of a frame is known.
enum class TrackingState : int32_t {
  kStarting,  // not at all: there is no map
  kTracked,   // from points of the map
  kTurned,    // the map does not reach it: from its turn since the frame before
  kLost,      // not at all
};

// What is found out about a frame, in the order in which it is tried.
enum class TrackingEvent : int32_t {
  kFollowed,      // points of the map are where the motion so far predicts them
  kFound,         // it was found among the keyframes of the map
  kContradicted,  // one of the two; but the map is wrong there, and was cut back
  kTurned,        // it is a turn of the frame before
  kBegan,         // it begins a map, or another segment of it
  kMissed,        // none of these
};

struct Tracking {
  TrackingState state;
  int32_t num_away;  // frames since the last one that had a pose from points of the map
};

// Whether this is tried for the next frame.
bool may_try(const Tracking& tracking, TrackingEvent event);

// Sets the state that follows from this event.
void move_on(TrackingEvent event, Tracking* tracking);

// Whether a frame in this state has a pose.
bool has_pose(TrackingState state);

// The status of a frame in this state, with these reasons (tv_reason) against its pose.
tv_odometry_status status_of(TrackingState state, uint32_t reasons);

}  // namespace tv
