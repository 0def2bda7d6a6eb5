// The surface of a room, by surface nets: S. F. F. Gibson, "Constrained elastic surface nets",
// MICCAI 1998, without the relaxation. A cell, the cube between eight voxels, has one vertex where
// edges of it are crossed: at their crossings' mean. Each crossed edge makes a quadrilateral of the
// four cells around it. docs/algorithms/room.md.
#pragma once

#include "room/blocks.h"

namespace tv {

struct MeshRequest {
  int32_t min_maps, min_piece_triangles;
  bool measured_only;
  int32_t from[3], to[3];  // blocks, both ends included
  const tv_room_plane* planes;
  int32_t num_planes;
  double max_sigma;  // of the vertices of a triangle; 0: any
};

struct MeshOutput {
  tv_room_vertex* vertices;
  tv_room_triangle* triangles;
  int32_t num_vertices, num_triangles;
};

// The blocks that a box meets; all of them where its corners are all 0.
void choose_blocks(const tv_room& room, const double min[3], const double max[3],
                   MeshRequest* request);

// Finds the cells that have a vertex, and counts what write_mesh needs room for.
void count_mesh(tv_room& room, const MeshRequest& request, int64_t* num_vertices,
                int64_t* num_triangles);

// Writes the mesh that was counted last, less the pieces that are too small.
void write_mesh(tv_room& room, const MeshRequest& request, MeshOutput* output);

// Computes the surfel of each block from the surface that min_maps maps measured.
void make_surfels(tv_room& room, int32_t min_maps);

}  // namespace tv
