// The planes of a room, from its measured surface. docs/algorithms/room.md.
#pragma once

#include "room/blocks.h"

namespace tv {

struct PlaneRequest {
  double min_area;
  bool has_gravity;
  double up[3];  // unit vector, where gravity is known
  double gravity_sigma;
};

// Finds up to cap planes, the largest first, and returns how many there are.
int32_t find_planes(tv_room& room, const PlaneRequest& request, tv_room_plane* planes, int32_t cap);

}  // namespace tv
