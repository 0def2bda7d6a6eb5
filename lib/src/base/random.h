// The library's random numbers: the same on every platform. The caller gives the seed; it is never
// taken from the clock.
#pragma once

#include <cstdint>

namespace tv {

// PCG32 (M. E. O'Neill, 2014): 64 bits of state, one fixed stream.
struct Random {
  uint64_t state;
};

inline uint32_t random_next(Random& random) {
  const uint64_t old = random.state;
  random.state = old * 6364136223846793005ULL + 1442695040888963407ULL;
  const uint32_t shifted = static_cast<uint32_t>(((old >> 18) ^ old) >> 27);
  const uint32_t rotation = static_cast<uint32_t>(old >> 59);
  return (shifted >> rotation) | (shifted << ((32 - rotation) & 31));
}

inline Random random_seeded(uint64_t seed) {
  Random random{seed + 1442695040888963407ULL};
  random_next(random);
  return random;
}

// A number in [0, bound), bound > 0, by Lemire's multiplication without rejection. Each number's
// probability differs from 1 / bound by less than the fraction bound / 2^32 of it. The time does
// not depend on the number drawn.
inline uint32_t random_below(Random& random, uint32_t bound) {
  return static_cast<uint32_t>((static_cast<uint64_t>(random_next(random)) * bound) >> 32);
}

}  // namespace tv
