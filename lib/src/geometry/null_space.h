// Null spaces of small dense systems in nine unknowns, and the singular values of 3x3 matrices.
#pragma once

#include <cmath>

#include "geometry/camera.h"

namespace tv {

// An orthonormal basis of the vectors orthogonal to kRows vectors of nine entries, by Householder
// reflections. Destroys `rows`. False when they are linearly dependent (within 1e-10 of the longest
// row's length).
template <int kRows>
bool null_space(double rows[kRows][9], double basis[9 - kRows][9]) {
  double largest = 0;
  for (int k = 0; k < kRows; ++k) {
    double sum = 0;
    for (int i = 0; i < 9; ++i) sum += rows[k][i] * rows[k][i];
    if (sum > largest) largest = sum;
  }
  double scale[kRows];  // 2 / |v|^2; v, Householder's vector, is in rows[k][k..8]
  for (int k = 0; k < kRows; ++k) {
    double* v = rows[k];
    double sum = 0;
    for (int i = k; i < 9; ++i) sum += v[i] * v[i];
    if (!(sum > 1e-20 * largest)) return false;
    const double length = std::sqrt(sum);
    const double head = v[k];
    v[k] = head + (head < 0 ? -length : length);
    scale[k] = 1.0 / (sum + std::fabs(head) * length);
    for (int c = k + 1; c < kRows; ++c) {
      double dot = 0;
      for (int i = k; i < 9; ++i) dot += v[i] * rows[c][i];
      dot *= scale[k];
      for (int i = k; i < 9; ++i) rows[c][i] -= dot * v[i];
    }
  }
  for (int b = 0; b < 9 - kRows; ++b) {
    for (int i = 0; i < 9; ++i) basis[b][i] = i == kRows + b ? 1.0 : 0.0;
    for (int k = kRows - 1; k >= 0; --k) {
      const double* v = rows[k];
      double dot = 0;
      for (int i = k; i < 9; ++i) dot += v[i] * basis[b][i];
      dot *= scale[k];
      for (int i = k; i < 9; ++i) basis[b][i] -= dot * v[i];
    }
  }
  return true;
}

// A row of the epipolar constraint f1' M f0 = 0, linear in M's entries, row-major.
inline void epipolar_row(const Vec3& ray0, const Vec3& ray1, double row[9]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) row[3 * i + j] = ray1[i] * ray0[j];
  }
}

// M = U diag(s) V', |s| descending, U and V rotations, so s[2] is negative where det M is; s[0] and
// s[1] are not. One-sided Jacobi: M V has orthogonal columns.
struct Svd3 {
  Mat3 U, V;
  Vec3 s;
};
Svd3 svd3(const Mat3& M);

}  // namespace tv
