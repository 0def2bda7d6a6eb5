// The queue of work: what a frame leaves to those that follow, so that no frame takes the time of
// all of it. One piece of work is done before each frame is tracked. docs/algorithms/odometry.md,
// "Queue of work". Tests: test/unit/test_odometry_state.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// Which piece of work is the next one to be done.
Work next_work(const Odometry& odometry);

// Does the next piece of work, and returns which one it was. `frame`: the frame that was tracked
// last, whose pose is moved with the map.
Work do_next_work(Odometry* odometry, Frame* frame);

// Does all work that is left.
void finish_work(Odometry* odometry);

}  // namespace tv
