// What a loop, or a correction of the camera, leaves to the frames that follow: many keyframes are
// adjusted together, a step a frame, and then the points alone, some at a frame.
// docs/algorithms/odometry.md, "Queue of work". Tests: test/unit/test_loop_closure.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

inline constexpr int32_t kSpreadSteps = 12;  // of the keyframes together, at most

// The keyframes of a segment from this id on are to be adjusted together, and then its points. The
// map has keyframes.
void begin_spread(Odometry* odometry, int32_t segment, int32_t first_id);

// Whether a part of it is left. Until then no other loop is looked for.
bool is_spreading(const Odometry& odometry);

// Does the next part. `frame`, whose pose is relative to the reference keyframe, moves with it.
void step_spread(Odometry* odometry, Frame* frame);

}  // namespace tv
