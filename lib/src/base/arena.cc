#include "base/arena.h"

namespace tv {

void* arena_take(Arena& arena, size_t count, size_t element_bytes) {
  const size_t bytes =
      (count * element_bytes + kArenaAlignment - 1) / kArenaAlignment * kArenaAlignment;
  if (bytes > arena.size_bytes - arena.used_bytes) return nullptr;
  uint8_t* memory = arena.memory + arena.used_bytes;
  arena.used_bytes += bytes;
  if (arena.used_bytes > arena.high_water_bytes) arena.high_water_bytes = arena.used_bytes;
  return memory;
}

}  // namespace tv
