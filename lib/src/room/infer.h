// Distances of what has no texture, along the planes of a room. docs/algorithms/room.md.
#pragma once

#include <cstddef>

#include "base/arena.h"
#include "room/readings.h"

namespace tv {

struct InferRequest {
  const tv_room_plane* planes;
  int32_t num_planes;
  int32_t max_step;  // grey levels
};

size_t infer_bytes(int32_t width, int32_t height);

// Writes distance and sigma of each pixel that was inferred, and zeros for all others; returns how
// many were inferred. The view's map has pixels.
int32_t infer_distances(const tv_room& room, const RoomView& view, const InferRequest& request,
                        Arena& arena, float* distance, float* sigma);

}  // namespace tv
