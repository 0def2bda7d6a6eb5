#include "geometry/transfer.h"

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();

// The displacement d of the predicted pixel from the matched one, in pixels of image 1, and its
// derivative by h = H f0, a 2x3 matrix. With P the left inverse of J1 that sends f1 to zero, d = P
// h / (m . h), where m = e_z on the plane and f1 on the sphere.
struct Transfer {
  double f0[3];
  double d[2];
  double slope[2][3];
  double weight[3];  // entries 00, 01 and 11 of (I + D D')^-1
};

inline void left_inverse(const RayPairs& pairs, int i, double P[2][3], double m[3]) {
  double* const* J = pairs.jacobian[1];
  double* const* f = pairs.ray[1];
  if (pairs.on_plane) {
    const double a = J[0][i], b = J[1][i], c = J[2][i], d = J[3][i];
    const double inverse = 1 / (a * d - b * c);
    P[0][0] = d * inverse;
    P[0][1] = -b * inverse;
    P[1][0] = -c * inverse;
    P[1][1] = a * inverse;
    for (int r = 0; r < 2; ++r) P[r][2] = -(P[r][0] * f[0][i] + P[r][1] * f[1][i]);
    m[0] = m[1] = 0;
    m[2] = 1;
    return;
  }
  double a = 0, b = 0, c = 0;
  for (int k = 0; k < 3; ++k) {
    a += J[2 * k][i] * J[2 * k][i];
    b += J[2 * k][i] * J[2 * k + 1][i];
    c += J[2 * k + 1][i] * J[2 * k + 1][i];
    m[k] = f[k][i];
  }
  const double inverse = 1 / (a * c - b * b);
  for (int k = 0; k < 3; ++k) {
    P[0][k] = (c * J[2 * k][i] - b * J[2 * k + 1][i]) * inverse;
    P[1][k] = (a * J[2 * k + 1][i] - b * J[2 * k][i]) * inverse;
  }
}

// Returns false when H sends the ray behind view 1.
bool transfer(const RayPairs& pairs, int i, const Mat3& H, Transfer* t) {
  double P[2][3], m[3], h[3], moved[3][2];  // moved = H J0
  left_inverse(pairs, i, P, m);
  for (int k = 0; k < 3; ++k) t->f0[k] = pairs.ray[0][k][i];
  double* const* J0 = pairs.jacobian[0];
  for (int r = 0; r < 3; ++r) {
    h[r] = (H(r, 0) * t->f0[0] + H(r, 1) * t->f0[1]) + H(r, 2) * t->f0[2];
    for (int c = 0; c < 2; ++c) {
      moved[r][c] = (H(r, 0) * J0[c][i] + H(r, 1) * J0[2 + c][i]) + H(r, 2) * J0[4 + c][i];
    }
  }
  const double depth = (m[0] * h[0] + m[1] * h[1]) + m[2] * h[2];
  if (!(depth > 0)) return false;
  const double inverse = 1 / depth;
  double D[2][2];
  for (int r = 0; r < 2; ++r) {
    t->d[r] = ((P[r][0] * h[0] + P[r][1] * h[1]) + P[r][2] * h[2]) * inverse;
    for (int k = 0; k < 3; ++k) t->slope[r][k] = (P[r][k] - t->d[r] * m[k]) * inverse;
    for (int c = 0; c < 2; ++c) {
      D[r][c] = (t->slope[r][0] * moved[0][c] + t->slope[r][1] * moved[1][c]) +
                t->slope[r][2] * moved[2][c];
    }
  }
  const double g00 = 1 + (D[0][0] * D[0][0] + D[0][1] * D[0][1]);
  const double g11 = 1 + (D[1][0] * D[1][0] + D[1][1] * D[1][1]);
  const double g01 = D[0][0] * D[1][0] + D[0][1] * D[1][1];
  const double inverse_det = 1 / (g00 * g11 - g01 * g01);
  t->weight[0] = g11 * inverse_det;
  t->weight[1] = -g01 * inverse_det;
  t->weight[2] = g00 * inverse_det;
  return true;
}

inline double weighted_sq(const Transfer& t) {
  return t.d[0] * (t.weight[0] * t.d[0] + t.weight[1] * t.d[1]) +
         t.d[1] * (t.weight[1] * t.d[0] + t.weight[2] * t.d[1]);
}

}  // namespace

TransferResidual transfer_residual(const RayPairs& pairs, int i, const Mat3& H) {
  Transfer t;
  if (!transfer(pairs, i, H, &t)) return {kInfinity, kInfinity};
  const double r_sq = weighted_sq(t);
  return {r_sq >= 0 ? r_sq : kInfinity, t.d[0] * t.d[0] + t.d[1] * t.d[1]};
}

void transfer_squares(const RayPairs& pairs, int first, int count, const Mat3& H, double* squares) {
  pairs.kernels->transfer_squares(kernel_arrays(pairs).p, nullptr, first, count, pairs.on_plane,
                                  kernel_model(H).m, squares);
}

void transfer_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& H,
                      double* squares) {
  pairs.kernels->transfer_squares(kernel_arrays(pairs).p, indices, 0, count, pairs.on_plane,
                                  kernel_model(H).m, squares);
}

}  // namespace tv
