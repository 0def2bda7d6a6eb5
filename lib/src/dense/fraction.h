// Least-squares matching along a row: the parallax of a cell to a fraction of a step, its standard
// deviation, and how alike the windows are. docs/algorithms/dense.md.
#pragma once

#include <cstdint>

#include "dense/sweep.h"

namespace tv {

struct Refined {
  double step, sigma;  // in steps of parallax
  double similarity;   // correlation of the windows
};

// Refines a step of match_rows. False where a window is not wholly inside, has too little texture,
// is not alike, or moves by more than a step.
bool refine_step(const RowPair& rows, int32_t x, int32_t y, int32_t step, Refined* refined);

}  // namespace tv
