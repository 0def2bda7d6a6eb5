#include "base/arena.h"

namespace tv {

void* arena_take(Arena& arena, size_t count, size_t element_bytes) {
  const size_t bytes =
      (count * element_bytes + kArenaAlignment - 1) / kArenaAlignment * kArenaAlignment;
  if (bytes > arena.size_bytes - arena.used_bytes) return nullptr;
  // Of a measuring arena, whose memory is null, no pointer may be computed.
  const uintptr_t memory = reinterpret_cast<uintptr_t>(arena.memory) + arena.used_bytes;
  arena.used_bytes += bytes;
  if (arena.used_bytes > arena.high_water_bytes) arena.high_water_bytes = arena.used_bytes;
  return reinterpret_cast<void*>(memory);
}

}  // namespace tv
