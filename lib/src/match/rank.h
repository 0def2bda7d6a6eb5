// A total order of matches, the most certain one first.
#pragma once

#include <cstring>

#include "twoview/match.h"

namespace tv {

// The rank of a match: by its ratio, then by its lower and its higher index, so that exchanged
// views give the same rank. Only (i, j) and (j, i) with the same ratio have equal ranks.
inline uint64_t rank_of(const tv_correspondence& m) {
  uint32_t ratio;
  std::memcpy(&ratio, &m.ratio, sizeof ratio);  // ratios >= 0 have the order of their bits
  const bool ascending = m.idx0 < m.idx1;
  const uint32_t low = static_cast<uint32_t>(ascending ? m.idx0 : m.idx1);
  const uint32_t high = static_cast<uint32_t>(ascending ? m.idx1 : m.idx0);
  return static_cast<uint64_t>(ratio) << 32 | low << 16 | high;
}

}  // namespace tv
