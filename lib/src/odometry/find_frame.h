// Where a frame is, by the points of the map that it sees, or by its turn since the frame before.
// What is tried when: odometry/tracking_state.h.
#pragma once

#include "odometry/fit_pose.h"

namespace tv {

// Each of the functions below returns whether it has found the frame's pose.

// Looks for the points around the reference keyframe where the motion of the frames before predicts
// them; after a gap, where the frame before saw them.
bool follow_map(Odometry* odometry, bool has_gap, Frame* frame, PoseFit* fit);

// Looks for the frame in `count` keyframes, from number `from` down. The points around the one in
// which it was found are those that are looked for in the next frame. is_locating: it is a frame of
// tv_odometry_locate, which may be anywhere, and for which no point counts as looked for.
bool find_in_keyframes(Odometry* odometry, int32_t from, int32_t count, bool is_locating,
                       Frame* frame, PoseFit* fit);

// Looks for the frame in a few keyframes, the newest ones if it is the first of a search, else
// those before the ones of the last call. The frames that follow belong to the segment where it is
// found.
bool search_map(Odometry* odometry, bool is_first, Frame* frame, PoseFit* fit);

// The map does not reach the frame: estimates its turn since the frame before. The camera's centre
// stays.
bool follow_turn(Odometry* odometry, Frame* frame);

}  // namespace tv
