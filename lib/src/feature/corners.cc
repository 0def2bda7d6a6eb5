#include "feature/corners.h"

#include <algorithm>
#include <cstring>

#include "feature/subpixel.h"

namespace tv {
namespace {

struct Corner {
  uint16_t x, y;
  uint8_t score;
};

// The corners of one level, best first.
struct LevelCorners {
  Level level;
  tv_keypoint* keypoints;
  int32_t count;
};

size_t candidate_capacity(int32_t width, int32_t height) {
  // Two corners are never neighbours: at most one in each 2x2 block.
  return static_cast<size_t>((width + 1) / 2) * static_cast<size_t>((height + 1) / 2);
}

struct Workspace {
  uint8_t* scores[3];  // a ring of rows
  uint16_t* xs;
  Corner* candidates;
  Corner* sorted;
  uint16_t* cell_counts;
};

constexpr int32_t kMinCell = 8;

size_t max_cells(int32_t width, int32_t height) {
  return static_cast<size_t>(width / kMinCell + 1) * static_cast<size_t>(height / kMinCell + 1);
}

bool is_masked_out(const tv_image* mask, const Level& level, int32_t x, int32_t y) {
  if (mask == nullptr) return false;
  const int32_t full_x = static_cast<int32_t>(to_full(level, x) + 0.5);
  const int32_t full_y = static_cast<int32_t>(to_full(level, y) + 0.5);
  return mask->data[full_y * mask->stride_bytes + full_x] == 0;
}

// All corners of a level in raster order.
int32_t scan_level(const tvk_table& kernels, const Level& level, const tv_image* mask, int32_t arc,
                   int32_t threshold, Workspace& work) {
  const int32_t rim = TVK_CIRCLE_RADIUS;
  if (level.width <= 2 * rim || level.height <= 2 * rim) return 0;
  int32_t count = 0;
  memset(work.scores[(rim - 1) % 3], 0, static_cast<size_t>(level.width));
  for (int32_t y = rim; y <= level.height - rim; ++y) {
    uint8_t* row = work.scores[y % 3];
    if (y < level.height - rim) {
      const uint8_t* rows[7];
      for (int32_t k = 0; k < 7; ++k) rows[k] = level.data + (y - rim + k) * level.stride;
      kernels.fast_score_row(rows, level.width, arc, threshold, row);
    } else {
      memset(row, 0, static_cast<size_t>(level.width));
    }
    if (y == rim) continue;
    const uint8_t* middle = work.scores[(y - 1) % 3];
    const int32_t found =
        kernels.suppress_row(work.scores[(y - 2) % 3], middle, row, level.width, work.xs);
    for (int32_t k = 0; k < found; ++k) {
      const int32_t x = work.xs[k];
      if (is_masked_out(mask, level, x, y - 1)) continue;
      work.candidates[count++] =
          Corner{static_cast<uint16_t>(x), static_cast<uint16_t>(y - 1), middle[x]};
    }
  }
  return count;
}

// Counting sort to descending scores, raster order among equals. Corners below the adapted threshold
// are left out; returns how many remain.
int32_t sort_by_score(const Corner* corners, int32_t count, int32_t threshold,
                      int32_t min_threshold, int32_t wanted, Corner* sorted) {
  int32_t starts[257] = {0};  // starts[s]: how many have a score above s, in the end
  for (int32_t k = 0; k < count; ++k) ++starts[corners[k].score];
  int32_t above = 0;
  for (int32_t s = 255; s >= 0; --s) {
    const int32_t here = starts[s];
    starts[s] = above;
    above += here;
  }
  int32_t cutoff = threshold;
  while (cutoff > min_threshold && starts[cutoff - 1] < wanted) --cutoff;
  int32_t kept = 0;
  for (int32_t k = 0; k < count; ++k) {
    if (corners[k].score < cutoff) continue;
    sorted[starts[corners[k].score]++] = corners[k];
    ++kept;
  }
  return kept;
}

// Moves to the front up to `wanted` corners: first the best of each cell up to an even share, then
// the best of what is left. Returns how many; their order is of no account.
int32_t spread_over_grid(Corner* corners, int32_t count, int32_t wanted, const Level& level,
                         int32_t cell_px, uint16_t* cell_counts, Corner* rest) {
  if (count <= wanted || cell_px == 0) return std::min(count, wanted);
  const int32_t columns = level.width / cell_px + 1, rows = level.height / cell_px + 1;
  const int32_t share = (wanted + columns * rows - 1) / (columns * rows);
  memset(cell_counts, 0, static_cast<size_t>(columns * rows) * sizeof cell_counts[0]);
  int32_t taken = 0, left = 0;
  for (int32_t k = 0; k < count; ++k) {
    uint16_t& in_cell = cell_counts[corners[k].y / cell_px * columns + corners[k].x / cell_px];
    if (in_cell < share && taken < wanted) {
      ++in_cell;
      corners[taken++] = corners[k];
    } else {
      rest[left++] = corners[k];
    }
  }
  for (int32_t k = 0; k < left && taken < wanted; ++k) corners[taken++] = rest[k];
  return taken;
}

bool is_better(const tv_keypoint& a, const tv_keypoint& b) {
  if (a.score != b.score) return a.score > b.score;
  if (a.level != b.level) return a.level < b.level;
  if (a.y != b.y) return a.y < b.y;
  return a.x < b.x;
}

tv_keypoint make_keypoint(const tvk_table& kernels, const Corner& corner, const Level& level,
                          int32_t index, const tv_feature_options& options) {
  double x = corner.x, y = corner.y;
  if (options.subpixel != 0) {
    refine_corner(kernels, level, options.arc, corner.x, corner.y, &x, &y);
  }
  tv_keypoint keypoint;
  keypoint.x = static_cast<float>(to_full(level, x));
  keypoint.y = static_cast<float>(to_full(level, y));
  keypoint.size = static_cast<float>(options.keypoint_size * level.scale);
  keypoint.angle_rad = 0.0f;
  keypoint.score = corner.score;
  keypoint.level = index;
  return keypoint;
}

// The share of the budget that level `index` of `count` starts with: areas fall by factor squared.
int32_t level_share(int32_t budget, int32_t index, int32_t count, double factor) {
  double sum = 0.0, weight = 1.0, own = 1.0;
  for (int32_t k = 0; k < count; ++k) {
    if (k == index) own = weight;
    sum += weight;
    weight /= factor * factor;
  }
  return static_cast<int32_t>(budget * own / sum + 0.5);
}

int32_t count_levels(const tv_image& image, const tv_feature_options& options, double factor) {
  int32_t width = image.width, height = image.height, count = 1;
  while (count < options.levels) {
    width = static_cast<int32_t>(width / factor);
    height = static_cast<int32_t>(height / factor);
    if (width < kMinLevelSide || height < kMinLevelSide) break;
    ++count;
  }
  return count;
}

Workspace alloc_workspace(Arena& arena, int32_t width, int32_t height) {
  Workspace work;
  for (uint8_t*& row : work.scores) row = arena_alloc<uint8_t>(arena, static_cast<size_t>(width));
  work.xs = arena_alloc<uint16_t>(arena, static_cast<size_t>(width + 1) / 2);
  work.candidates = arena_alloc<Corner>(arena, candidate_capacity(width, height));
  work.sorted = arena_alloc<Corner>(arena, candidate_capacity(width, height));
  work.cell_counts = arena_alloc<uint16_t>(arena, max_cells(width, height));
  return work;
}

// The corners of a level within its share of the budget; returns how many.
int32_t collect_level(const tvk_table& kernels, const Level& level, const tv_image* mask,
                      const tv_feature_options& options, int32_t index, int32_t share,
                      Workspace& work, tv_keypoint* keypoints) {
  const int32_t lowest = options.min_threshold > 0 ? options.min_threshold : options.threshold;
  const int32_t found = scan_level(kernels, level, mask, options.arc, lowest, work);
  const int32_t sorted =
      sort_by_score(work.candidates, found, options.threshold, lowest, share, work.sorted);
  const int32_t kept = spread_over_grid(work.sorted, sorted, share, level, options.cell_px,
                                        work.cell_counts, work.candidates);
  for (int32_t k = 0; k < kept; ++k) {
    keypoints[k] = make_keypoint(kernels, work.sorted[k], level, index, options);
  }
  return kept;
}

}  // namespace

size_t corners_bytes(int32_t max_width, int32_t max_height) {
  const size_t width = static_cast<size_t>(max_width);
  return level_buffers_bytes(max_width, max_height) + 3 * arena_bytes<uint8_t>(width) +
         arena_bytes<uint16_t>((width + 1) / 2) +
         2 * arena_bytes<Corner>(candidate_capacity(max_width, max_height)) +
         arena_bytes<uint16_t>(max_cells(max_width, max_height));
}

int32_t find_corners(const tvk_table& kernels, const tv_image& image, const tv_image* mask,
                     const tv_feature_options& options, int32_t budget, Arena& arena,
                     tv_keypoint* keypoints) {
  ArenaScope scope(arena);
  const double factor = options.scale_factor;
  LevelBuffers buffers = alloc_level_buffers(arena, image.width, image.height);
  Workspace work = alloc_workspace(arena, image.width, image.height);
  const int32_t levels = count_levels(image, options, factor);
  Level level = full_level(image);
  int32_t count = 0;
  for (int32_t k = 0; k < levels; ++k) {
    // Whatever a finer level left unused is the coarser ones' to use.
    int32_t share = level_share(budget, k, levels, factor);
    int32_t promised = 0;
    for (int32_t j = k + 1; j < levels; ++j) promised += level_share(budget, j, levels, factor);
    share = std::max(share, budget - count - promised);
    share = std::min(share, budget - count);
    count += collect_level(kernels, level, mask, options, k, share, work, keypoints + count);
    if (k + 1 < levels) next_level(kernels, level, factor, k, buffers, &level);
  }
  std::sort(keypoints, keypoints + count, is_better);
  return count;
}

}  // namespace tv
