// The arena is the library's only allocator. It hands out the context's memory from the front, in
// the order of the calls, and ArenaScope gives back all that was taken within a scope.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tv {

inline constexpr size_t kArenaAlignment = 64;

struct Arena {
  uint8_t* memory;
  size_t size_bytes;
  size_t used_bytes;
  size_t high_water_bytes;
};

inline Arena arena_over(void* memory, size_t size_bytes) {
  return Arena{static_cast<uint8_t*>(memory), size_bytes, 0, 0};
}

// An arena without memory that grants every request: after a function that takes arrays from it,
// and does not touch them, used_bytes is how many bytes these arrays need.
inline Arena measuring_arena() { return arena_over(nullptr, SIZE_MAX); }

// The bytes that arena_alloc takes for `count` elements of T, padding included. Size queries add
// these up in the order of the allocations.
template <typename T>
constexpr size_t arena_bytes(size_t count) {
  return (count * sizeof(T) + kArenaAlignment - 1) / kArenaAlignment * kArenaAlignment;
}

// What arena_alloc does with the size of an element: one function for all types.
void* arena_take(Arena& arena, size_t count, size_t element_bytes);

// Uninitialised memory for `count` elements, aligned to kArenaAlignment bytes; null when the arena
// is full. Callers do not check: every function that allocates has a size query, and the context
// reserves what the queries return.
template <typename T>
T* arena_alloc(Arena& arena, size_t count) {
  static_assert(__is_trivially_copyable(T), "the arena runs no constructors");
  return static_cast<T*>(arena_take(arena, count, sizeof(T)));
}

// On destruction, gives back everything that was taken from the arena since construction.
class ArenaScope {
 public:
  explicit ArenaScope(Arena& arena) : arena_(arena), used_bytes_(arena.used_bytes) {}
  ~ArenaScope() { arena_.used_bytes = used_bytes_; }
  ArenaScope(const ArenaScope&) = delete;
  ArenaScope& operator=(const ArenaScope&) = delete;

 private:
  Arena& arena_;
  size_t used_bytes_;
};

}  // namespace tv
