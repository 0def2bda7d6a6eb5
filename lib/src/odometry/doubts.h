// What the odometry has against its own map (tv_map_reason), and what it removes because of that.
// docs/algorithms/odometry.md, "Reasons of the map". Tests: test/unit/test_odometry_doubts.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// The reasons of a frame (tv_reason) that those against the map stand for.
uint32_t reasons_of(uint32_t map_reasons);

// The frames of the segment have this reason until one of its keyframes is confirmed.
void doubt(Odometry* odometry, tv_map_reason reason);
void add_doubts(const Odometry& odometry, tv_odometry_state* state);

// Both return false where the map is wrong at the newest frame: what was made since the last
// confirmed keyframe is removed then, and the frame has no pose.

// Compares the map's way with that of the velocities. Where it is wrong, all of a segment that was
// never in metres is removed.
bool heed_velocities(Odometry* odometry, const Frame& frame, uint32_t* map_reasons);

// Takes account of what the pairs of the newest keyframe say of the map.
bool heed_check(Odometry* odometry);

}  // namespace tv
