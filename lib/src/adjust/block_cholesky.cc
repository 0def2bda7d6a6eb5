#include "adjust/block_cholesky.h"

#include <cmath>

namespace tv {
namespace {

// The factor of a block of the diagonal, in place. Returns how many pivots vanished.
int factorise_block(double* block, int stride, const double* diagonal, double smallest,
                    double* inverses) {
  int vanished = 0;
  for (int c = 0; c < kBlock; ++c) {
    double* row_c = block + c * stride;
    double pivot = row_c[c];
    for (int k = 0; k < c; ++k) pivot -= row_c[k] * row_c[k];
    const bool positive = pivot > smallest * diagonal[c];
    const double root = positive ? std::sqrt(pivot) : 0.0;
    inverses[c] = positive ? 1.0 / root : 0.0;
    vanished += !positive;
    row_c[c] = root;
    for (int r = c + 1; r < kBlock; ++r) {
      double* row = block + r * stride;
      double value = row[c];
      for (int k = 0; k < c; ++k) value -= row[k] * row_c[k];
      row[c] = value * inverses[c];
    }
  }
  return vanished;
}

// A block below the diagonal becomes that of the factor, of which `columns` receives a copy; its
// columns are `pitch` entries apart.
void solve_block(const double* factor, int factor_stride, const double* inverses, double* block,
                 int stride, double* columns, int pitch) {
  for (int c = 0; c < kBlock; ++c) {
    double* column = columns + c * pitch;
    for (int r = 0; r < kBlock; ++r) {
      double value = block[r * stride + c];
      for (int k = 0; k < c; ++k) value -= block[r * stride + k] * factor[c * factor_stride + k];
      value *= inverses[c];
      block[r * stride + c] = value;
      column[r] = value;
    }
  }
}

const double* row_at(const BlockMatrix& A, int i) { return diagonal_at(A, i) - i; }

bool is_zero(const double* block, int stride) {
  for (int r = 0; r < kBlock; ++r) {
    for (int c = 0; c < kBlock; ++c) {
      if (block[r * stride + c] != 0.0) return false;
    }
  }
  return true;
}

}  // namespace

BlockMatrix block_matrix(int num_blocks, const tvk_odometry_table* kernels, Arena& arena) {
  const size_t blocks = static_cast<size_t>(num_blocks), n = kBlock * blocks;
  BlockMatrix A;
  A.num_blocks = num_blocks;
  A.kernels = kernels;
  A.entries = arena_alloc<double>(arena, block_entries(num_blocks));
  A.inverses = arena_alloc<double>(arena, n);
  A.diagonal = arena_alloc<double>(arena, n);
  A.panel = reinterpret_cast<double*>(arena_alloc<Pair>(arena, 3 * n));
  A.below = arena_alloc<int32_t>(arena, blocks);
  return A;
}

int factorise(const BlockMatrix& A, double smallest) {
  const int pitch = kBlock * A.num_blocks;
  int vanished = 0;
  for (int j = 0; j < A.num_blocks; ++j) {
    double* corner = block_at(A, j, j);
    double* inverses = A.inverses + kBlock * j;
    const int stride = row_entries(j);
    vanished += factorise_block(corner, stride, A.diagonal + kBlock * j, smallest, inverses);
    int num = 0;
    for (int i = j + 1; i < A.num_blocks; ++i) {
      double* block = block_at(A, i, j);
      if (is_zero(block, row_entries(i))) continue;
      double* columns = A.panel + kBlock * num;
      solve_block(corner, stride, inverses, block, row_entries(i), columns, pitch);
      A.below[num++] = i;
    }
    for (int half = 0; half < 2; ++half) {
      A.kernels->subtract_products(A.entries, A.panel + 3 * half * pitch, pitch, A.below, num);
    }
  }
  return vanished;
}

void solve_lower(const BlockMatrix& A, int first_block, double* x) {
  const int size = kBlock * A.num_blocks;
  for (int r = kBlock * first_block; r < size; ++r) {
    const double* row = row_at(A, r);
    double value = x[r];
    for (int k = kBlock * first_block; k < r; ++k) value -= row[k] * x[k];
    x[r] = value * A.inverses[r];
  }
}

void solve_upper(const BlockMatrix& A, double* x) {
  const int size = kBlock * A.num_blocks;
  for (int r = size - 1; r >= 0; --r) {
    const double* row = row_at(A, r);
    x[r] *= A.inverses[r];
    for (int k = 0; k < r; ++k) x[k] -= row[k] * x[r];
  }
}

}  // namespace tv
