// The reduced camera system of a window: a symmetric matrix of 6x6 blocks, of which the lower
// triangle is stored, its factorisation A = L L' (G. Golub, C. Van Loan, "Matrix computations",
// 4.2), and the update by a point. Every entry is a sum in a fixed order. Tests:
// test/unit/test_window.cc.
#pragma once

#include <cstdint>

#include "base/arena.h"
#include "kernels/odometry.h"

namespace tv {

// Two doubles; an operation on a Pair is the same IEEE operation on each of them. All CPUs of the
// library that have vectors of doubles have vectors of 16 bytes.
typedef double Pair __attribute__((vector_size(16)));

inline constexpr int kBlock = 6;
inline constexpr int kBlockPairs = 3;

struct BlockMatrix {
  int num_blocks;
  const tvk_odometry_table* kernels;
  double* entries;  // the rows of blocks down to the diagonal, one after the other; 16-byte aligned
  double* inverses;  // of the factor's diagonal, or 0 where a pivot vanished
  double* diagonal;  // of A, which decides when a pivot has vanished
  double* panel;     // scratch: 36 for each block
  int32_t* below;    // scratch: the blocks of a column that are not zero
};

// Uninitialised. A smaller num_blocks may be set afterwards.
BlockMatrix block_matrix(int num_blocks, const tvk_odometry_table* kernels, Arena& arena);

// The number of entries of this many rows of blocks.
inline size_t block_entries(int num_blocks) {
  const size_t n = static_cast<size_t>(num_blocks);
  return kBlock * kBlock * (n * (n + 1) / 2);
}

// How many entries follow each other in each of the six rows of a row of blocks.
inline int row_entries(int row) { return kBlock * (row + 1); }

inline double* block_at(const BlockMatrix& A, int row, int column) {
  return A.entries + block_entries(row) + static_cast<size_t>(kBlock * column);
}

// The entry (i, i) of a matrix of scalars.
inline double* diagonal_at(const BlockMatrix& A, int i) {
  const int row = i / kBlock, k = i % kBlock;
  return block_at(A, row, row) + k * row_entries(row) + k;
}

// Factorises A in place. A pivot of at most `smallest` times its entry of `diagonal` counts as
// zero, and its unknown becomes 0. Returns how many did.
int factorise(const BlockMatrix& A, double smallest);

// x becomes L^-1 x, for rows from 6 first_block on; those above are zero.
void solve_lower(const BlockMatrix& A, int first_block, double* x);
// x becomes L^-T x.
void solve_upper(const BlockMatrix& A, double* x);

}  // namespace tv
