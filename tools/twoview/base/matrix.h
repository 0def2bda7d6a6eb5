// Matrices of 3 x 3 numbers and vectors of 3, and the arithmetic that poses need.
#pragma once

#include <array>

namespace cli {

using Matrix3 = std::array<double, 9>;  // row-major
using Vector3 = std::array<double, 3>;

Matrix3 product(const Matrix3& a, const Matrix3& b);
Matrix3 transposed(const Matrix3& a);
Vector3 applied(const Matrix3& a, const Vector3& v);  // the product a v
Vector3 cross(const Vector3& a, const Vector3& b);
double dot(const Vector3& a, const Vector3& b);
double norm(const Vector3& v);
double determinant(const Matrix3& a);

}  // namespace cli
