// Bundle adjustment of many keyframes of a segment, in bounded steps: after a loop, no ten of them
// can hold it closed. Tests: test/unit/test_loop_closure.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// How many bytes the functions below take, of the context's and the scratch memory together. They
// use it from its beginning: nothing else may be in it.
size_t adjust_segment_bytes(const tv_odometry_options& options);

// Adjusts together the keyframes of a segment whose id is at least first_id, with some of the
// points that each one sees; the other points move with their keyframes. One in four of the older
// keyframes is held. Nothing changes where these are more than 256. Returns whether another call
// would change them further.
bool adjust_segment(Odometry* odometry, int32_t segment, int32_t first_id, int32_t max_iterations);

// Adjusts the points of a segment from a place of the map on, as many as a window holds, and not
// its keyframes; then forgets the observations that do not fit. Nothing changes where the segment
// has more than 256 keyframes. Returns the place of the next point.
int32_t adjust_points(Odometry* odometry, int32_t segment, int32_t first, int32_t max_iterations);

}  // namespace tv
