// Least-squares matching along a row: the parallax of a cell to a fraction of a step, its standard
// deviation, and how alike the windows are. docs/algorithms/dense.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "dense/sweep.h"

namespace tv {

// The cells of a pair, row by row, width x height, in arrays of cells_entries.
struct DenseCells {
  float* parallax;      // in steps; below 0 where there is none, and nothing else is known
  float* sigma;         // its standard deviation, in steps
  uint8_t* similarity;  // the correlation of the windows, 1 .. 255

  DenseCells from(ptrdiff_t cell) const {
    return {parallax + cell, sigma + cell, similarity + cell};
  }
};

// Room for so many cells, and for what kernels write behind a row.
size_t cells_entries(size_t cells);

// Bytes of arena that refine_rows takes.
size_t refine_rows_bytes(int32_t width);

// Refines the steps that match_rows found, and leaves out those that few neighbours have.
void refine_rows(const RowPair& rows, const Steps& steps, const tvk_dense_table& kernels,
                 Arena& arena, const DenseCells& cells);

}  // namespace tv
