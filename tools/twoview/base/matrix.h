// Matrices of 3 x 3 numbers and vectors of 3, and the arithmetic that poses need.
#pragma once

#include <array>
#include <string>

namespace cli {

using Matrix3 = std::array<double, 9>;  // row-major
using Vector3 = std::array<double, 3>;

Matrix3 product(const Matrix3& a, const Matrix3& b);
Matrix3 transposed(const Matrix3& a);
Vector3 applied(const Matrix3& a, const Vector3& v);  // the product a v
Vector3 cross(const Vector3& a, const Vector3& b);
inline Vector3 minus(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Vector3& a, const Vector3& b);
double norm(const Vector3& v);
double determinant(const Matrix3& a);

// The rotation that is nearest to a matrix of a file (the least sum of squared differences), whose
// numbers are rounded, or were estimated: 7-Scenes' poses are rotations to 5e-4. Throws BadInput,
// whose text begins with `name`, where an entry is farther than kMostRotationError from it, and for
// a reflection.
constexpr double kMostRotationError = 0.01;
Matrix3 made_rotation(const Matrix3& matrix, const std::string& name);

}  // namespace cli
