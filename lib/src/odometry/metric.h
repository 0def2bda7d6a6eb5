// Metres and the vertical: what heights, velocities and attitudes say of the map.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// What the frame's sensors say, as far as it can be used: finite, and an attitude that is a
// rotation.
void read_sensors(const tv_odometry_frame& input, Frame* frame);

// Whether the frame's attitude fits its pose in an upright map. An attitude that does not is
// forgotten.
bool check_attitude(const Odometry& odometry, Frame* frame);

// Adds the way from the frame before, which was tracked, to that since the last keyframe.
void add_travel(Odometry* odometry, const Frame& frame);
void forget_travel(Odometry* odometry);

// Adds what the newest keyframe and the one before say of the scale, and gives the segment the
// metre as its unit once the scale is known to a tenth.
void measure_scale(Odometry* odometry, Frame* frame);

void forget_scale(Odometry* odometry);

}  // namespace tv
