#include "match/match.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tv {
namespace {

constexpr int32_t kFar = INT32_MAX;

struct Nearest {
  int32_t best, second, idx;
};

// Rows of one side that stay in the first-level cache while all of the other side meet them.
constexpr int32_t kBlock = 64;

// Takes in the distances to rows first .. first + count - 1, which come in ascending order.
void update_row(const int32_t* dist, int32_t first, int32_t count, Nearest* nearest) {
  for (int32_t j = 0; j < count; ++j) {
    const int32_t d = dist[j];
    if (d >= nearest->second) continue;
    if (d < nearest->best) {
      nearest->second = nearest->best;
      nearest->best = d;
      nearest->idx = first + j;
    } else {
      nearest->second = d;
    }
  }
}

// Distance to the nearest over distance to the second nearest; 1 where there is no second, or where
// both are 0.
float distance_ratio(int32_t best, int32_t second) {
  if (second == kFar || second == 0) return 1.0f;
  return static_cast<float>(std::sqrt(static_cast<double>(best) / static_cast<double>(second)));
}

}  // namespace

size_t descriptor_rows_bytes(int32_t count) {
  const size_t n = static_cast<size_t>(count);
  return arena_bytes<int16_t>(n * TV_DESCRIPTOR_BYTES) + arena_bytes<int32_t>(n);
}

DescriptorRows prepare_descriptors(const tvk_table& kernels, const uint8_t* descriptors,
                                   int32_t count, Arena& arena) {
  const size_t n = static_cast<size_t>(count);
  DescriptorRows side{arena_alloc<int16_t>(arena, n * TV_DESCRIPTOR_BYTES),
                      arena_alloc<int32_t>(arena, n)};
  for (int32_t k = 0; k < count; ++k) {
    int16_t* row = side.rows + static_cast<int64_t>(k) * TV_DESCRIPTOR_BYTES;
    kernels.widen(descriptors + static_cast<int64_t>(k) * TV_DESCRIPTOR_BYTES, TV_DESCRIPTOR_BYTES,
                  row);
    int32_t norm = 0;
    for (int32_t i = 0; i < TV_DESCRIPTOR_BYTES; ++i) norm += row[i] * row[i];
    side.norms[k] = norm;
  }
  return side;
}

size_t match_bytes(int32_t max_keypoints) {
  const size_t n = static_cast<size_t>(max_keypoints);
  return 2 * descriptor_rows_bytes(max_keypoints) + 3 * arena_bytes<int32_t>(n) +
         arena_bytes<Nearest>(n) + arena_bytes<tv_correspondence>(n);
}

int32_t match_descriptors(const tvk_table& kernels, const uint8_t* descriptors0, int32_t num0,
                          const uint8_t* descriptors1, int32_t num1, float ratio, Arena& arena,
                          tv_correspondence* correspondences) {
  if (num0 == 0 || num1 == 0) return 0;
  ArenaScope scope(arena);
  const DescriptorRows side0 = prepare_descriptors(kernels, descriptors0, num0, arena);
  const DescriptorRows side1 = prepare_descriptors(kernels, descriptors1, num1, arena);
  const size_t columns = static_cast<size_t>(num1);
  int32_t dist[kBlock];
  int32_t* best = arena_alloc<int32_t>(arena, columns);
  int32_t* second = arena_alloc<int32_t>(arena, columns);
  int32_t* best_row = arena_alloc<int32_t>(arena, columns);
  Nearest* rows = arena_alloc<Nearest>(arena, static_cast<size_t>(num0));
  std::fill(best, best + num1, kFar);
  std::fill(second, second + num1, kFar);
  std::fill(best_row, best_row + num1, -1);
  std::fill(rows, rows + num0, Nearest{kFar, kFar, -1});
  for (int32_t first = 0; first < num1; first += kBlock) {
    const int32_t width = std::min(kBlock, num1 - first);
    const int16_t* block = side1.rows + static_cast<int64_t>(first) * TV_DESCRIPTOR_BYTES;
    for (int32_t i = 0; i < num0; ++i) {
      kernels.squared_distances(side0.rows + static_cast<int64_t>(i) * TV_DESCRIPTOR_BYTES,
                                side0.norms[i], block, side1.norms + first, width, dist);
      const int32_t smallest = kernels.update_columns(dist, width, i, best + first, second + first,
                                                      best_row + first);
      if (smallest < rows[i].second) update_row(dist, first, width, &rows[i]);
    }
  }
  int32_t count = 0;
  for (int32_t i = 0; i < num0; ++i) {
    const int32_t j = rows[i].idx;
    if (j < 0 || best_row[j] != i) continue;
    const float worse = std::max(distance_ratio(rows[i].best, rows[i].second),
                                 distance_ratio(best[j], second[j]));
    if (worse >= ratio) continue;
    correspondences[count++] =
        tv_correspondence{i, j, static_cast<uint32_t>(rows[i].best), worse};
  }
  return count;
}

}  // namespace tv
