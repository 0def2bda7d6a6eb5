// The room's memory: blocks of voxels, found by their place through a hash table. Everything lies
// in the caller's memory; nothing is moved once it is made. docs/algorithms/room.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "twoview/room.h"

namespace tv {

inline constexpr int32_t kBlockSide = 4;  // voxels: 64 of them fit the bits of a word
inline constexpr int32_t kBlockVoxels = kBlockSide * kBlockSide * kBlockSide;
// A block's coordinates, in blocks, are in [-kBlockReach, kBlockReach).
inline constexpr int32_t kBlockReach = 1 << 19;

// Sums over depth maps. `evidence` holds four of them, from the low bits: how many maps saw through
// the voxel (11 bits), how many saw the surface within the truncation (11), their weights (17), and
// their weighted distances (25, signed). `colour` holds the sums of red, green and blue (19 each).
// With at most TV_ROOM_MAX_MAPS maps none of them overflows into the next, so that a map's
// contribution to all four is added, and subtracted, as one number.
struct Voxel {
  uint64_t evidence, colour;
};

inline constexpr int32_t kMaxWeight = 64;     // of a pixel
inline constexpr int32_t kMaxDistance = 127;  // the truncation, as a voxel's distance is counted
inline constexpr int kSurfaceShift = 11, kWeightShift = 22, kDistanceShift = 39;
inline constexpr int kColourBits = 19;
inline constexpr uint64_t kSeenThrough = 1;

inline int32_t free_count(uint64_t evidence) { return static_cast<int32_t>(evidence & 0x7ff); }
inline int32_t surface_count(uint64_t evidence) {
  return static_cast<int32_t>((evidence >> kSurfaceShift) & 0x7ff);
}
inline int32_t weight_sum(uint64_t evidence) {
  return static_cast<int32_t>((evidence >> kWeightShift) & 0x1ffff);
}
inline int32_t distance_sum(uint64_t evidence) {
  return static_cast<int32_t>(static_cast<int64_t>(evidence) >> kDistanceShift);
}
inline int32_t colour_sum(uint64_t colour, int channel) {
  return static_cast<int32_t>((colour >> (kColourBits * channel)) & 0x7ffff);
}

// The evidence of a number of maps with these sums.
inline uint64_t pack_evidence(int64_t distances, int64_t weights, int32_t surfaces, int32_t frees) {
  return (static_cast<uint64_t>(distances) << kDistanceShift) +
         (static_cast<uint64_t>(weights) << kWeightShift) +
         (static_cast<uint64_t>(surfaces) << kSurfaceShift) + static_cast<uint64_t>(frees);
}

inline uint64_t pack_colour(const int64_t sums[3]) {
  return static_cast<uint64_t>(sums[0]) | static_cast<uint64_t>(sums[1]) << kColourBits |
         static_cast<uint64_t>(sums[2]) << (2 * kColourBits);
}

// Where a block lies. Measured and inferred distances are in blocks of their own; `level` is how
// often the room was coarsened.
struct BlockPlace {
  int32_t x, y, z;
  bool inferred;
};

struct Block {
  uint64_t key;      // of its place and level; 0 where it is not in use
  uint64_t cells;    // scratch of the mesh: which of its cells have a vertex
  int32_t next;      // block of the same bucket, or -1
  uint32_t born_at;  // the number of the call that made it
  uint32_t used_at;  // the number of the call that last found it near a surface
  int32_t index;     // scratch of the mesh: of the first of its vertices
};

// The surface in a block: a sample of it for the planes.
struct Surfel {
  float mean[3], normal[3];
  float area, sigma;  // area 0: there is none, or it has no common normal
  int32_t plane;
};

// A map that was added. `added_at` is the number of the call that added it.
struct MapRecord {
  uint64_t digest;
  uint32_t added_at;
  uint32_t reserved;
};

}  // namespace tv

struct tv_room {
  tv_room_options options;  // with the voxel as it is now
  int32_t level;
  int32_t num_maps;      // those that were fixed by coarsening included
  int32_t num_records;   // maps that can be removed
  uint32_t num_calls;    // that added or removed
  int32_t num_blocks;    // in use
  int32_t end_blocks;    // all blocks from here on are not in use
  int32_t first_unused;  // all blocks before it are in use
  int32_t cap_blocks;
  int32_t num_near;      // blocks near the surface of the map at hand: near[0 .. num_near)
  int32_t bucket_shift;  // 64 less the bits of a bucket's index
  tv::MapRecord* records;
  tv::Block* blocks;
  tv::Surfel* surfels;  // one of each block: scratch of the planes, and of fusion (readings.h)
  tv::Voxel* voxels;    // kBlockVoxels of each block
  int32_t* near;
  int32_t* buckets;  // the first block of each, or -1
};

namespace tv {

// How many blocks fit beside the rest into size_bytes. Lays the room out at `memory`.
tv_room* make_room(const tv_room_options& options, void* memory, size_t size_bytes);

// All memory of a room, from its struct on.
size_t room_bytes(const tv_room& room);

uint64_t block_key(const tv_room& room, const BlockPlace& place);
BlockPlace place_of(uint64_t key);

// The index of a block, or -1.
int32_t find_block(const tv_room& room, uint64_t key);
// The index of a new block, whose voxels are empty: the first that is not in use; -1 where all are.
int32_t make_block(tv_room& room, uint64_t key);
void free_block(tv_room& room, int32_t index);

inline Voxel* voxels_of(const tv_room& room, int32_t block) {
  return room.voxels + static_cast<size_t>(block) * kBlockVoxels;
}

// Writes the box around all blocks; zeros stay where there is none.
void find_bounds(const tv_room& room, double min[3], double max[3]);

// Whether at least so many maps saw a surface in one voxel of the block.
bool has_surface(const tv_room& room, int32_t block, int32_t min_maps);

// Frees the blocks of measured surface without a voxel in which at least min_maps maps saw one.
// Returns how many.
int32_t prune(tv_room& room, int32_t min_maps);

// The largest integer that is not above x, for |x| below 2^31.
inline int32_t floor_of(double x) {
  const int32_t truncated = static_cast<int32_t>(x);
  return truncated - (x < truncated ? 1 : 0);
}

}  // namespace tv
