#include "geometry/parallax.h"

namespace tv {

void squared_sines(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& R,
                   double* sines_sq) {
  for (int k = 0; k < count; ++k) {
    const int i = indices[k];
    const double b[3] = {pairs.ray[1][0][i], pairs.ray[1][1][i], pairs.ray[1][2][i]};
    double a[3], across[3];
    turn_ray0(pairs, i, R, a);
    cross(a, b, across);
    sines_sq[k] = dot(a, b) > 0 ? dot(across, across) / (dot(a, a) * dot(b, b)) : 2;
  }
}

void direction_noise(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                     double block[3]) {
  Vec3 b[2];
  tangent_basis(pose.t, &b[0], &b[1]);
  double along[3][3];  // its rows are b[0], b[1] and t
  for (int i = 0; i < 3; ++i) {
    along[0][i] = b[0][i];
    along[1][i] = b[1][i];
    along[2][i] = pose.t[i];
  }
  block[0] = block[1] = block[2] = 0;
  for (int k = 0; k < count; ++k) {
    const int i = indices[k];
    const double f1[3] = {pairs.ray[1][0][i], pairs.ray[1][1][i], pairs.ray[1][2][i]};
    double f0[3], g[3][4];  // g[a]: gradient of along[a] . (f0 x f1) by the four pixel coordinates
    turn_ray0(pairs, i, pose.R, f0);
    for (int c = 0; c < 4; ++c) {
      double* const* J = pairs.jacobian[c / 2];
      const double slope[3] = {J[c % 2][i], J[2 + c % 2][i], J[4 + c % 2][i]};
      double turned[3], moved[3];
      if (c < 2) {
        for (int r = 0; r < 3; ++r) {
          turned[r] = (pose.R(r, 0) * slope[0] + pose.R(r, 1) * slope[1]) + pose.R(r, 2) * slope[2];
        }
        cross(turned, f1, moved);
      } else {
        cross(f0, slope, moved);
      }
      for (int a = 0; a < 3; ++a) g[a][c] = dot(along[a], moved);
    }
    const double norm_sq =
        (g[2][0] * g[2][0] + g[2][1] * g[2][1]) + (g[2][2] * g[2][2] + g[2][3] * g[2][3]);
    if (!(norm_sq > 0)) continue;
    const double inverse = 1 / norm_sq;
    for (int c = 0; c < 4; ++c) {
      block[0] += g[0][c] * g[0][c] * inverse;
      block[1] += g[0][c] * g[1][c] * inverse;
      block[2] += g[1][c] * g[1][c] * inverse;
    }
  }
}

}  // namespace tv
