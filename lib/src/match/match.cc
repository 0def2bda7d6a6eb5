// Matching by the kernel nearest_groups and the ratio test. Formulas: docs/algorithms/match.md;
// test: test/unit/test_match.c.
//
// The kernel lists for each descriptor the groups of the other image's descriptors that are nearest
// to it. They hold the nearest descriptor, and nearly always the second nearest one outside its
// neighbourhood; the bounds of a list say whether a nearer one may be elsewhere. Where one may, and
// the match passes the ratio test so far, the descriptors of these bins, or all, are scanned.
#include "match/match.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tv {
namespace {

constexpr int32_t kNone = TVK_NEAREST_NONE;
constexpr int kLast = TVK_NEAREST_LIST - 1;  // a list's entry that bounds the distance of the rest
constexpr int32_t kBlock = 64;               // distances that are computed in one call
constexpr int32_t kMostMembers = 8;          // at least the descriptors of a group
// The bounding box of the keypoints has 32 strips of 128 cells, or fewer if it is not a square.
constexpr int32_t kNumStrips = 32, kStripCells = 128, kNumCells = kNumStrips * kStripCells;
constexpr int kStripShift = 2;     // a strip is as wide as 1 << kStripShift cells are long
constexpr double kTwice = 4.0001;  // the square of 2, and more than any rounding error
constexpr double kAbove = 1.0001;  // likewise, of 1

struct Side {
  tvk_descriptors set;
  const tv_keypoint* keypoints;  // null: each other keypoint counts as the second nearest
  double near_sq;                // square of neighbourhood_px
  bool spread;                   // whether some keypoint is far from each one
  int32_t group;                 // how many descriptors a group has
  int32_t bins;                  // group g is in the bin g % bins

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
  if (side.spread) return true;
  int32_t k = 0;
  while (k < side.set.num && !are_far(side, from, k)) ++k;
  return k < side.set.num;
}

// Numbers the cells of a strip one after another.
int32_t cell_of(const tv_keypoint& keypoint, const float* lowest, float scale) {
  const int32_t x = static_cast<int32_t>((keypoint.x - lowest[0]) * scale);
  const int32_t y = static_cast<int32_t>((keypoint.y - lowest[1]) * scale) >> kStripShift;
  return std::min(y, kNumStrips - 1) * kStripCells + std::min(x, kStripCells - 1);
}

// Ranks the keypoints along the strips of the image, so that those of a neighbourhood have ranks
// that are close to each other, or in two strips. The order affects the time only. Returns the
// longer side of the keypoints' bounding box.
float order_keypoints(const tv_keypoint* keypoints, int32_t num, void* scratch, uint16_t* order) {
  if (keypoints == nullptr) {
    for (int32_t k = 0; k < num; ++k) order[k] = static_cast<uint16_t>(k);
    return 0;
  }
  float lowest[2] = {keypoints[0].x, keypoints[0].y}, highest[2] = {lowest[0], lowest[1]};
  for (int32_t k = 0; k < num; ++k) {
    lowest[0] = std::min(lowest[0], keypoints[k].x);
    lowest[1] = std::min(lowest[1], keypoints[k].y);
    highest[0] = std::max(highest[0], keypoints[k].x);
    highest[1] = std::max(highest[1], keypoints[k].y);
  }
  const float side = std::max(highest[0] - lowest[0], highest[1] - lowest[1]);
  const float scale = static_cast<float>(kStripCells) / std::max(side, 1.0f);
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
  return side;
}

// A descriptor, the descriptors of the other image that it is compared with, and the list of its
// nearest groups.
struct Query {
  const tvk_match_table* kernels;
  const uint8_t* descriptor;
  const Side* side;
  const tvk_nearest* list;
};

struct Nearest {
  int32_t dist, rank;
};

// The nearest descriptor of a bin of the side, or of those of the bin that are far from keypoint
// `from` if that is not negative, if it is nearer than `nearest` or as near and of a lower index.
// All descriptors are in bin 0 of 1.
Nearest scan(const Query& query, int32_t from, int32_t bin, int32_t bins, Nearest nearest) {
  const Side& side = *query.side;
  const uint16_t* const order = side.set.order;
  int32_t ranks[kBlock], indices[kBlock], dists[kBlock], count = 0;
  int32_t rank = bin * side.group, left = side.group;  // left of the group
  while (rank < side.set.num) {
    ranks[count] = rank;
    indices[count++] = order[rank++];
    if (--left == 0) {
      rank += (bins - 1) * side.group;
      left = side.group;
    }
    if (count < kBlock && rank < side.set.num) continue;
    query.kernels->squared_distances(query.descriptor, side.set.bytes, indices, count, dists);
    for (int32_t k = 0; k < count; ++k) {
      const int32_t closer = nearest.dist - dists[k];
      if (closer < 0 || (closer == 0 && indices[k] >= order[nearest.rank])) continue;
      if (from < 0 || are_far(side, from, indices[k])) nearest = Nearest{dists[k], ranks[k]};
    }
    count = 0;
  }
  return nearest;
}

// Descriptors of a group and their distances to a query.
struct Group {
  int32_t count, ranks[kMostMembers], dists[kMostMembers];
};

// Computes the distances to the other members of the group that the descriptor of this rank belongs
// to.
void measure(const Query& query, int32_t rank, Group* group) {
  const Side& side = *query.side;
  int32_t indices[kMostMembers];
  const int32_t first = rank / side.group * side.group;
  const int32_t end = std::min(first + side.group, side.set.num);
  group->count = 0;
  for (int32_t k = first; k < end; ++k) {
    if (k == rank) continue;
    group->ranks[group->count] = k;
    indices[group->count++] = side.set.order[k];
  }
  query.kernels->squared_distances(query.descriptor, side.set.bytes, indices, group->count,
                                   group->dists);
}

// Returns the rank of the nearest descriptor of the other side (of equally near ones, the one with
// the lowest index), and writes the other members of its group to *group. Returns -1 if two equally
// near descriptors are far enough apart for either to be the second neighbour of the other: then
// the ratio is 1, and the match fails.
int32_t nearest_of(const Query& query, Group* group) {
  const Side& side = *query.side;
  const tvk_nearest& list = *query.list;
  const int32_t best = list.keys[0] >> 1;
  const uint16_t* const order = side.set.order;
  int32_t found = list.ranks[0];
  bool hidden = false;  // whether equal ones may be in groups that are not listed
  for (int k = 0; k < TVK_NEAREST_LIST && list.keys[k] >> 1 == best; ++k) {
    Group others;
    Group* const equal = k == 0 ? group : &others;
    measure(query, list.ranks[k], equal);
    hidden |= (list.keys[k] & 1) != 0 || k == kLast;
    for (int32_t m = -1; m < equal->count; ++m) {
      const int32_t rank = m < 0 ? list.ranks[k] : equal->ranks[m];
      if ((m >= 0 && equal->dists[m] != best) || rank == found) continue;
      if (are_far(side, order[found], order[rank], kTwice)) return -1;
      if (order[rank] < order[found]) found = rank;
    }
  }
  return hidden ? scan(query, -1, 0, 1, Nearest{best, found}).rank : found;
}

// The smaller of `second` and the smallest distance of the listed descriptors that are far from
// keypoint `from`. `nearest`: the first group.
int32_t listed_second(const Query& query, int32_t from, const Group& nearest, int32_t second) {
  const Side& side = *query.side;
  const tvk_nearest& list = *query.list;
  const uint16_t* const order = side.set.order;
  int32_t num_near = 0;
  while (num_near < TVK_NEAREST_LIST && list.keys[num_near] >> 1 < second) {
    const int32_t idx = order[list.ranks[num_near]];
    if (idx != from && are_far(side, from, idx)) {
      second = list.keys[num_near] >> 1;
      break;
    }
    ++num_near;
  }
  // The other members of the groups that are listed before.
  for (int k = 0; k < num_near && list.keys[k] >> 1 < second; ++k) {
    Group other;
    const Group* const group = k == 0 ? &nearest : &other;
    if (k > 0) measure(query, list.ranks[k], &other);
    for (int32_t m = 0; m < group->count; ++m) {
      if (group->dists[m] < second && are_far(side, from, order[group->ranks[m]])) {
        second = group->dists[m];
      }
    }
  }
  return second;
}

// The smaller of `second` and the smallest distance of the descriptors that are far from keypoint
// `from`. Scans the bins with a bound below `second`, or all if the last entry is below it.
int32_t nearest_second(const Query& query, int32_t from, int32_t second) {
  const tvk_nearest& list = *query.list;
  Nearest nearest{second, 0};
  int k = list.keys[kLast] >> 1 < second ? kLast : 0;
  for (; k < TVK_NEAREST_LIST && list.keys[k] >> 1 < nearest.dist; ++k) {
    const int32_t bins = k == kLast ? 1 : query.side->bins;
    if (k < kLast && (list.keys[k] & 1) == 0) continue;
    nearest = scan(query, from, list.ranks[k] / query.side->group % bins, bins, nearest);
  }
  return nearest.dist;
}

// Copies the list that belongs to the column of this rank.
void copy_list(const tvk_nearest_lists* of_columns, int32_t rank, tvk_nearest* list) {
  const tvk_nearest_lists& lists = of_columns[TVK_NEAREST_NUMBER(rank)];
  for (int k = 0; k < TVK_NEAREST_LIST; ++k) {
    list->keys[k] = lists.entries[k].keys[TVK_NEAREST_LANE(rank)];
    list->ranks[k] = lists.entries[k].ranks[TVK_NEAREST_LANE(rank)];
  }
}

int32_t distance_of(const tvk_nearest_lists* of_columns, int32_t rank) {
  return of_columns[TVK_NEAREST_NUMBER(rank)].entries[0].keys[TVK_NEAREST_LANE(rank)] >> 1;
}

// Whether a descriptor at the row's smallest distance may have the row as its nearest one.
bool may_be_mutual(const tvk_nearest& row, const tvk_nearest_lists* of_columns) {
  const int32_t best = row.keys[0] >> 1;
  bool mutual = row.keys[1] >> 1 == best;  // another group is as near
  // Lists after the last column hold no distances of columns; they may make a row pass, no more.
  const int32_t first = row.ranks[0] & ~(TVK_NEAREST_GROUP - 1);
  for (int m = 0; m < TVK_NEAREST_GROUP; ++m) {
    mutual |= distance_of(of_columns, first + m) == best;
  }
  return mutual;
}

// The ratio of a match at that squared distance; 1 where the second nearest one is not farther.
float ratio_of(int32_t best, int32_t second, double largest) {
  const double divisor = second == kNone ? largest : std::min<double>(second, largest);
  return second > best ? static_cast<float>(std::sqrt(best / divisor)) : 1.0f;
}

// Where descriptor i of the first side has a match, returns true and fills *match.
bool match_row(const tvk_match_table& kernels, const Side sides[2], const tvk_nearest& row,
               const tvk_nearest_lists* of_columns, const tv_match_options& options, int32_t i,
               tv_correspondence* match) {
  if (!may_be_mutual(row, of_columns)) return false;
  tvk_nearest column;
  Query queries[2] = {{&kernels, sides[0].descriptor(i), &sides[1], &row},
                      {&kernels, nullptr, &sides[0], &column}};
  const int32_t best = row.keys[0] >> 1;
  Group group;
  const int32_t rank = nearest_of(queries[0], &group);
  if (rank < 0 || distance_of(of_columns, rank) != best) return false;

  const int32_t j = sides[1].set.order[rank];
  const bool bounded = options.max_distance > 0;
  const double largest =
      bounded ? static_cast<double>(options.max_distance) * options.max_distance : INT32_MAX;
  copy_list(of_columns, rank, &column);
  queries[1].descriptor = sides[1].descriptor(j);
  // No match passes whose smallest distance is above `most` times the second one.
  const double most = kAbove * options.ratio * options.ratio;
  const int32_t from[2] = {j, i};
  int32_t second = kNone;
  // `second` is the distance of one of the second neighbours, not always of the nearest one; a
  // match that fails the ratio test with it also fails with the nearest one.
  for (int v = 0; v < 2; ++v) {
    if (v == 1) {
      const int32_t back = nearest_of(queries[1], &group);
      if (back < 0 || sides[0].set.order[back] != i) return false;
    }
    second = listed_second(queries[v], from[v], group, second);
    if (!bounded && !has_far(sides[1 - v], from[v])) return false;
    if (best > most * std::min<double>(second, largest)) return false;
  }
  for (int v = 0; v < 2; ++v) {
    second = nearest_second(queries[v], from[v], second);
  }
  const float ratio = ratio_of(best, second, largest);
  *match = tv_correspondence{i, j, static_cast<uint32_t>(best), ratio};
  return ratio < options.ratio;
}

}  // namespace

size_t match_bytes(int32_t max_keypoints) {
  const size_t n = static_cast<size_t>(max_keypoints);
  return arena_bytes<tvk_nearest>(n) + arena_bytes<tvk_nearest_lists>(TVK_NEAREST_LISTS(n)) +
         2 * arena_bytes<uint16_t>(n) +
         std::max(arena_bytes<uint8_t>(TVK_NEAREST_SCRATCH(max_keypoints, max_keypoints)),
                  arena_bytes<tv_correspondence>(n));
}

int32_t match_descriptors(const tvk_set& set, const tv_features& features0,
                          const tv_features& features1, const tv_match_options& options,
                          Arena& arena, const tv_correspondence** found) {
  const tvk_match_table& kernels = *tvk_match_of(&set);
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
                    false,
                    TVK_NEAREST_GROUP,
                    1};
    const double extent = order_keypoints(sides[v].keypoints, num, scratch, order);
    sides[v].spread = extent * extent > kTwice * sides[v].near_sq;
  }
  tvk_nearest* const of_rows = arena_alloc<tvk_nearest>(arena, static_cast<size_t>(features0.num));
  tvk_nearest_lists* const of_columns =
      arena_alloc<tvk_nearest_lists>(arena, TVK_NEAREST_LISTS(static_cast<size_t>(features1.num)));
  const tvk_nearest_shape shape =
      kernels.nearest_groups(&sides[0].set, &sides[1].set, scratch, of_columns, of_rows);
  sides[0].group = shape.row_group;
  sides[0].bins = shape.row_bins;
  sides[1].bins = shape.column_bins;
  tv_correspondence* const matches = reinterpret_cast<tv_correspondence*>(scratch);
  int32_t count = 0;
  for (int32_t i = 0; i < features0.num; ++i) {
    count += match_row(kernels, sides, of_rows[i], of_columns, options, i, &matches[count]);
  }
  *found = matches;
  return count;
}

}  // namespace tv
