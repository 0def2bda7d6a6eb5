// Semi-global matching of two images whose rows correspond, in one pass from the top to the bottom.
// Integers only. docs/algorithms/dense.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"

namespace tv {

// Two images of the same rows. A pixel of value 0 is outside the image that it came from. Step k of
// parallax is what moves column x of image 0 to column x + k of image 1, which therefore has
// num_steps - 1 columns more.
struct RowPair {
  const uint8_t* pixels0;  // width x height
  const uint8_t* pixels1;  // (width + num_steps - 1) x height
  int32_t width, height;
  int32_t num_steps;  // a multiple of 8
};

// Bytes of arena that match_rows takes.
size_t match_rows_bytes(int32_t width, int32_t num_steps);

// Writes to steps[width x height] the step of each pixel, or -1 where it is not to be believed: it
// is at an end of the range, the opposite direction chose another one, or another one is as good.
void match_rows(const RowPair& rows, Arena& arena, int16_t* steps);

// Replaces by -1 each step that few of its neighbours have to within one.
// scratch: width x height. The steps are read from `steps` and written to `kept`.
void keep_supported(const int16_t* steps, int32_t width, int32_t height, int16_t* kept);

}  // namespace tv
