#include "room/blocks.h"

#include <cstring>

#include "base/arena.h"

namespace tv {
namespace {

constexpr int kPlaceBits = 20;
constexpr uint64_t kPlaceMask = (1u << kPlaceBits) - 1;
constexpr int kInferredBit = 60, kLevelBit = 61, kUsedBit = 63;

size_t bucket_of(const tv_room& room, uint64_t key) {
  return static_cast<size_t>((key * 0x9e3779b97f4a7c15u) >> room.bucket_shift);
}

// Carves the arrays of a room of cap_blocks blocks and `buckets` buckets out of the arena.
tv_room* lay_out(Arena& arena, int32_t cap_blocks, size_t buckets, tv_room* room) {
  const size_t blocks = static_cast<size_t>(cap_blocks);
  tv_room* place = arena_alloc<tv_room>(arena, 1);
  room->records = arena_alloc<MapRecord>(arena, TV_ROOM_MAX_MAPS);
  room->blocks = arena_alloc<Block>(arena, blocks);
  room->surfels = arena_alloc<Surfel>(arena, blocks);
  room->near = arena_alloc<int32_t>(arena, blocks);
  room->buckets = arena_alloc<int32_t>(arena, buckets);
  room->voxels = arena_alloc<Voxel>(arena, blocks * kBlockVoxels);
  return place;
}

}  // namespace

tv_room* make_room(const tv_room_options& options, void* memory, size_t size_bytes) {
  tv_room made = {};
  made.options = options;
  // As many buckets as a power of two that is not below half the number of blocks.
  const size_t block_bytes =
      sizeof(Block) + sizeof(Surfel) + kBlockVoxels * sizeof(Voxel) + sizeof(int32_t);
  int bits = 1;
  while (bits < 28 && (block_bytes << (bits + 1)) < size_bytes) ++bits;
  const size_t buckets = size_t{1} << bits;
  made.bucket_shift = 64 - bits;
  Arena measure = measuring_arena();
  lay_out(measure, 0, buckets, &made);
  // What the four arrays of blocks lose to alignment is below a block.
  const size_t left = (size_bytes - measure.used_bytes) / block_bytes - 1;
  made.cap_blocks = static_cast<int32_t>(left < (1u << 30) ? left : (1u << 30));
  Arena arena = arena_over(memory, size_bytes);
  tv_room* room = lay_out(arena, made.cap_blocks, buckets, &made);
  *room = made;
  std::memset(room->buckets, -1, buckets * sizeof(int32_t));
  return room;
}

size_t room_bytes(const tv_room& room) {
  const Voxel* end = room.voxels + static_cast<size_t>(room.cap_blocks) * kBlockVoxels;
  return static_cast<size_t>(reinterpret_cast<const uint8_t*>(end) -
                             reinterpret_cast<const uint8_t*>(&room));
}

uint64_t block_key(const tv_room& room, const BlockPlace& place) {
  const auto part = [](int32_t c) { return static_cast<uint64_t>(c + kBlockReach) & kPlaceMask; };
  return part(place.x) | part(place.y) << kPlaceBits | part(place.z) << (2 * kPlaceBits) |
         static_cast<uint64_t>(place.inferred) << kInferredBit |
         static_cast<uint64_t>(room.level & 1) << kLevelBit | uint64_t{1} << kUsedBit;
}

BlockPlace place_of(uint64_t key) {
  const auto part = [key](int axis) {
    return static_cast<int32_t>((key >> (axis * kPlaceBits)) & kPlaceMask) - kBlockReach;
  };
  return {part(0), part(1), part(2), (key >> kInferredBit & 1) != 0};
}

int32_t find_block(const tv_room& room, uint64_t key) {
  int32_t index = room.buckets[bucket_of(room, key)];
  while (index >= 0 && room.blocks[index].key != key) index = room.blocks[index].next;
  return index;
}

int32_t make_block(tv_room& room, uint64_t key) {
  int32_t index = room.first_unused;
  while (index < room.end_blocks && room.blocks[index].key != 0) ++index;
  room.first_unused = index;
  if (index == room.cap_blocks) return -1;
  if (index == room.end_blocks) room.end_blocks = index + 1;
  room.first_unused = index + 1;
  ++room.num_blocks;
  int32_t* bucket = &room.buckets[bucket_of(room, key)];
  room.blocks[index] = {key, 0, *bucket, room.num_calls, 0, 0};
  *bucket = index;
  std::memset(voxels_of(room, index), 0, kBlockVoxels * sizeof(Voxel));
  return index;
}

void free_block(tv_room& room, int32_t index) {
  Block& block = room.blocks[index];
  int32_t* link = &room.buckets[bucket_of(room, block.key)];
  while (*link != index) link = &room.blocks[*link].next;
  *link = block.next;
  block.key = 0;
  --room.num_blocks;
  if (index < room.first_unused) room.first_unused = index;
  while (room.end_blocks > 0 && room.blocks[room.end_blocks - 1].key == 0) --room.end_blocks;
  if (room.first_unused > room.end_blocks) room.first_unused = room.end_blocks;
}

void find_bounds(const tv_room& room, double min[3], double max[3]) {
  const double block = room.options.voxel * kBlockSide;
  bool first = true;
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    if (room.blocks[k].key == 0) continue;
    const BlockPlace place = place_of(room.blocks[k].key);
    const int32_t at[3] = {place.x, place.y, place.z};
    for (int i = 0; i < 3; ++i) {
      if (first || at[i] * block < min[i]) min[i] = at[i] * block;
      if (first || (at[i] + 1) * block > max[i]) max[i] = (at[i] + 1) * block;
    }
    first = false;
  }
}

bool has_surface(const tv_room& room, int32_t block, int32_t min_maps) {
  const Voxel* voxels = voxels_of(room, block);
  for (int32_t v = 0; v < kBlockVoxels; ++v) {
    if (surface_count(voxels[v].evidence) >= min_maps) return true;
  }
  return false;
}

int32_t prune(tv_room& room, int32_t min_maps) {
  const int32_t before = room.num_blocks;
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    const uint64_t key = room.blocks[index].key;
    if (key == 0 || place_of(key).inferred || has_surface(room, index, min_maps)) continue;
    free_block(room, index);
  }
  return before - room.num_blocks;
}

}  // namespace tv
