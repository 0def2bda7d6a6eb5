// svd3 is a one-sided Jacobi: J. Demmel, K. Veselic, "Jacobi's method is more accurate than QR",
// 1992.
#include "geometry/null_space.h"

#include <cmath>

namespace tv {
namespace {

// Rotates columns p and q of A (and V) so that A's become orthogonal. False when they already were.
bool rotate_columns(Mat3& A, Mat3& V, int p, int q) {
  double a = 0, b = 0, c = 0;
  for (int i = 0; i < 3; ++i) {
    a += A(i, p) * A(i, p);
    b += A(i, q) * A(i, q);
    c += A(i, p) * A(i, q);
  }
  if (!(std::fabs(c) > 1e-16 * std::sqrt(a * b))) return false;
  const double zeta = (b - a) / (2 * c);
  const double root = std::sqrt(1 + zeta * zeta);
  const double tangent = zeta < 0 ? -1 / (root - zeta) : 1 / (root + zeta);
  const double cosine = 1 / std::sqrt(1 + tangent * tangent), sine = cosine * tangent;
  for (int i = 0; i < 3; ++i) {
    const double x = A(i, p), y = A(i, q);
    A(i, p) = cosine * x - sine * y;
    A(i, q) = sine * x + cosine * y;
    const double v = V(i, p), w = V(i, q);
    V(i, p) = cosine * v - sine * w;
    V(i, q) = sine * v + cosine * w;
  }
  return true;
}

// Swaps two columns of A and of V and negates one of them, so that V stays a rotation.
void swap_columns(Mat3& A, Mat3& V, int p, int q) {
  for (int i = 0; i < 3; ++i) {
    const double x = A(i, p);
    A(i, p) = A(i, q);
    A(i, q) = -x;
    const double v = V(i, p);
    V(i, p) = V(i, q);
    V(i, q) = -v;
  }
}

}  // namespace

bool null_space(double rows[][9], int num_rows, double basis[][9]) {
  double largest = 0;
  for (int k = 0; k < num_rows; ++k) {
    double sum = 0;
    for (int i = 0; i < 9; ++i) sum += rows[k][i] * rows[k][i];
    if (sum > largest) largest = sum;
  }
  double scale[8];  // 2 / |v|^2; v, Householder's vector, is in rows[k][k..8]
  for (int k = 0; k < num_rows; ++k) {
    double* v = rows[k];
    double sum = 0;
    for (int i = k; i < 9; ++i) sum += v[i] * v[i];
    if (!(sum > 1e-20 * largest)) return false;
    const double length = std::sqrt(sum);
    const double head = v[k];
    v[k] = head + (head < 0 ? -length : length);
    scale[k] = 1.0 / (sum + std::fabs(head) * length);
    for (int c = k + 1; c < num_rows; ++c) {
      double dot = 0;
      for (int i = k; i < 9; ++i) dot += v[i] * rows[c][i];
      dot *= scale[k];
      for (int i = k; i < 9; ++i) rows[c][i] -= dot * v[i];
    }
  }
  for (int b = 0; b < 9 - num_rows; ++b) {
    for (int i = 0; i < 9; ++i) basis[b][i] = i == num_rows + b ? 1.0 : 0.0;
    for (int k = num_rows - 1; k >= 0; --k) {
      const double* v = rows[k];
      double dot = 0;
      for (int i = k; i < 9; ++i) dot += v[i] * basis[b][i];
      dot *= scale[k];
      for (int i = k; i < 9; ++i) basis[b][i] -= dot * v[i];
    }
  }
  return true;
}

Svd3 svd3(const Mat3& M) {
  Svd3 result;
  Mat3 A = M;
  result.V = Mat3::Identity();
  for (int sweep = 0; sweep < 30; ++sweep) {
    bool changed = false;
    for (int p = 0; p < 2; ++p) {
      for (int q = p + 1; q < 3; ++q) changed |= rotate_columns(A, result.V, p, q);
    }
    if (!changed) break;
  }
  for (int pass = 0; pass < 2; ++pass) {
    for (int p = 0; p < 2; ++p) {
      if (A.col(p).squaredNorm() < A.col(p + 1).squaredNorm()) swap_columns(A, result.V, p, p + 1);
    }
  }
  const double s0 = A.col(0).norm(), s1 = A.col(1).norm();
  Vec3 u0 = Vec3(1, 0, 0), u1;
  if (s0 > 0) u0 = A.col(0) / s0;
  if (s1 > 1e-300 && s1 > 1e-15 * s0) {
    u1 = A.col(1) / s1;
    u1 = (u1 - u1.dot(u0) * u0).normalized();
  } else {  // u1 may be any direction orthogonal to u0
    const int k = std::fabs(u0[0]) < 0.6 ? 0 : 1;
    Vec3 axis = Vec3::Zero();
    axis[k] = 1;
    u1 = u0.cross(axis).normalized();
  }
  const Vec3 u2 = u0.cross(u1);
  result.U.col(0) = u0;
  result.U.col(1) = u1;
  result.U.col(2) = u2;
  result.s = Vec3(s0, s1, u2.dot(A.col(2)));
  return result;
}

}  // namespace tv
