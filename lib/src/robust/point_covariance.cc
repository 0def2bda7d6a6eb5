#include "robust/point_covariance.h"

#include "base/math.h"

namespace tv {
namespace {

// Columns of the answer: the derivatives of (direction step, inverse distance) by the noise of the
// four pixel coordinates, then by the pose's five parameters. The errors of the match are scratch.
void answer_to_errors(const BundleFrame& frame, const Elimination& e, BundleMatch* match,
                      double answer[3][9]) {
  for (int c = 0; c < 9; ++c) {
    double noise[4] = {}, parameter[5] = {};
    (c < 4 ? noise[c] : parameter[c - 4]) = 1.0;
    double move[3];
    match->error[0][0] = -noise[0];
    match->error[0][1] = -noise[1];
    match->error[1][0] = -noise[2];
    match->error[1][1] = -noise[3];
    linear_step(frame, *match, e, parameter, move);
    for (int r = 0; r < 3; ++r) answer[r][c] = move[r];
  }
}

}  // namespace

bool point_covariance(const Camera cameras[2], const BundleFrame& frame, double baseline,
                      const double* pose_covariance, double noise_px, const tv_point& point,
                      double covariance[9]) {
  for (int i = 0; i < 9; ++i) covariance[i] = 0.0;
  BundlePoint at;
  BundleMatch match;
  if (point.status != TV_POINT_OK || !read_point(point, baseline, &at) ||
      !linearise(cameras, frame, at, Vec2(0, 0), Vec2(0, 0), &match)) {
    return false;
  }
  const Elimination e = eliminate(frame, match);
  if (!(e.length > 0.0)) return false;
  double answer[3][9];
  answer_to_errors(frame, e, &match, answer);
  double parameters[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      double sum = 0.0;
      for (int c = 0; c < 4; ++c) sum += answer[i][c] * answer[j][c];
      sum *= noise_px * noise_px;
      for (int u = 0; pose_covariance != nullptr && u < 5; ++u) {
        for (int v = 0; v < 5; ++v) {
          sum += answer[i][4 + u] * pose_covariance[5 * u + v] * answer[j][4 + v];
        }
      }
      parameters[i][j] = parameters[j][i] = sum;
    }
  }
  // The position is baseline direction / rho.
  const double* d = at.direction;
  const double distance = baseline / at.inverse_distance;
  double basis[3][3];
  sphere_basis(d, basis[0], basis[1]);
  for (int i = 0; i < 3; ++i) {
    basis[0][i] *= distance;
    basis[1][i] *= distance;
    basis[2][i] = -d[i] * (distance / at.inverse_distance);
  }
  double result[9];
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      double sum = 0.0;
      for (int u = 0; u < 3; ++u) {
        for (int v = 0; v < 3; ++v) sum += basis[u][i] * parameters[u][v] * basis[v][j];
      }
      if (!is_finite(sum)) return false;
      result[3 * i + j] = result[3 * j + i] = sum;
    }
  }
  for (int i = 0; i < 9; ++i) covariance[i] = result[i];
  return true;
}

}  // namespace tv
