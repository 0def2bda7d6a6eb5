// Semi-global matching of two images whose rows correspond, in one pass from the top to the bottom.
// Integers only. docs/algorithms/dense.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "kernels/dense.h"

namespace tv {

// Two images of the same rows. A pixel of value 0 is outside the image that it came from. Step k of
// parallax is what moves column x of image 0 to column x + k of image 1, which therefore has
// num_steps - 1 columns more.
struct RowPair {
  const uint8_t* pixels0;  // width x height, with the frame of pixels_alloc
  const uint8_t* pixels1;  // columns1() x height, likewise
  int32_t width, height;
  int32_t num_steps;    // a multiple of TVK_DENSE_BLOCK
  int32_t range_steps;  // the first so many may be chosen, but for the first and last of them

  int32_t columns1() const { return width + num_steps - 1; }
  const uint8_t* row0(int32_t y) const { return pixels0 + static_cast<ptrdiff_t>(y) * width; }
  const uint8_t* row1(int32_t y) const { return pixels1 + static_cast<ptrdiff_t>(y) * columns1(); }
};

// Resampled images, here and of depth maps, have a frame of so many bytes before and behind them,
// since kernels read whole blocks and their neighbours.
inline constexpr size_t kPixelsFrame = 2 * TVK_DENSE_BLOCK;
size_t pixels_bytes(size_t cells);
uint8_t* pixels_alloc(size_t cells, Arena& arena);

// Steps of the cells, -1 where there is none, with a frame of such of TVK_DENSE_REACH cells around
// them, and TVK_DENSE_SPAN more behind each row, so that windows need no case for the border.
struct Steps {
  int16_t* data;
  int32_t width, height;

  ptrdiff_t pitch() const { return width + 2 * TVK_DENSE_REACH + TVK_DENSE_SPAN; }
  // The entry of column 0; y from -TVK_DENSE_REACH to height + TVK_DENSE_REACH - 1.
  int16_t* row(int32_t y) const { return data + (y + TVK_DENSE_REACH) * pitch() + TVK_DENSE_REACH; }
};

// The most entries of Steps of at most so many cells, with at most so many columns and rows.
size_t steps_entries(int32_t max_cells, int32_t longest_side);

// Bytes of arena that match_rows takes.
size_t match_rows_bytes(int32_t width, int32_t num_steps, size_t cells);

// Writes the step of each cell, or -1 where it is not to be believed: it is at an end of the range,
// the opposite direction chose another one, or another one is as good.
void match_rows(const RowPair& rows, const tvk_dense_table& kernels, Arena& arena,
                const Steps& steps);

}  // namespace tv
