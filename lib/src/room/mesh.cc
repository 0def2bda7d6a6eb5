#include "room/mesh.h"

#include <cmath>
#include <initializer_list>

#include "room/flatten.h"

namespace tv {
namespace {

constexpr int32_t kGrid = kBlockSide + 1;  // a block's voxels, and the first of those after it
constexpr int32_t kGridStep[3] = {1, kGrid, kGrid* kGrid};
// A map that sees through a voxel counts there as a measurement of the largest distance with this
// weight.
constexpr int32_t kFreeWeight = 8;
// An inferred surface is part of the mesh if more than four maps inferred it for each map that sees
// through it.
constexpr int32_t kMostThroughInferred = 4;
constexpr int32_t kLeastInferred = 2;
// The least length of the mean of a block's normals.
constexpr float kLeastCoherence = 0.8f;
// The largest difference of two neighbours between which the surface passes. Without noise it is
// 127 over the truncation in voxels; beyond, one of them belongs to the back of something.
constexpr float kMostStep = 127;
// The least length of the distance's gradient at a vertex, as a share of that of an exact surface.
constexpr float kLeastGradient = 0.25f;

// What the mesh reads of a voxel.
struct Sample {
  float distance;  // [-127, 127]
  bool known;
  bool inferred;
  const Voxel* voxel;
};

Sample sample_of(const Voxel* voxel, bool inferred, int32_t min_maps) {
  const uint64_t e = voxel->evidence;
  const bool known = inferred ? surface_count(e) > kMostThroughInferred * free_count(e) &&
                                    surface_count(e) >= kLeastInferred
                              : surface_count(e) >= min_maps;
  if (!known) return {0, false, inferred, voxel};
  const int32_t weight = weight_sum(e);
  const int32_t against = free_count(e) * kFreeWeight;
  const int32_t counted = against < weight ? against : weight;
  const float sum =
      static_cast<float>(distance_sum(e)) + static_cast<float>(counted * kMaxDistance);
  return {sum / static_cast<float>(weight + counted), true, inferred, voxel};
}

// The blocks of one place, in both layers; -1 where there is none.
struct Layers {
  int32_t measured, inferred;
};

Layers layers_at(const tv_room& room, const MeshRequest& request, int32_t x, int32_t y, int32_t z) {
  const int32_t measured = find_block(room, block_key(room, {x, y, z, false}));
  if (request.measured_only) return {measured, -1};
  return {measured, find_block(room, block_key(room, {x, y, z, true}))};
}

// The block, of the two at one place, whose task it is to make the triangles of the cells there.
int32_t owner_of(const Layers& layers) {
  return layers.measured >= 0 ? layers.measured : layers.inferred;
}

Sample sample_in(const tv_room& room, const MeshRequest& request, const Layers& layers,
                 int32_t voxel) {
  Sample sample = {0, false, false, nullptr};
  if (layers.measured >= 0) {
    sample = sample_of(voxels_of(room, layers.measured) + voxel, false, request.min_maps);
  }
  if (!sample.known && layers.inferred >= 0) {
    sample = sample_of(voxels_of(room, layers.inferred) + voxel, true, request.min_maps);
  }
  return sample;
}

// The voxels of a block and of the first layer of those after it.
void gather(const tv_room& room, const MeshRequest& request, const BlockPlace& place,
            Sample grid[kGrid * kGrid * kGrid]) {
  for (int32_t n = 0; n < 8; ++n) {
    const int32_t dx = n & 1, dy = n >> 1 & 1, dz = n >> 2;
    const Layers layers = layers_at(room, request, place.x + dx, place.y + dy, place.z + dz);
    for (int32_t z = dz * kBlockSide; z < kBlockSide + dz; ++z) {
      for (int32_t y = dy * kBlockSide; y < kBlockSide + dy; ++y) {
        for (int32_t x = dx * kBlockSide; x < kBlockSide + dx; ++x) {
          const int32_t voxel =
              ((z % kBlockSide) * kBlockSide + y % kBlockSide) * kBlockSide + x % kBlockSide;
          grid[(z * kGrid + y) * kGrid + x] = sample_in(room, request, layers, voxel);
        }
      }
    }
  }
}

bool crosses(const Sample& a, const Sample& b) {
  if (!a.known || !b.known || (a.distance < 0) == (b.distance < 0)) return false;
  const float step = a.distance - b.distance;
  return step <= kMostStep && -step <= kMostStep;
}

// Calls visit(axis, first corner, second corner) for the twelve edges of a cell.
template <typename Visit>
void for_edges(const Sample* cell, const Visit& visit) {
  for (int axis = 0; axis < 3; ++axis) {
    const int32_t u = kGridStep[(axis + 1) % 3], v = kGridStep[(axis + 2) % 3];
    for (int32_t k = 0; k < 4; ++k) {
      const Sample* a = cell + (k & 1) * u + (k >> 1) * v;
      visit(axis, (k & 1), (k >> 1), a[0], a[kGridStep[axis]]);
    }
  }
}

// The mean gradient of the distance in a cell, a voxel being the unit, over the edges that are
// known. Returns its length.
float gradient_of(const Sample* cell, float gradient[3]) {
  float length_sq = 0;
  for (int i = 0; i < 3; ++i) gradient[i] = 0;
  int32_t steps[3] = {0, 0, 0};
  for_edges(cell, [gradient, &steps](int axis, int, int, const Sample& a, const Sample& b) {
    if (!a.known || !b.known) return;
    gradient[axis] += b.distance - a.distance;
    ++steps[axis];
  });
  for (int i = 0; i < 3; ++i) {
    if (steps[i] > 0) gradient[i] /= static_cast<float>(steps[i]);
    length_sq += gradient[i] * gradient[i];
  }
  return std::sqrt(length_sq);
}

bool has_vertex(const tv_room& room, const Sample* cell) {
  bool crossed = false;
  for_edges(cell, [&crossed](int, int, int, const Sample& a, const Sample& b) {
    crossed = crossed || crosses(a, b);
  });
  float gradient[3];
  const float least = kLeastGradient * kMaxDistance;
  return crossed &&
         gradient_of(cell, gradient) * static_cast<float>(room.options.truncation_voxels) >= least;
}

const Sample* cell_of(const Sample* grid, int32_t cell) {
  return grid + (cell % kBlockSide) + (cell / kBlockSide % kBlockSide) * kGridStep[1] +
         (cell / (kBlockSide * kBlockSide)) * kGridStep[2];
}

// The vertex of a cell of a block.
void make_vertex(const tv_room& room, const Sample* cell, const BlockPlace& place, int32_t number,
                 tv_room_vertex* vertex) {
  const int32_t corner[3] = {place.x * kBlockSide + number % kBlockSide,
                             place.y * kBlockSide + number / kBlockSide % kBlockSide,
                             place.z * kBlockSide + number / (kBlockSide * kBlockSide)};
  float sum[3] = {0, 0, 0}, gradient[3];
  int32_t crossings = 0, inferred = 0, maps = 0;
  int64_t colour[3] = {0, 0, 0}, maps_of_colour = 0, weight = 0;
  for_edges(cell, [&](int axis, int u, int v, const Sample& a, const Sample& b) {
    if (!crosses(a, b)) return;
    ++crossings;
    sum[axis] += a.distance / (a.distance - b.distance);
    sum[(axis + 1) % 3] += static_cast<float>(u);
    sum[(axis + 2) % 3] += static_cast<float>(v);
    for (const Sample* s : {&a, &b}) {
      const int32_t count = surface_count(s->voxel->evidence);
      for (int k = 0; k < 3; ++k) colour[k] += colour_sum(s->voxel->colour, k);
      maps_of_colour += count;
      weight += weight_sum(s->voxel->evidence);
      if (count > maps) maps = count;
      inferred += s->inferred;
    }
  });
  const float length = gradient_of(cell, gradient);
  const double voxel = room.options.voxel;
  for (int i = 0; i < 3; ++i) {
    const double offset = static_cast<double>(sum[i] / static_cast<float>(crossings));
    vertex->position[i] = static_cast<float>((corner[i] + 0.5 + offset) * voxel);
    vertex->normal[i] = gradient[i] / length;
    vertex->rgb[i] = static_cast<uint8_t>((2 * colour[i] + maps_of_colour) / (2 * maps_of_colour));
  }
  // A pixel's weight is 16 (voxel / sigma)^2.
  const double mean_weight = static_cast<double>(weight) / (2 * crossings);
  vertex->sigma = static_cast<float>(4 * voxel / std::sqrt(mean_weight));
  vertex->inferred = inferred > crossings;  // each crossing counts two voxels
  vertex->num_maps = maps;
}

bool is_within(const BlockPlace& place, const MeshRequest& request, int32_t margin) {
  const int32_t at[3] = {place.x, place.y, place.z};
  for (int i = 0; i < 3; ++i) {
    if (at[i] < request.from[i] - margin || at[i] > request.to[i]) return false;
  }
  return true;
}

// Whether this block makes the triangles of the cells of its place.
bool owns_cells(const tv_room& room, const MeshRequest& request, int32_t index) {
  if (room.blocks[index].key == 0) return false;
  const BlockPlace place = place_of(room.blocks[index].key);
  if (!is_within(place, request, 1)) return false;
  return owner_of(layers_at(room, request, place.x, place.y, place.z)) == index;
}

int32_t bits_of(uint64_t word) { return __builtin_popcountll(word); }

// The cells around the edges of a block reach into the blocks before it: owners[x + 2 y + 4 z], a
// coordinate being 1 for the block itself and 0 for the one before.
void owners_around(const tv_room& room, const MeshRequest& request, const BlockPlace& place,
                   int32_t owners[8]) {
  for (int32_t n = 0; n < 8; ++n) {
    owners[n] = owner_of(layers_at(room, request, place.x - 1 + (n & 1), place.y - 1 + (n >> 1 & 1),
                                   place.z - 1 + (n >> 2)));
  }
}

// The vertex of a cell, in voxels from the block's first; coordinates from -1 on. -1 without.
int32_t vertex_at(const tv_room& room, const int32_t owners[8], const int32_t at[3]) {
  int32_t n = 0, cell = 0;
  for (int i = 2; i >= 0; --i) {
    n = 2 * n + (at[i] >= 0);
    cell = kBlockSide * cell + (at[i] & (kBlockSide - 1));
  }
  if (owners[n] < 0) return -1;
  const Block& block = room.blocks[owners[n]];
  const uint64_t bit = uint64_t{1} << cell;
  if ((block.cells & bit) == 0) return -1;
  return block.index + bits_of(block.cells & (bit - 1));
}

// Calls visit(quad) for each quadrilateral of a block: four vertices, anticlockwise as seen from
// the free side.
template <typename Visit>
void for_quads(const tv_room& room, const Sample* grid, const int32_t owners[8],
               const Visit& visit) {
  for (int32_t cell = 0; cell < kBlockVoxels; ++cell) {
    const Sample* a = cell_of(grid, cell);
    const int32_t at[3] = {cell % kBlockSide, cell / kBlockSide % kBlockSide,
                           cell / (kBlockSide * kBlockSide)};
    for (int axis = 0; axis < 3; ++axis) {
      if (!crosses(a[0], a[kGridStep[axis]])) continue;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      const bool free_ahead = a->distance < 0;
      int32_t quad[4];
      bool whole = true;
      for (int k = 0; k < 4; ++k) {
        const int turn = free_ahead ? k : 3 - k;  // around the axis, from u to v
        int32_t corner[3] = {at[0], at[1], at[2]};
        corner[u] -= turn == 0 || turn == 3;
        corner[v] -= turn < 2;
        quad[k] = vertex_at(room, owners, corner);
        whole = whole && quad[k] >= 0;
      }
      if (whole) visit(quad);
    }
  }
}

float distance_sq(const tv_room_vertex& a, const tv_room_vertex& b) {
  float sum = 0;
  for (int i = 0; i < 3; ++i) {
    sum += (a.position[i] - b.position[i]) * (a.position[i] - b.position[i]);
  }
  return sum;
}

// Whether no vertex of a triangle has a larger standard deviation than is wanted.
bool is_sure(const MeshRequest& request, const tv_room_vertex* vertices, const int32_t idx[3]) {
  bool sure = true;
  for (int k = 0; k < 3; ++k) {
    sure = sure && static_cast<double>(vertices[idx[k]].sigma) <= request.max_sigma;
  }
  return sure || request.max_sigma == 0;
}

// Connected pieces of the mesh as disjoint sets of vertices, linked by `reserved`: the root of a
// set holds -1 minus its number of triangles, every other vertex the index of a vertex nearer to
// the root.
int32_t piece_of(tv_room_vertex* vertices, int32_t v) {
  while (vertices[v].reserved >= 0) {
    const int32_t next = vertices[v].reserved;
    if (vertices[next].reserved >= 0) vertices[v].reserved = vertices[next].reserved;
    v = next;
  }
  return v;
}

void join(tv_room_vertex* vertices, const tv_room_triangle& triangle) {
  int32_t root = piece_of(vertices, triangle.idx_vertex[0]);
  for (int k = 1; k < 3; ++k) {
    int32_t other = piece_of(vertices, triangle.idx_vertex[k]);
    if (other == root) continue;
    if (vertices[other].reserved < vertices[root].reserved) {
      const int32_t larger = other;
      other = root, root = larger;
    }
    vertices[root].reserved += vertices[other].reserved + 1;
    vertices[other].reserved = root;
  }
  --vertices[root].reserved;
}

void leave_out_small_pieces(const MeshRequest& request, MeshOutput* output) {
  tv_room_vertex* vertices = output->vertices;
  int32_t kept = 0;
  for (int32_t k = 0; k < output->num_triangles; ++k) {
    const tv_room_triangle& triangle = output->triangles[k];
    const int32_t root = piece_of(vertices, triangle.idx_vertex[0]);
    if (-1 - vertices[root].reserved >= request.min_piece_triangles) {
      output->triangles[kept++] = triangle;
    }
  }
  output->num_triangles = kept;
}

// Leaves out the vertices of no triangle.
void leave_out_unused_vertices(MeshOutput* output) {
  tv_room_vertex* vertices = output->vertices;
  for (int32_t v = 0; v < output->num_vertices; ++v) vertices[v].reserved = -1;
  for (int32_t k = 0; k < output->num_triangles; ++k) {
    for (const int32_t v : output->triangles[k].idx_vertex) vertices[v].reserved = 0;
  }
  int32_t kept = 0;
  for (int32_t v = 0; v < output->num_vertices; ++v) {
    if (vertices[v].reserved == 0) vertices[v].reserved = kept++;
  }
  for (int32_t k = 0; k < output->num_triangles; ++k) {
    for (int32_t& v : output->triangles[k].idx_vertex) v = vertices[v].reserved;
  }
  for (int32_t v = 0; v < output->num_vertices; ++v) {
    const int32_t to = vertices[v].reserved;
    if (to < 0) continue;
    vertices[to] = vertices[v];
    vertices[to].reserved = 0;
  }
  output->num_vertices = kept;
}

}  // namespace

void choose_blocks(const tv_room& room, const double min[3], const double max[3],
                   MeshRequest* request) {
  bool everywhere = true;
  for (int i = 0; i < 3; ++i) everywhere = everywhere && min[i] == 0 && max[i] == 0;
  const double block = room.options.voxel * kBlockSide;
  const auto place = [block](double x) {
    const double c = x / block;
    return c > kBlockReach ? kBlockReach : c < -kBlockReach ? -kBlockReach : floor_of(c);
  };
  for (int i = 0; i < 3; ++i) {
    request->from[i] = everywhere ? -kBlockReach : place(min[i]);
    request->to[i] = everywhere ? kBlockReach : place(max[i]);
  }
}

void count_mesh(tv_room& room, const MeshRequest& request, int64_t* num_vertices,
                int64_t* num_triangles) {
  Sample grid[kGrid * kGrid * kGrid];
  *num_vertices = *num_triangles = 0;
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    Block& block = room.blocks[index];
    block.cells = 0;
    block.index = static_cast<int32_t>(*num_vertices < INT32_MAX ? *num_vertices : INT32_MAX);
    if (!owns_cells(room, request, index)) continue;
    const BlockPlace place = place_of(block.key);
    gather(room, request, place, grid);
    for (int32_t cell = 0; cell < kBlockVoxels; ++cell) {
      const Sample* a = cell_of(grid, cell);
      block.cells |= static_cast<uint64_t>(has_vertex(room, a)) << cell;
      for (int axis = 0; axis < 3; ++axis) *num_triangles += 2 * crosses(a[0], a[kGridStep[axis]]);
    }
    *num_vertices += bits_of(block.cells);
  }
}

void make_surfels(tv_room& room, int32_t min_maps) {
  Sample grid[kGrid * kGrid * kGrid];
  const MeshRequest request = {min_maps, 0, true, {}, {}, nullptr, 0, 0};
  const float voxel = static_cast<float>(room.options.voxel);
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    Surfel& surfel = room.surfels[index];
    surfel = {};
    const uint64_t key = room.blocks[index].key;
    if (key == 0 || place_of(key).inferred) continue;
    const BlockPlace place = place_of(key);
    gather(room, request, place, grid);
    float count = 0, normal[3] = {0, 0, 0}, mean[3] = {0, 0, 0}, sigma = 0;
    for (int32_t cell = 0; cell < kBlockVoxels; ++cell) {
      const Sample* corner = cell_of(grid, cell);
      if (!has_vertex(room, corner)) continue;
      tv_room_vertex vertex;
      make_vertex(room, corner, place, cell, &vertex);
      for (int i = 0; i < 3; ++i) mean[i] += vertex.position[i], normal[i] += vertex.normal[i];
      sigma += vertex.sigma;
      ++count;
    }
    float length = 0, cells = 0;
    for (const float n : normal) length += n * n;
    length = std::sqrt(length);
    if (!(length > kLeastCoherence * count)) continue;
    for (int i = 0; i < 3; ++i) {
      surfel.mean[i] = mean[i] / count;
      surfel.normal[i] = normal[i] / length;
      cells += std::fabs(surfel.normal[i]);
    }
    // A plane passes through |nx| + |ny| + |nz| cells in the area of a voxel's side.
    surfel.area = count * voxel * voxel / cells;
    surfel.sigma = sigma / count;
  }
}

void write_mesh(tv_room& room, const MeshRequest& request, MeshOutput* output) {
  Sample grid[kGrid * kGrid * kGrid];
  output->num_vertices = output->num_triangles = 0;
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    const Block& block = room.blocks[index];
    if (block.cells == 0) continue;
    const BlockPlace place = place_of(block.key);
    gather(room, request, place, grid);
    for (int32_t cell = 0; cell < kBlockVoxels; ++cell) {
      if ((block.cells >> cell & 1) == 0) continue;
      tv_room_vertex* vertex = &output->vertices[output->num_vertices++];
      make_vertex(room, cell_of(grid, cell), place, cell, vertex);
      draw_to_planes(room, request.planes, request.num_planes, vertex);
      vertex->reserved = -1;
    }
  }
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    if (!owns_cells(room, request, index)) continue;
    const BlockPlace place = place_of(room.blocks[index].key);
    if (!is_within(place, request, 0)) continue;
    int32_t owners[8];
    gather(room, request, place, grid);
    owners_around(room, request, place, owners);
    for_quads(room, grid, owners, [&request, output](const int32_t quad[4]) {
      const tv_room_vertex* v = output->vertices;
      const bool first = distance_sq(v[quad[0]], v[quad[2]]) <= distance_sq(v[quad[1]], v[quad[3]]);
      const int32_t halves[2][3] = {{quad[0], quad[1], quad[first ? 2 : 3]},
                                    {quad[first ? 0 : 1], quad[2], quad[3]}};
      for (const int32_t(&half)[3] : halves) {
        if (!is_sure(request, v, half)) continue;
        tv_room_triangle* triangle = &output->triangles[output->num_triangles++];
        for (int k = 0; k < 3; ++k) triangle->idx_vertex[k] = half[k];
        join(output->vertices, *triangle);
      }
    });
  }
  leave_out_small_pieces(request, output);
  leave_out_unused_vertices(output);
}

}  // namespace tv
