#include "room/coarsen.h"

#include <cstring>

namespace tv {
namespace {

// The sums of a voxel that takes the place of eight: their means over those that saw a surface. A
// distance counts half, since the truncation doubles; a weight four times, since it is that of a
// sigma in voxels.
Voxel mean_of(const Voxel children[8]) {
  int64_t distances = 0, weights = 0, colours[3] = {0, 0, 0};
  int32_t surfaces = 0, frees = 0, num = 0, counts = 0;
  for (int k = 0; k < 8; ++k) {
    const uint64_t e = children[k].evidence;
    if (free_count(e) > frees) frees = free_count(e);
    if (surface_count(e) == 0) continue;
    ++num;
    counts += surface_count(e);
    if (surface_count(e) > surfaces) surfaces = surface_count(e);
    distances += distance_sum(e);
    weights += weight_sum(e);
    for (int c = 0; c < 3; ++c) colours[c] += colour_sum(children[k].colour, c);
  }
  if (num == 0) return {pack_evidence(0, 0, 0, frees), 0};
  const int64_t most = int64_t{kMaxWeight} * surfaces;
  const int64_t weight = 4 * weights / num < most ? 4 * weights / num : most;
  for (int64_t& c : colours) c = c * surfaces / counts;
  return {pack_evidence(distances * weight / (2 * weights), weight, surfaces, frees),
          pack_colour(colours)};
}

// Makes the block of the coarser level from its eight children; a child that does not exist has an
// index below 0.
void merge(const tv_room& room, const int32_t children[8], Voxel merged[kBlockVoxels]) {
  for (int32_t v = 0; v < kBlockVoxels; ++v) {
    Voxel around[8];
    for (int32_t k = 0; k < 8; ++k) {
      int32_t n = 0, at = 0;
      for (int i = 2; i >= 0; --i) {
        const int32_t c = 2 * (v >> (2 * i) & 3) + (k >> i & 1);
        n = 2 * n + c / kBlockSide;
        at = kBlockSide * at + c % kBlockSide;
      }
      around[k] = children[n] < 0 ? Voxel{0, 0} : voxels_of(room, children[n])[at];
    }
    merged[v] = mean_of(around);
  }
}

int32_t floor_half(int32_t c) { return (c - (c & 1)) / 2; }

}  // namespace

void coarsen(tv_room& room) {
  const int32_t fine = room.level;
  ++room.num_calls;
  // A block of the coarser level takes an index that is not above those of the blocks that it
  // replaces, and so is not met again.
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    if (room.blocks[index].key == 0) continue;
    const BlockPlace place = place_of(room.blocks[index].key);
    const BlockPlace parent = {floor_half(place.x), floor_half(place.y), floor_half(place.z),
                               place.inferred};
    int32_t children[8];
    for (int32_t n = 0; n < 8; ++n) {
      children[n] =
          find_block(room, block_key(room, {2 * parent.x + (n & 1), 2 * parent.y + (n >> 1 & 1),
                                            2 * parent.z + (n >> 2), parent.inferred}));
    }
    Voxel merged[kBlockVoxels];
    merge(room, children, merged);
    for (const int32_t child : children) {
      if (child >= 0) free_block(room, child);
    }
    room.level = fine + 1;
    const int32_t made = make_block(room, block_key(room, parent));
    std::memcpy(voxels_of(room, made), merged, sizeof merged);
    room.level = fine;
  }
  room.level = fine + 1;
  room.options.voxel *= 2;
  room.num_records = 0;
}

}  // namespace tv
