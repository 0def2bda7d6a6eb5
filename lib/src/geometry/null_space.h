// Null spaces of small dense systems in nine unknowns, and the singular values of 3x3 matrices.
#pragma once

#include "geometry/camera.h"

namespace tv {

// An orthonormal basis of the vectors orthogonal to the first num_rows (at most 8) of `rows`, by
// Householder reflections. Destroys `rows`; writes 9 - num_rows vectors. False when the rows are
// linearly dependent (within 1e-10 of the longest row's length).
bool null_space(double rows[][9], int num_rows, double basis[][9]);

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
