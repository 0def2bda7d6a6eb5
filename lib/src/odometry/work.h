// The queue of work: what a frame leaves to those that follow, so that no frame takes the time of
// all of it. One piece of work is done before each frame is tracked. docs/algorithms/odometry.md,
// "Queue of work". Tests: test/unit/test_odometry_state.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// The piece of work that comes next.
Work next_work(const Odometry& odometry);

// Does it, and returns which it was. `frame`: the last one that was tracked; its pose moves with
// the map.
Work do_next_work(Odometry* odometry, Frame* frame);

// Does all of it.
void finish_work(Odometry* odometry);

}  // namespace tv
