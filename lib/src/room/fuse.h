// Adding a depth map to a room's sums, and subtracting it. docs/algorithms/room.md.
#pragma once

#include "room/readings.h"

namespace tv {

// Adds the view's contributions to the blocks near its surface, which are made where the room lacks
// them, and to what it sees through in all others. False: there is no memory for the blocks, and
// the room is as it was.
bool add_view(tv_room& room, const RoomView& view);

// Subtracts the view's contributions from the blocks that existed when the view was added.
void subtract_view(tv_room& room, const RoomView& view, uint32_t added_at);

// Adds the view's contributions to the blocks that were made since it was added: to what it sees
// through, and to what prune freed of its surface and other maps have needed again.
void add_to_new_blocks(tv_room& room, const RoomView& view, uint32_t added_at);

}  // namespace tv
