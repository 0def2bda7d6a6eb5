// The maps of a room: which ones were added, so that each can be removed again.
// docs/algorithms/room.md.
#pragma once

#include "room/fuse.h"

namespace tv {

// The index of the record of a map that was added with these contents, the last one if there are
// several; -1 if there is none.
int32_t find_record(const tv_room& room, const RoomView& view);

// Adds a map, of which the room has fewer than TV_ROOM_MAX_MAPS, and its record. False: there is no
// memory for its blocks, and the room is as it was.
bool add_map(tv_room& room, const RoomView& view);

// Removes the map of a record, or adds what it sees through in blocks that were made since.
void remove_map(tv_room& room, const RoomView& view, int32_t record);
void see_through_again(tv_room& room, const RoomView& view, int32_t record);

}  // namespace tv
