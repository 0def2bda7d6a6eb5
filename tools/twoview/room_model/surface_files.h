// The surface as files that other programs open: PLY and GLB.
#pragma once

#include <string>

#include "room_model/scene.h"

namespace cli {

// Binary little-endian PLY in the frame of the trajectory: x y z nx ny nz float, red green blue
// uchar, sigma float, inferred uchar; triangles as lists. unit: the words for the unit of x y z,
// which a comment tells.
std::string room_ply(const RoomModel& model, const std::string& unit);

// glTF 2.0 as one binary file, y up: the world is turned so that model.up is y, and moved so that
// the floor's height is 0. Triangles with POSITION, NORMAL, COLOR_0 (RGBA, linear, 16 bits) and
// _SIGMA in the BIN chunk.
std::string room_glb(const RoomModel& model);

}  // namespace cli
