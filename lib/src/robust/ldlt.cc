#include "robust/ldlt.h"

namespace tv {
namespace {

// A = L D L' in place of a full lower triangle; false when a pivot is not above `smallest`.
bool factorise(int num, double A[kMostParameters][kMostParameters], double* D, double smallest) {
  for (int j = 0; j < num; ++j) {
    double pivot = A[j][j];
    for (int k = 0; k < j; ++k) pivot -= A[j][k] * A[j][k] * D[k];
    if (!(pivot > smallest)) return false;
    D[j] = pivot;
    for (int i = j + 1; i < num; ++i) {
      double value = A[i][j];
      for (int k = 0; k < j; ++k) value -= A[i][k] * A[j][k] * D[k];
      A[i][j] = value / pivot;
    }
  }
  return true;
}

void solve_factorised(int num, const double A[kMostParameters][kMostParameters], const double* D,
                      double* x) {
  for (int i = 0; i < num; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= A[i][k] * x[k];
  }
  for (int i = 0; i < num; ++i) x[i] /= D[i];
  for (int i = num - 1; i >= 0; --i) {
    for (int k = i + 1; k < num; ++k) x[i] -= A[k][i] * x[k];
  }
}

// Returns the largest entry of the diagonal, at least 0.
double unpack_lower(int num, const double* upper, double A[kMostParameters][kMostParameters]) {
  double largest = 0;
  for (int i = 0, slot = 0; i < num; ++i) {
    for (int j = i; j < num; ++j) A[j][i] = upper[slot++];
    if (A[i][i] > largest) largest = A[i][i];
  }
  return largest;
}

}  // namespace

bool solve_damped(int num, const double* upper, const double* gradient, double lambda,
                  double* step) {
  double A[kMostParameters][kMostParameters], D[kMostParameters];
  const double largest = unpack_lower(num, upper, A);
  if (!(largest > 0)) return false;
  for (int i = 0; i < num; ++i) A[i][i] += lambda * (A[i][i] + 1e-9 * largest);
  if (!factorise(num, A, D, 0.0)) return false;
  for (int i = 0; i < num; ++i) step[i] = -gradient[i];
  solve_factorised(num, A, D, step);
  return true;
}

bool invert_symmetric(int num, const double* upper, double* inverse) {
  double A[kMostParameters][kMostParameters], D[kMostParameters];
  const double largest = unpack_lower(num, upper, A);
  if (!factorise(num, A, D, 1e-13 * largest)) return false;
  for (int c = 0; c < num; ++c) {
    double x[kMostParameters] = {};
    x[c] = 1;
    solve_factorised(num, A, D, x);
    for (int r = 0; r < num; ++r) inverse[num * r + c] = x[r];
  }
  for (int r = 0; r < num; ++r) {  // makes the inverse exactly symmetric
    for (int c = 0; c < r; ++c) inverse[num * r + c] = inverse[num * c + r];
  }
  return true;
}

bool solve_symmetric3(const double V[6], const double g[3], double x[3]) {
  if (!(V[0] > 0.0)) return false;
  const double l10 = V[1] / V[0], l20 = V[2] / V[0];
  const double d1 = V[3] - l10 * V[1];
  const double v21 = V[4] - l10 * V[2];
  if (!(d1 > 0.0)) return false;
  const double l21 = v21 / d1;
  const double d2 = (V[5] - l20 * V[2]) - l21 * v21;
  if (!(d2 > 0.0)) return false;
  const double y1 = -g[1] + l10 * g[0];
  const double y2 = (-g[2] + l20 * g[0]) - l21 * y1;
  x[2] = y2 / d2;
  x[1] = y1 / d1 - l21 * x[2];
  x[0] = (-g[0] / V[0] - l10 * x[1]) - l20 * x[2];
  return true;
}

}  // namespace tv
