// The codes, the three paths and the choice of semi-global matching.
#include "dense/sweep.h"

#include <algorithm>
#include <cstring>

namespace tv {
namespace {

// The least margin of the winner's sum over that of every step but its neighbours, in bits.
constexpr int32_t kLeastMargin = 2;
// A pixel is brighter than another if it is so by more than this, in grey levels.
constexpr int32_t kLeastTolerance = 2;
// The lower quartile of |noise operator| from which on images are smoothed first; 1.9 times the
// standard deviation of a pixel (J. Immerkaer, CVIU 1996, with a quartile in place of the mean).
constexpr int32_t kNoisy = 3;
constexpr int32_t kNoiseBins = 64, kNoiseEvery = 8;  // rows

// The bytes of an array of a row: kernels write whole blocks.
size_t row_bytes(int32_t columns) { return static_cast<size_t>(columns) + 2 * TVK_DENSE_BLOCK; }

// The lower quartile, over every kNoiseEvery-th row, of |(1 -2 1)' (1 -2 1)| over 3 x 3 pixels.
int32_t noise_of(const uint8_t* pixels, int32_t width, int32_t height) {
  int32_t bins[kNoiseBins] = {}, total = 0;
  for (int32_t y = 1; y < height - 1; y += kNoiseEvery) {
    const uint8_t* p = pixels + static_cast<ptrdiff_t>(y) * width;
    for (int32_t x = 1; x < width - 1; ++x) {
      const uint8_t *a = p + x - width, *b = p + x, *c = p + x + width;
      if (a[-1] == 0 || a[1] == 0 || c[-1] == 0 || c[1] == 0 || b[0] == 0) continue;
      const int32_t value =
          a[-1] - 2 * a[0] + a[1] - 2 * (b[-1] - 2 * b[0] + b[1]) + c[-1] - 2 * c[0] + c[1];
      ++bins[std::min(value < 0 ? -value : value, kNoiseBins - 1)];
      ++total;
    }
  }
  int32_t quartile = 0;
  for (int32_t sum = bins[0]; 4 * sum < total; sum += bins[quartile]) ++quartile;
  return quartile;
}

// An image with its rows repeated beyond its first and last, smoothed or not.
struct Source {
  const uint8_t* pixels;
  int32_t width, height;
  const uint8_t* row(int32_t y) const {
    return pixels + static_cast<ptrdiff_t>(std::min(std::max(y, 0), height - 1)) * width;
  }
};

Source smoothed(const Source& from, const tvk_dense_table& kernels, uint8_t* to) {
  for (int32_t y = 0; y < from.height; ++y) {
    const uint8_t* const rows[3] = {from.row(y - 1), from.row(y), from.row(y + 1)};
    kernels.smooth_row(rows, from.width, to + static_cast<ptrdiff_t>(y) * from.width);
  }
  return {to, from.width, from.height};
}

void codes_of(const Source& source, const tvk_dense_table& kernels, int32_t y, int32_t tolerance,
              uint8_t* brighter, uint8_t* darker) {
  constexpr int32_t kReach = TVK_DENSE_CENSUS_REACH;
  const uint8_t* rows[2 * kReach + 1];
  for (int32_t v = -kReach; v <= kReach; ++v) rows[v + kReach] = source.row(y + v);
  kernels.census_codes(rows, source.width, tolerance, brighter, darker);
}

// Whether image 1 chose the same cell: the least sum that leads to the pixel is that of this step,
// or of a neighbour's to within one.
bool agrees(const tvk_dense_row& row, const uint8_t* least1, int32_t x, int32_t k, uint8_t least) {
  const uint8_t other = least1[x + k];
  const ptrdiff_t count = row.num_steps;
  return least == other || (x > 0 && row.sums[(x - 1) * count + k + 1] == other) ||
         (x < row.width - 1 && row.sums[(x + 1) * count + k - 1] == other);
}

}  // namespace

size_t steps_entries(int32_t max_cells, int32_t longest_side) {
  constexpr size_t kFrame = 2 * TVK_DENSE_REACH;
  return static_cast<size_t>(max_cells) +
         2 * (kFrame + TVK_DENSE_SPAN) * static_cast<size_t>(longest_side) +
         (kFrame + TVK_DENSE_SPAN) * kFrame;
}

size_t match_rows_bytes(int32_t width, int32_t num_steps, size_t cells) {
  const size_t n = static_cast<size_t>(width), steps = static_cast<size_t>(num_steps);
  return 3 * arena_bytes<uint8_t>(n * steps) + arena_bytes<uint8_t>(3 * steps) +
         7 * arena_bytes<uint8_t>(row_bytes(width)) +
         3 * arena_bytes<uint8_t>(row_bytes(width + num_steps)) + pixels_bytes(cells) +
         pixels_bytes(cells + n * steps);
}

size_t pixels_bytes(size_t cells) { return arena_bytes<uint8_t>(cells + 2 * kPixelsFrame); }

uint8_t* pixels_alloc(size_t cells, Arena& arena) {
  return arena_alloc<uint8_t>(arena, cells + 2 * kPixelsFrame) + kPixelsFrame;
}

void match_rows(const RowPair& rows, const tvk_dense_table& kernels, Arena& arena,
                const Steps& steps) {
  const ArenaScope scope(arena);
  const int32_t width = rows.width, count = rows.num_steps, width1 = rows.columns1();
  const size_t n = static_cast<size_t>(width), line = static_cast<size_t>(count);
  const auto bytes = [&](size_t size) { return arena_alloc<uint8_t>(arena, size); };
  const auto row_of = [&](int32_t columns) { return bytes(row_bytes(columns)); };
  uint8_t *const costs = bytes(n * line), *const sums = bytes(n * line);
  uint8_t *const above_costs = bytes(n * line), *const scratch = bytes(3 * line);
  uint8_t* const least = row_of(width);
  uint8_t *const large = row_of(width), *const across = row_of(width);
  uint8_t *const brighter0 = row_of(width), *const darker0 = row_of(width);
  uint8_t *const chosen = row_of(width), *const margin = row_of(width);
  uint8_t *const brighter1 = row_of(width1), *const darker1 = row_of(width1);
  uint8_t* const least1 = row_of(width1);
  std::memset(above_costs, 0, n * line);
  std::memset(least, 0, n);

  Source source0{rows.pixels0, width, rows.height}, source1{rows.pixels1, width1, rows.height};
  const int32_t noise = std::max(noise_of(rows.pixels0, width, rows.height),
                                 noise_of(rows.pixels1, width1, rows.height));
  int32_t tolerance = kLeastTolerance;
  if (noise >= kNoisy) {
    const size_t cells = n * static_cast<size_t>(rows.height);
    source0 = smoothed(source0, kernels, pixels_alloc(cells, arena));
    source1 = smoothed(source1, kernels,
                       pixels_alloc(cells + line * static_cast<size_t>(rows.height), arena));
    // 2.5 standard deviations of the difference of two smoothed pixels.
    tolerance = std::max(tolerance, (2 * noise + 1) / 3);
  }
  const ptrdiff_t entries = steps.pitch() * (rows.height + 2 * TVK_DENSE_REACH);
  for (ptrdiff_t i = 0; i < entries; ++i) steps.data[i] = -1;
  for (int32_t y = 0; y < rows.height; ++y) {
    const uint8_t *const row0 = rows.row0(y), *const row1 = rows.row1(y);
    const uint8_t* const above = rows.row0(std::max(y - 1, 0));
    codes_of(source0, kernels, y, tolerance, brighter0, darker0);
    codes_of(source1, kernels, y, tolerance, brighter1, darker1);
    kernels.edge_costs(row0, above, width, large, across);
    const tvk_dense_row row = {width, count,  brighter0, darker0, brighter1,   darker1, row0,
                               large, across, costs,     sums,    above_costs, least,   scratch};
    kernels.sum_ahead(&row);
    int16_t* const found = steps.row(y);
    kernels.choose_steps(&row, found, chosen, margin, least1);
    for (int32_t x = 0; x < width; ++x) {
      const int32_t k = found[x];
      const bool good = row0[x] != 0 && k > 0 && k < rows.range_steps - 1 && row1[x + k] != 0 &&
                        margin[x] >= kLeastMargin && agrees(row, least1, x, k, chosen[x]);
      if (!good) found[x] = -1;
    }
  }
}

}  // namespace tv
