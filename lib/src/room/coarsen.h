// Doubling a room's voxel. docs/algorithms/room.md.
#pragma once

#include "room/blocks.h"

namespace tv {

void coarsen(tv_room& room);

}  // namespace tv
