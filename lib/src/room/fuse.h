// Adding a depth map to a room's sums, and subtracting it. docs/algorithms/room.md.
#pragma once

#include "geometry/camera.h"
#include "room/blocks.h"

namespace tv {

// A depth map with its lens and its pose, world_from_cam.
struct RoomView {
  Camera camera;
  Mat3 rotation;
  Vec3 centre;
  tv_depth_map map;
};

// What a view measured at a pixel. The weight is 0 where it is unknown.
struct Measured {
  double distance, sigma;
  int32_t weight;
};

// Whether the image shows the scene at a pixel.
bool shows_scene(const tv_depth_map& map, int32_t x, int32_t y);

Measured measured_at(const tv_room& room, const RoomView& view, int32_t x, int32_t y);

// A number that tells views apart by their contents.
uint64_t digest_of(const RoomView& view);

// Lists the blocks near the view's surface in room.near. make: those that the room lacks are made;
// where there is no memory for them, it returns false and leaves the room as it was.
bool list_near_blocks(tv_room& room, const RoomView& view, bool make);

// Adds the view's contributions to the blocks of room.near, and to what it sees through in all
// others; or subtracts them from those that existed when it was added.
void add_view(tv_room& room, const RoomView& view);
void subtract_view(tv_room& room, const RoomView& view, uint32_t added_at);

// Adds the view's contributions to the blocks that were made since it was added: to what it sees
// through, and to what prune freed of its surface and other maps have needed again.
void add_to_new_blocks(tv_room& room, const RoomView& view, uint32_t added_at);

}  // namespace tv
