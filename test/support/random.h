/* Random inputs of tests: each test uses a fixed seed, which is printed when the test fails. */
#ifndef TEST_SUPPORT_RANDOM_H
#define TEST_SUPPORT_RANDOM_H

#include <stddef.h>
#include <stdint.h>

/* SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, 2014). */
static inline uint64_t random_u64(uint64_t *state) {
  uint64_t z = (*state += 0x9E3779B97F4A7C15u);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

/* Returns an integer that is uniform in [low, high], both ends included. */
static inline int32_t random_int(uint64_t *state, int32_t low, int32_t high) {
  const uint64_t span = (uint64_t)((int64_t)high - low + 1);
  return (int32_t)(low + (int64_t)(random_u64(state) % span));
}

/* Returns a number that is uniform in [0, 1). */
static inline double random_unit(uint64_t *state) {
  return (double)(random_u64(state) >> 11) / 9007199254740992.0;
}

static inline void random_bytes(uint64_t *state, uint8_t *bytes, size_t count) {
  size_t k;
  for (k = 0; k < count; ++k) bytes[k] = (uint8_t)(random_u64(state) >> 56);
}

#endif
