// Doubling a room's voxel. docs/algorithms/room.md.
#pragma once

#include "room/blocks.h"

namespace tv {

inline constexpr int32_t kMaxLevels = 16;  // so often a room can be coarsened

void coarsen(tv_room& room);

}  // namespace tv
