// Reading the triangles of a PLY file: ASCII, and binary of both byte orders.
#pragma once

#include <string>

#include "room_model/triangle_tree.h"

namespace cli {

// Reads x y z of the element `vertex` and the lists vertex_indices (or vertex_index) of the element
// `face`; faces of more than three corners are cut into triangles. Other elements and properties
// are skipped. Throws BadInput for what is no PLY file, has no faces, or is truncated or damaged.
TriangleMesh load_ply_mesh(const std::string& path);

}  // namespace cli
