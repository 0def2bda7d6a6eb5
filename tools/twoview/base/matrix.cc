#include "base/matrix.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>

#include "base/error.h"

namespace cli {

Matrix3 product(const Matrix3& a, const Matrix3& b) {
  Matrix3 c{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      for (size_t k = 0; k < 3; ++k) c[3 * i + j] += a[3 * i + k] * b[3 * k + j];
  return c;
}

Matrix3 transposed(const Matrix3& a) {
  return {a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]};
}

Vector3 applied(const Matrix3& a, const Vector3& v) {
  return {a[0] * v[0] + a[1] * v[1] + a[2] * v[2], a[3] * v[0] + a[4] * v[1] + a[5] * v[2],
          a[6] * v[0] + a[7] * v[1] + a[8] * v[2]};
}

Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

double norm(const Vector3& v) { return std::sqrt(dot(v, v)); }

double determinant(const Matrix3& a) {
  return dot({a[0], a[1], a[2]}, cross({a[3], a[4], a[5]}, {a[6], a[7], a[8]}));
}

Matrix3 made_rotation(const Matrix3& matrix, const std::string& name) {
  const double size = determinant(matrix);
  if (size < 0) throw BadInput(name + " holds a reflection, no rotation");
  if (!(size > 0.5 && size < 2)) throw BadInput(name + " holds no rotation");
  // Newton's iteration for the orthogonal factor of the polar decomposition (N. J. Higham, SIAM
  // Journal on Scientific and Statistical Computing 7(4), 1986): the mean of a matrix and its
  // inverse transposed. The error is squared each time.
  Matrix3 R = matrix;
  for (int i = 0; i < 8; ++i) {
    const Vector3 rows[3] = {{R[0], R[1], R[2]}, {R[3], R[4], R[5]}, {R[6], R[7], R[8]}};
    const double half = 0.5 / determinant(R);
    for (size_t r = 0; r < 3; ++r) {
      const Vector3 cofactors = cross(rows[(r + 1) % 3], rows[(r + 2) % 3]);
      for (size_t c = 0; c < 3; ++c) R[3 * r + c] = 0.5 * R[3 * r + c] + half * cofactors[c];
    }
  }
  double farthest = 0;
  for (size_t i = 0; i < 9; ++i) farthest = std::max(farthest, std::abs(matrix[i] - R[i]));
  if (farthest <= kMostRotationError) return R;
  char text[64];
  std::snprintf(text, sizeof text, " holds no rotation: the nearest one differs by %.2g", farthest);
  throw BadInput(name + text);
}

}  // namespace cli
