// Matching by the kernel nearest_groups and the ratio test. Formulas: docs/algorithms/match.md;
// test: test/unit/test_match.c.
//
// The kernel lists for each descriptor the groups of the other image's descriptors that are nearest
// to it. They hold the nearest descriptor, and nearly always the second nearest one outside its
// neighbourhood; the bound of a list says whether a nearer one may be elsewhere. Where one may, and
// the match passes the ratio test so far, all descriptors are scanned.
#include "match/match.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tv {
namespace {

constexpr int32_t kNone = TVK_NEAREST_NONE;
constexpr int kBound = TVK_NEAREST_LIST - 1;  // a list's entry that bounds the distance of the rest
constexpr int32_t kBlock = 64;                // distances that are computed in one call
constexpr int32_t kCellBits = 6;  // cells along the longer side of the keypoints' bounding box
constexpr int32_t kNumCells = 1 << 2 * kCellBits;
constexpr double kTwice = 4.0001;  // the square of 2, and more than any rounding error

struct Side {
  tvk_descriptors set;
  const tv_keypoint* keypoints;  // null: each other keypoint counts as the second nearest
  double near_sq;                // square of neighbourhood_px
  tvk_nearest* lists;
  int32_t group;  // how many descriptors a group has

  const uint8_t* descriptor(int32_t idx) const {
    return set.bytes + static_cast<int64_t>(idx) * TV_DESCRIPTOR_BYTES;
  }
};

// Whether keypoint b is at least neighbourhood_px, times the root of scale_sq, away from keypoint
// a.
bool are_far(const Side& side, int32_t a, int32_t b, double scale_sq = 1) {
  if (side.keypoints == nullptr) return a != b;
  const double dx = static_cast<double>(side.keypoints[a].x) - side.keypoints[b].x;
  const double dy = static_cast<double>(side.keypoints[a].y) - side.keypoints[b].y;
  return dx * dx + dy * dy >= side.near_sq * scale_sq;
}

bool has_far(const Side& side, int32_t from) {
  int32_t k = 0;
  while (k < side.set.num && !are_far(side, from, k)) ++k;
  return k < side.set.num;
}

// Spreads six bits to the even places of twelve.
uint32_t spread_bits(uint32_t x) {
  x = (x | x << 4) & 0x30F;
  x = (x | x << 2) & 0x333;
  return (x | x << 1) & 0x555;
}

uint32_t cell_of(const tv_keypoint& keypoint, const float* lowest, float scale) {
  const uint32_t last = (1u << kCellBits) - 1;
  const float x = (keypoint.x - lowest[0]) * scale, y = (keypoint.y - lowest[1]) * scale;
  return spread_bits(std::min(static_cast<uint32_t>(x), last)) |
         spread_bits(std::min(static_cast<uint32_t>(y), last)) << 1;
}

// Ranks the keypoints along a Z-curve through square cells, so that those of a neighbourhood have
// ranks that are close to each other. The order affects the time only.
void order_keypoints(const tv_keypoint* keypoints, int32_t num, void* scratch, uint16_t* order) {
  if (keypoints == nullptr) {
    for (int32_t k = 0; k < num; ++k) order[k] = static_cast<uint16_t>(k);
    return;
  }
  float lowest[2] = {keypoints[0].x, keypoints[0].y}, highest[2] = {lowest[0], lowest[1]};
  for (int32_t k = 0; k < num; ++k) {
    lowest[0] = std::min(lowest[0], keypoints[k].x),
    lowest[1] = std::min(lowest[1], keypoints[k].y);
    highest[0] = std::max(highest[0], keypoints[k].x);
    highest[1] = std::max(highest[1], keypoints[k].y);
  }
  const float side = std::max(std::max(highest[0] - lowest[0], highest[1] - lowest[1]), 1.0f);
  const float scale = static_cast<float>(1 << kCellBits) / side;
  int32_t* const starts = static_cast<int32_t*>(scratch);
  std::fill(starts, starts + kNumCells, 0);
  for (int32_t k = 0; k < num; ++k) ++starts[cell_of(keypoints[k], lowest, scale)];
  int32_t start = 0;
  for (int32_t c = 0; c < kNumCells; ++c) {
    const int32_t count = starts[c];
    starts[c] = start;
    start += count;
  }
  for (int32_t k = 0; k < num; ++k) {
    order[starts[cell_of(keypoints[k], lowest, scale)]++] = static_cast<uint16_t>(k);
  }
}

struct Nearest {
  int32_t dist, idx;
};

// The nearest of all descriptors of the side, or of those far from keypoint `from` if that is not
// negative; the lowest index of equal ones.
Nearest scan(const tvk_table& kernels, const uint8_t* query, const Side& side, int32_t from) {
  Nearest nearest{kNone, -1};
  int32_t indices[kBlock], dists[kBlock];
  for (int32_t first = 0; first < side.set.num; first += kBlock) {
    const int32_t count = std::min(kBlock, side.set.num - first);
    for (int32_t k = 0; k < count; ++k) indices[k] = first + k;
    kernels.squared_distances(query, side.set.bytes, indices, count, dists);
    for (int32_t k = 0; k < count; ++k) {
      if (dists[k] < nearest.dist && (from < 0 || are_far(side, from, first + k))) {
        nearest = Nearest{dists[k], first + k};
      }
    }
  }
  return nearest;
}

// The members of a group of the side: their indices. Returns how many there are.
int32_t members_of(const Side& side, int32_t group, int32_t* indices) {
  const int32_t first = group * side.group;
  const int32_t count = std::min(side.group, side.set.num - first);
  for (int32_t k = 0; k < count; ++k) indices[k] = side.set.order[first + k];
  return count;
}

// The nearest descriptor of the side, the lowest index of equal ones. -1 if two equal ones are so
// far apart that one of them is second nearest, whichever is the nearest: such a match never
// passes.
int32_t nearest_of(const tvk_table& kernels, const uint8_t* query, const tvk_nearest& list,
                   const Side& side) {
  const int32_t best = list.dists[0];
  int32_t found = -1, indices[kBlock], dists[kBlock];
  for (int k = 0; k < TVK_NEAREST_LIST; ++k) {
    if (list.dists[k] != best) continue;
    const int32_t count = members_of(side, list.groups[k], indices);
    kernels.squared_distances(query, side.set.bytes, indices, count, dists);
    for (int32_t m = 0; m < count; ++m) {
      if (dists[m] != best) continue;
      if (found >= 0 && are_far(side, found, indices[m], kTwice)) return -1;
      found = found < 0 ? indices[m] : std::min(found, indices[m]);
    }
  }
  return list.dists[kBound] > best ? found : scan(kernels, query, side, -1).idx;
}

// The smallest distance of the listed descriptors that are far from keypoint `from`; kNone if there
// is none.
int32_t listed_second(const tvk_table& kernels, const uint8_t* query, const tvk_nearest& list,
                      const Side& side, int32_t from) {
  int32_t second = kNone, indices[kBlock], dists[kBlock];
  for (int k = 0; k < TVK_NEAREST_LIST; ++k) {
    if (list.dists[k] >= second || list.dists[k] > list.dists[kBound]) continue;
    const int32_t count = members_of(side, list.groups[k], indices);
    int32_t num_far = 0;
    for (int32_t m = 0; m < count; ++m) {
      if (are_far(side, from, indices[m])) indices[num_far++] = indices[m];
    }
    if (num_far == count) {
      second = list.dists[k];
    } else {
      kernels.squared_distances(query, side.set.bytes, indices, num_far, dists);
      for (int32_t m = 0; m < num_far; ++m) second = std::min(second, dists[m]);
    }
  }
  return second;
}

// Whether a descriptor at the row's smallest distance may have the row as its nearest one.
bool may_be_mutual(const tvk_nearest& row, const Side& side) {
  const int32_t best = row.dists[0];
  if (row.dists[kBound] == best) return true;
  int32_t indices[kBlock];
  for (int k = 0; k < kBound && row.dists[k] == best; ++k) {
    const int32_t count = members_of(side, row.groups[k], indices);
    for (int32_t m = 0; m < count; ++m) {
      if (side.lists[indices[m]].dists[0] == best) return true;
    }
  }
  return false;
}

// The ratio of a match at that squared distance; 1 where the second nearest one is not farther.
float ratio_of(int32_t best, int32_t second, double largest) {
  const double divisor = second == kNone ? largest : std::min<double>(second, largest);
  return second > best ? static_cast<float>(std::sqrt(best / divisor)) : 1.0f;
}

// Where descriptor i of the first side has a match, returns true and fills *match.
bool match_row(const tvk_table& kernels, const Side sides[2], const tv_match_options& options,
               int32_t i, tv_correspondence* match) {
  const tvk_nearest& row = sides[0].lists[i];
  if (!may_be_mutual(row, sides[1])) return false;
  const uint8_t* const row_query = sides[0].descriptor(i);
  const int32_t best = row.dists[0], j = nearest_of(kernels, row_query, row, sides[1]);
  if (j < 0 || sides[1].lists[j].dists[0] != best) return false;

  const bool bounded = options.max_distance > 0;
  const double largest =
      bounded ? static_cast<double>(options.max_distance) * options.max_distance : INT32_MAX;
  const tvk_nearest* const lists[2] = {&row, &sides[1].lists[j]};
  const uint8_t* const queries[2] = {row_query, sides[1].descriptor(j)};
  const int32_t from[2] = {j, i};
  int32_t second = kNone;
  // `second` is the distance of some second neighbour, so that a match that fails with it fails
  // with the nearest one, too.
  for (int v = 0; v < 2; ++v) {
    const Side& other = sides[1 - v];
    if (v == 1 && nearest_of(kernels, queries[1], *lists[1], other) != i) return false;
    const int32_t listed = listed_second(kernels, queries[v], *lists[v], other, from[v]);
    if (listed == kNone && !bounded && !has_far(other, from[v])) return false;
    second = std::min(second, listed);
    if (ratio_of(best, second, largest) >= options.ratio) return false;
  }
  for (int v = 0; v < 2; ++v) {
    if (lists[v]->dists[kBound] >= second) continue;
    second = std::min(second, scan(kernels, queries[v], sides[1 - v], from[v]).dist);
  }
  const float ratio = ratio_of(best, second, largest);
  *match = tv_correspondence{i, j, static_cast<uint32_t>(best), ratio};
  return ratio < options.ratio;
}

}  // namespace

size_t match_bytes(int32_t max_keypoints) {
  const size_t n = static_cast<size_t>(max_keypoints);
  return 2 * (arena_bytes<tvk_nearest>(n) + arena_bytes<uint16_t>(n)) +
         std::max(arena_bytes<uint8_t>(TVK_NEAREST_SCRATCH(max_keypoints, max_keypoints)),
                  arena_bytes<tv_correspondence>(n));
}

int32_t match_descriptors(const tvk_table& kernels, const tv_features& features0,
                          const tv_features& features1, const tv_match_options& options,
                          Arena& arena, const tv_correspondence** found) {
  const tv_features* const features[2] = {&features0, &features1};
  const size_t most = static_cast<size_t>(std::min(features0.num, features1.num));
  if (most == 0) return 0;
  uint8_t* const scratch =
      arena_alloc<uint8_t>(arena, std::max(TVK_NEAREST_SCRATCH(features0.num, features1.num),
                                           most * sizeof(tv_correspondence)));
  Side sides[2];
  for (int v = 0; v < 2; ++v) {
    const int32_t num = features[v]->num;
    uint16_t* const order = arena_alloc<uint16_t>(arena, static_cast<size_t>(num));
    sides[v] = Side{{features[v]->descriptors, order, num},
                    options.neighbourhood_px > 0 ? features[v]->keypoints : nullptr,
                    static_cast<double>(options.neighbourhood_px) * options.neighbourhood_px,
                    arena_alloc<tvk_nearest>(arena, static_cast<size_t>(num)),
                    TVK_NEAREST_GROUP};
    order_keypoints(sides[v].keypoints, num, scratch, order);
  }
  sides[0].group =
      kernels.nearest_groups(&sides[0].set, &sides[1].set, scratch, sides[1].lists, sides[0].lists);
  tv_correspondence* const matches = reinterpret_cast<tv_correspondence*>(scratch);
  int32_t count = 0;
  for (int32_t i = 0; i < features0.num; ++i) {
    count += match_row(kernels, sides, options, i, &matches[count]);
  }
  *found = matches;
  return count;
}

}  // namespace tv
