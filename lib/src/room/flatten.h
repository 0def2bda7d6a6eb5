// Vertices that may lie on a plane of the room are moved towards it, by as much as the standard
// deviations of both say. docs/algorithms/room.md.
#pragma once

#include "room/blocks.h"

namespace tv {

// Takes the nearest plane on which the vertex may lie as a measurement of it: moves the vertex
// along the plane's normal, turns its normal, and lessens its sigma.
void draw_to_planes(const tv_room& room, const tv_room_plane* planes, int32_t num_planes,
                    tv_room_vertex* vertex);

}  // namespace tv
