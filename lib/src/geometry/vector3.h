// Products of vectors that are plain arrays of three doubles, with sums in a fixed order. The loops
// over matches use them, because their code is smaller without Eigen's types where the compiler
// optimises for size. Tests: those of the files that include this one.
#pragma once

#include <cmath>

#include "geometry/camera.h"

namespace tv {

// Inlined even where the compiler optimises for size: as a call, it adds 4 % to the instructions of
// the bundle adjustment.
__attribute__((always_inline)) inline double dot(const double a[3], const double b[3]) {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

inline double length_sq_of(const double v[3]) { return dot(v, v); }

inline double length_of(const double v[3]) { return std::sqrt(dot(v, v)); }

inline void cross(const double a[3], const double b[3], double product[3]) {
  product[0] = a[1] * b[2] - a[2] * b[1];
  product[1] = a[2] * b[0] - a[0] * b[2];
  product[2] = a[0] * b[1] - a[1] * b[0];
}

inline void scale_by(double factor, double v[3]) {
  for (int k = 0; k < 3; ++k) v[k] *= factor;
}

inline void rotate(const Mat3& R, const double v[3], double rotated[3]) {
  for (int r = 0; r < 3; ++r) rotated[r] = (R(r, 0) * v[0] + R(r, 1) * v[1]) + R(r, 2) * v[2];
}

// R'v, with R row-major.
inline void rotate_back(const double R[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = (R[i] * v[0] + R[3 + i] * v[1]) + R[6 + i] * v[2];
}

}  // namespace tv
