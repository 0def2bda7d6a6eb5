#include "dense/fraction.h"

#include <algorithm>
#include <cstring>

namespace tv {
namespace {

constexpr int32_t kReach = TVK_DENSE_REACH, kRows = 2 * kReach + 2;
constexpr int32_t kStretch = TVK_DENSE_STRETCH;
// Of a window of 5 x 5 cells, those that have the step of the middle to within one.
constexpr int32_t kLeastSupport = 14;
// Windows that are less alike than this show different things: a correlation of 0.7.
constexpr uint8_t kLeastSimilarity = 179;
// The variance of the residuals is multiplied by 4, since residuals of neighbouring pixels are
// correlated; without texture the mean step of the neighbours has a standard deviation of 0.35
// steps; and a floor of 0.12 steps stands for what the model leaves out (measured:
// docs/decisions/0027-dense.md).
constexpr tvk_dense_model kModel = {8.0f, 4.0f, 0.1f, 8.0f, 0.12f * 0.12f};

// A ring of rows of cells, each with a frame of kReach cells at both ends.
struct Ring {
  uint8_t* a;
  uint8_t* b;
  uint8_t* is_cell;
  int16_t* g;
  size_t pitch;

  size_t at(int32_t y) const { return static_cast<size_t>((y + 2 * kRows) % kRows) * pitch; }
};

// A row and its frame, in whole stretches.
size_t pitch_of(int32_t width) {
  return (static_cast<size_t>(width) + 2 * kReach + kStretch - 1) / kStretch * kStretch;
}

// Writes row y of the ring: image 0, image 1 moved by the steps, and their slopes.
void fill_row(const RowPair& rows, const Steps& steps, int32_t y, const Ring& ring) {
  const size_t at = ring.at(y);
  std::memset(ring.a + at, 0, ring.pitch);
  std::memset(ring.b + at, 0, ring.pitch);
  std::memset(ring.is_cell + at, 0, ring.pitch);
  std::memset(ring.g + at, 0, ring.pitch * sizeof(int16_t));
  if (y < 0 || y >= rows.height) return;
  const int16_t* const found = steps.row(y);
  const uint8_t *const row0 = rows.row0(y), *const row1 = rows.row1(y);
  const int32_t last1 = rows.columns1() - 1;
  constexpr int32_t kRim = TVK_DENSE_CENSUS_REACH;
  for (int32_t x = kRim; x < rows.width - kRim; ++x) {
    const int32_t x1 = x + found[x];
    if (found[x] < 0 || x1 < kRim || x1 > last1 - kRim) continue;
    const uint8_t *p = row0 + x, *q = row1 + x1;
    // Beside the rim of an image the codes of its pixels are not whole.
    if (p[-kRim] == 0 || p[kRim] == 0 || q[-kRim] == 0 || q[kRim] == 0) continue;
    const size_t i = at + static_cast<size_t>(x + kReach);
    ring.a[i] = p[0];
    ring.b[i] = q[0];
    ring.is_cell[i] = 1;
    ring.g[i] = static_cast<int16_t>(p[1] - p[-1] + q[1] - q[-1]);
  }
}

// Refines the cells of a stretch that begins at column x. around: the rows of steps of their
// windows, from the frame on.
void refine_stretch(const int16_t* const* around, const uint8_t* is_cell, const int32_t* sums,
                    int32_t x, int32_t count, const tvk_dense_table& kernels,
                    const DenseCells& out) {
  const int16_t* rows[2 * kReach + 1];
  for (int v = 0; v <= 2 * kReach; ++v) rows[v] = around[v] + x;
  uint8_t support[kStretch], alike[kStretch] = {};
  int8_t slant[kStretch] = {};
  kernels.support_row(rows, count, support, alike, slant);
  const int16_t* const found = rows[kReach] + kReach;
  kernels.fit_cells(sums, found, alike, slant, &kModel, out.parallax, out.sigma, out.similarity);
  for (int32_t i = 0; i < count; ++i) {
    const bool good = (is_cell[x + i] != 0) & (support[i] >= kLeastSupport) &
                      (out.similarity[i] >= kLeastSimilarity);
    out.parallax[i] = good ? out.parallax[i] : -1.0f;
  }
}

bool has_cell(const uint8_t* is_cell, int32_t count) {
  uint8_t any = 0;
  for (int32_t x = 0; x < count; ++x) any |= is_cell[x];
  return any != 0;
}

}  // namespace

size_t refine_rows_bytes(int32_t width) {
  const size_t pitch = pitch_of(width);
  return 3 * arena_bytes<uint8_t>(kRows * pitch) + arena_bytes<int16_t>(kRows * pitch) +
         arena_bytes<int32_t>(TVK_DENSE_SUMS * (pitch + TVK_DENSE_SPAN)) +
         arena_bytes<int32_t>(TVK_DENSE_SUMS * kStretch);
}

size_t cells_entries(size_t cells) { return cells + kStretch; }

void refine_rows(const RowPair& rows, const Steps& steps, const tvk_dense_table& kernels,
                 Arena& arena, const DenseCells& cells) {
  const ArenaScope scope(arena);
  const int32_t width = rows.width;
  const size_t pitch = pitch_of(width);
  Ring ring;
  ring.pitch = pitch;
  ring.a = arena_alloc<uint8_t>(arena, kRows * pitch);
  ring.b = arena_alloc<uint8_t>(arena, kRows * pitch);
  ring.is_cell = arena_alloc<uint8_t>(arena, kRows * pitch);
  ring.g = arena_alloc<int16_t>(arena, kRows * pitch);
  int32_t* const columns = arena_alloc<int32_t>(arena, TVK_DENSE_SUMS * (pitch + TVK_DENSE_SPAN));
  int32_t* const sums = arena_alloc<int32_t>(arena, TVK_DENSE_SUMS * kStretch);
  for (int32_t y = -kReach; y < kReach; ++y) fill_row(rows, steps, y, ring);
  for (int32_t y = 0; y < rows.height; ++y) {
    fill_row(rows, steps, y + kReach, ring);
    tvk_dense_rows window;
    const int16_t* around[2 * kReach + 1];
    for (int32_t v = 0; v < kRows; ++v) {
      // The last is the row that the window left, which is kReach + 1 above.
      const size_t at = ring.at(v == kRows - 1 ? y - kReach - 1 : y - kReach + v);
      window.a[v] = ring.a + at;
      window.b[v] = ring.b + at;
      window.g[v] = ring.g + at;
      window.is_cell[v] = ring.is_cell + at;
      if (v < kRows - 1) around[v] = steps.row(y - kReach + v) - kReach;
    }
    kernels.cell_columns(&window, static_cast<int32_t>(pitch), y == 0, columns);
    const uint8_t* const is_cell = ring.is_cell + ring.at(y) + kReach;
    for (int32_t x = 0; x < width; x += kStretch) {
      const DenseCells out = cells.from(static_cast<ptrdiff_t>(y) * width + x);
      const int32_t count = std::min(kStretch, width - x);
      if (!has_cell(is_cell + x, count)) {
        std::fill(out.parallax, out.parallax + count, -1.0f);
        continue;
      }
      kernels.cell_sums(columns + x, static_cast<int32_t>(pitch), sums);
      refine_stretch(around, is_cell, sums, x, count, kernels, out);
    }
  }
}

}  // namespace tv
