// The planes of a room, from its measured surface. docs/algorithms/room.md.
#pragma once

#include "room/blocks.h"

namespace tv {

// The least area by default, in squares of a voxel's side: 40 sides of a block.
inline constexpr double kLeastArea = 640;

struct PlaneRequest {
  int32_t min_maps_behind;  // that have seen what lies behind a plane
  double min_area;
  bool has_gravity;
  double up[3];  // unit vector, where gravity is known
  double gravity_sigma;
};

// The unit vector against gravity, which may have any length. False: it is (0, 0, 0), not known.
bool up_of(const double gravity[3], double up[3]);

// Finds up to cap planes, the largest first, and returns how many there are.
int32_t find_planes(tv_room& room, const PlaneRequest& request, tv_room_plane* planes, int32_t cap);

}  // namespace tv
