// Finds the corners of one image over the levels of its pyramid. Problem and formulas:
// docs/algorithms/fast.md; test: test/unit/test_fast.cc.
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

size_t candidate_capacity(int32_t width, int32_t height) {
  // Non-maximum suppression never keeps two neighbours, so each 2x2 block holds at most one corner.
  return static_cast<size_t>((width + 1) / 2) * static_cast<size_t>((height + 1) / 2);
}

struct Workspace {
  uint8_t* scores[3];  // the scores of three rows; row y is in scores[y % 3]
  uint16_t* xs;
  Corner* candidates;
  Corner* sorted;
  uint16_t* cell_counts;
  uint32_t* marks;
};

constexpr int32_t kMinCell = 8;

size_t max_cells(int32_t width, int32_t height) {
  return static_cast<size_t>(width / kMinCell + 1) * static_cast<size_t>(height / kMinCell + 1);
}

// 32-bit words with a bit for each pixel of a level.
size_t marks_count(int32_t width, int32_t height) {
  return (static_cast<size_t>(width) * static_cast<size_t>(height) + 31) / 32;
}

bool is_masked_out(const tv_image* mask, const Level& level, int32_t x, int32_t y) {
  if (mask == nullptr) return false;
  const int32_t full_x = static_cast<int32_t>(to_full(level, x) + 0.5);
  const int32_t full_y = static_cast<int32_t>(to_full(level, y) + 0.5);
  return mask->data[full_y * mask->stride_bytes + full_x] == 0;
}

// The number of candidates of each score.
struct Histogram {
  int32_t counts[256];
};

// Appends the corners that the kernel found in row y at xs[0 .. found) to the candidates, except
// masked ones, those below the threshold and those nearer to the border than `border`. Returns the
// new number of candidates.
int32_t add_row(const Level& level, const tv_image* mask, int32_t border, int32_t threshold,
                const uint16_t* xs, int32_t found, int32_t y, const uint8_t* scores,
                Corner* candidates, int32_t count, Histogram& histogram) {
  if (y < border || y + border >= level.height) return count;
  for (int32_t k = 0; k < found; ++k) {
    const int32_t x = xs[k];
    if (scores[x] < threshold || x < border || x + border >= level.width) continue;
    if (is_masked_out(mask, level, x, y)) continue;
    candidates[count++] = Corner{static_cast<uint16_t>(x), static_cast<uint16_t>(y), scores[x]};
    ++histogram.counts[scores[x]];
  }
  return count;
}

// Writes the corners of a level to work.candidates in raster order and returns their number. All
// corners that can be among the `wanted` best are included. Once at least `wanted` corners score
// above the threshold, the threshold rises by one for the rest of the image, up to `highest`.
int32_t scan_level(const tvk_detect_table& kernels, const Level& level, const tv_image* mask,
                   const tv_feature_options& options, int32_t threshold, int32_t highest,
                   int32_t wanted, Workspace& work, Histogram& histogram) {
  const int32_t rim = TVK_CIRCLE_RADIUS;
  // A corner that cannot move to a maximum, for lack of pixels, is elsewhere in another view.
  const int32_t border = options.subpixel != 0 ? TVK_HESSIAN_REACH : rim;
  histogram = Histogram{};
  if (level.width <= 2 * rim || level.height <= 2 * rim) return 0;
  int32_t count = 0, below = 0;  // the candidates, and how many of them are below the threshold
  memset(work.scores[(rim - 1) % 3], 0, static_cast<size_t>(level.width));
  for (int32_t y = rim; y <= level.height - rim; ++y) {
    uint8_t* row = work.scores[y % 3];
    if (y < level.height - rim) {
      const uint8_t* rows[7];
      for (int32_t k = 0; k < 7; ++k) rows[k] = level.data + (y - rim + k) * level.stride;
      kernels.fast_score_row(rows, level.width, options.arc, threshold, row);
    } else {
      memset(row, 0, static_cast<size_t>(level.width));
    }
    if (y == rim) continue;
    const uint8_t* middle = work.scores[(y - 1) % 3];
    const int32_t found =
        kernels.suppress_row(work.scores[(y - 2) % 3], middle, row, level.width, work.xs);
    count = add_row(level, mask, border, threshold, work.xs, found, y - 1, middle, work.candidates,
                    count, histogram);
    while (threshold < highest && count - below - histogram.counts[threshold] >= wanted) {
      below += histogram.counts[threshold++];
    }
  }
  return count;
}

// Counting sort by descending score; corners of equal score keep their raster order. Corners below
// a cutoff are left out: the cutoff is the highest score at which at least `wanted` corners remain,
// limited to [lowest, highest]. Returns the number of corners kept.
int32_t sort_by_score(const Corner* corners, int32_t count, const Histogram& histogram,
                      int32_t lowest, int32_t highest, int32_t wanted, Corner* sorted,
                      int32_t* chosen_cutoff) {
  int32_t starts[256];  // for each score, the place of its next corner in `sorted`
  int32_t cutoff = 255, kept = 0;
  while (cutoff > lowest && (cutoff > highest || kept < wanted)) {
    starts[--cutoff] = kept;
    kept += histogram.counts[cutoff];
  }
  for (int32_t k = 0; k < count; ++k) {
    if (corners[k].score >= cutoff) sorted[starts[corners[k].score]++] = corners[k];
  }
  *chosen_cutoff = cutoff;
  return kept;
}

// Moves up to `wanted` corners to the front: first the best of each grid cell, up to an equal share
// of `wanted` for each cell, then the best of all others. Returns their number. Their order means
// nothing afterwards.
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

// A total order of keypoints of one score, so that the result does not depend on the sorting
// algorithm.
struct ComesBefore {
  bool operator()(const tv_keypoint& a, const tv_keypoint& b) const {
    if (a.level != b.level) return a.level < b.level;
    if (a.y != b.y) return a.y < b.y;
    return a.x < b.x;
  }
};

// Writes the keypoints to `sorted`, best first: by a counting sort by score, which is a byte; only
// runs of equal scores, which are short, then need sorting.
void sort_keypoints(const tv_keypoint* keypoints, int32_t count, tv_keypoint* sorted) {
  int32_t ends[257] = {0};  // for each score, the number of higher ones: where its next one goes
  const auto place = [](const tv_keypoint& k) { return 255 - static_cast<int32_t>(k.score); };
  for (int32_t k = 0; k < count; ++k) ++ends[place(keypoints[k]) + 1];
  for (int32_t p = 0; p < 256; ++p) ends[p + 1] += ends[p];
  for (int32_t k = 0; k < count; ++k) sorted[ends[place(keypoints[k])]++] = keypoints[k];
  for (int32_t p = 0, begin = 0; p < 256; begin = ends[p++]) {
    std::sort(sorted + begin, sorted + ends[p], ComesBefore());
  }
}

// Whether the pixel was marked before; marks it. `marks` holds a bit for each pixel of the level.
bool mark_pixel(uint32_t* marks, const Level& level, int32_t x, int32_t y) {
  const uint32_t place = static_cast<uint32_t>(y * level.width + x), bit = 1u << (place & 31);
  const bool was_marked = (marks[place >> 5] & bit) != 0;
  marks[place >> 5] |= bit;
  return was_marked;
}

// Makes keypoints from the corners of a level and returns their number. With subpixel positions,
// two corners may move to the same maximum: the first one becomes a keypoint, the others do not. A
// corner does not move to a pixel that is masked out.
int32_t make_keypoints(const tvk_detect_table& kernels, const Corner* corners, int32_t count,
                       const Level& level, int32_t index, const tv_image* mask,
                       const tv_feature_options& options, uint32_t* marks, tv_keypoint* keypoints) {
  int32_t determinants[2][TVK_HESSIAN_PLACES];  // of corners k and k + 1, for even k
  const auto at = [&](const Corner& c) { return level.data + c.y * level.stride + c.x; };
  int32_t made = 0;
  memset(marks, 0, marks_count(level.width, level.height) * sizeof marks[0]);
  for (int32_t k = 0; k < count; ++k) {
    const int32_t corner_x = corners[k].x, corner_y = corners[k].y;
    double x = corner_x, y = corner_y;
    Peak peak;
    if (options.subpixel != 0 && k % 2 == 0) {
      const uint8_t* const centres[2] = {at(corners[k]), at(corners[std::min(k + 1, count - 1)])};
      kernels.hessian_determinants(centres, level.stride, determinants[0]);
    }
    if (options.subpixel != 0 && find_peak(determinants[k % 2], corner_x, corner_y, &peak) &&
        !is_masked_out(mask, level, peak.pixel_x, peak.pixel_y)) {
      if (mark_pixel(marks, level, peak.pixel_x, peak.pixel_y)) continue;
      x = peak.x;
      y = peak.y;
    }
    tv_keypoint& keypoint = keypoints[made++];
    keypoint.x = static_cast<float>(to_full(level, x));
    keypoint.y = static_cast<float>(to_full(level, y));
    keypoint.size = static_cast<float>(options.keypoint_size * level.scale);
    keypoint.angle_rad = 0.0f;
    keypoint.score = corners[k].score;
    keypoint.level = index;
  }
  return made;
}

// The part of the budget that level `index` of `count` may use at least, in proportion to its area:
// areas fall by factor squared from level to level.
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
  work.marks = arena_alloc<uint32_t>(arena, marks_count(width, height));
  return work;
}

// Writes the best corners of a level, `share` of them at most, as keypoints and returns their
// number. *cutoff is the lowest score that counted on the level before, 0 for the first one: mostly
// as many corners are above it here. Else the level is scanned a second time. It becomes that of
// this level.
int32_t collect_level(const tvk_detect_table& kernels, const Level& level, const tv_image* mask,
                      const tv_feature_options& options, int32_t index, int32_t share,
                      int32_t* cutoff, Workspace& work, tv_keypoint* keypoints) {
  const int32_t lowest = options.min_threshold > 0 ? options.min_threshold : options.threshold;
  // Without a grid the threshold may rise, because only the best corners count. With a grid it may
  // not rise above options.threshold, because weaker corners can fill a cell.
  const int32_t highest = options.cell_px == 0 ? 254 : options.threshold;
  Histogram histogram;
  const int32_t start = std::max(lowest, *cutoff);
  int32_t found = scan_level(kernels, level, mask, options, start, highest, share, work, histogram);
  if (found < share && start > lowest) {
    found = scan_level(kernels, level, mask, options, lowest, highest, share, work, histogram);
  }
  const int32_t sorted =
      sort_by_score(work.candidates, found, histogram, lowest, highest, share, work.sorted, cutoff);
  const int32_t kept = spread_over_grid(work.sorted, sorted, share, level, options.cell_px,
                                        work.cell_counts, work.candidates);
  return make_keypoints(kernels, work.sorted, kept, level, index, mask, options, work.marks,
                        keypoints);
}

}  // namespace

size_t corners_bytes(int32_t max_width, int32_t max_height) {
  const size_t width = static_cast<size_t>(max_width);
  return level_buffers_bytes(max_width, max_height) + 3 * arena_bytes<uint8_t>(width) +
         arena_bytes<uint16_t>((width + 1) / 2) +
         2 * arena_bytes<Corner>(candidate_capacity(max_width, max_height)) +
         arena_bytes<uint16_t>(max_cells(max_width, max_height)) +
         arena_bytes<uint32_t>(marks_count(max_width, max_height));
}

int32_t find_corners(const tvk_set& set, const tv_image& image, const tv_image* mask,
                     const tv_feature_options& options, int32_t budget, Arena& arena,
                     tv_keypoint* keypoints) {
  ArenaScope scope(arena);
  const double factor = options.scale_factor;
  LevelBuffers buffers = alloc_level_buffers(arena, image.width, image.height);
  Workspace work = alloc_workspace(arena, image.width, image.height);
  tv_keypoint* found = arena_alloc<tv_keypoint>(arena, static_cast<size_t>(budget));
  const int32_t levels = count_levels(image, options, factor);
  Level level = full_level(image);
  int32_t count = 0, cutoff = 0;
  for (int32_t k = 0; k < levels; ++k) {
    // A level may also use what the finer levels left of their shares.
    int32_t share = level_share(budget, k, levels, factor);
    int32_t promised = 0;
    for (int32_t j = k + 1; j < levels; ++j) promised += level_share(budget, j, levels, factor);
    share = std::max(share, budget - count - promised);
    share = std::min(share, budget - count);
    count += collect_level(*tvk_detect_of(&set), level, mask, options, k, share, &cutoff, work,
                           found + count);
    if (k + 1 < levels) next_level(set, level, factor, k, buffers, &level);
  }
  sort_keypoints(found, count, keypoints);
  return count;
}

}  // namespace tv
