#include "odometry/window_prior.h"

#include <cmath>

#include "base/math.h"
#include "geometry/essential.h"

namespace tv {
namespace {

Mat3 matrix(const double R[9]) {
  Mat3 M;
  for (int i = 0; i < 9; ++i) M(i / 3, i % 3) = R[i];
  return M;
}

Vec3 vector(const double v[3]) { return Vec3(v[0], v[1], v[2]); }

// The vector w with exp([w]x) = R, and its derivative dw for R -> exp([dx]x) R, the inverse of the
// left Jacobian of SO(3).
Vec3 rotation_vector(const Mat3& R, Mat3* jacobian) {
  Vec3 axis(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));  // 2 sin(angle) axis
  const double sine = 0.5 * axis.norm(), cosine = 0.5 * (R(0, 0) + R(1, 1) + R(2, 2) - 1.0);
  const double angle = atan2(sine, cosine);
  Vec3 w = 0.5 * axis;
  double square = 1.0 / 12.0;  // the factor of [w]x^2
  if (angle > kPi - 1e-3) {
    // Near half a turn the axis is the longest column of R + R' - (tr R - 1) I = 2 (1 - cos) a a'.
    Mat3 twice = R + R.transpose();
    for (int i = 0; i < 3; ++i) twice(i, i) -= 2.0 * cosine;
    int longest = 0;
    for (int i = 1; i < 3; ++i) longest = twice(i, i) > twice(longest, longest) ? i : longest;
    const Vec3 column = twice.col(longest);
    w = column * ((column.dot(axis) < 0.0 ? -angle : angle) / column.norm());
  } else if (sine > 0.0) {
    w *= angle / sine;
  }
  if (angle > 1e-3) square = 1.0 / (angle * angle) - (1.0 + cosine) / (2.0 * angle * sine);
  if (angle > kPi - 1e-3) square = 1.0 / (angle * angle);
  const Mat3 K = cross_matrix(w);
  *jacobian = Mat3::Identity() - 0.5 * K + square * (K * K);
  return w;
}

}  // namespace

WindowPose stepped(const WindowPose& pose, const double step[6]) {
  const Mat3 turn = rotation_step(vector(step));
  const Mat3 R = orthonormalised(turn * matrix(pose.R));
  const Vec3 t = turn * vector(pose.t) + vector(step + 3);
  WindowPose result;
  for (int i = 0; i < 9; ++i) result.R[i] = R(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) result.t[i] = t[i];
  set_centre(&result);
  return result;
}

void pose_term(const tv_pose_prior& prior, const WindowPose& pose, PriorTerm* term) {
  const Mat3 turn = matrix(pose.R) * matrix(prior.R).transpose();
  Mat3 slope;
  const Vec3 w = rotation_vector(turn, &slope);
  const Vec3 v = vector(pose.t) - turn * vector(prior.t);
  // r = (w, v), J = d r / d step = [slope 0; -[v]x I].
  double r[6], J[6][6] = {}, M[6][6] = {};
  const Mat3 V = cross_matrix(v);
  for (int i = 0; i < 3; ++i) {
    r[i] = w[i];
    r[3 + i] = v[i];
    J[3 + i][3 + i] = 1.0;
    for (int j = 0; j < 3; ++j) {
      J[i][j] = slope(i, j);
      J[3 + i][j] = -V(i, j);
    }
  }
  *term = PriorTerm{};
  for (int i = 0; i < 6; ++i) {  // M = J' information
    for (int j = 0; j < 6; ++j) {
      for (int k = 0; k < 6; ++k) M[i][j] += J[k][i] * prior.information[6 * k + j];
    }
    for (int j = 0; j < 6; ++j) {
      term->gradient[0][i] += M[i][j] * r[j];
      term->cost += r[i] * prior.information[6 * i + j] * r[j];
      for (int k = 0; k < 6; ++k) term->H[0][0][6 * i + j] += M[i][k] * J[k][j];
    }
  }
}

void gravity_term(const tv_gravity_prior& prior, const double world_down[3], const WindowPose& pose,
                  PriorTerm* term) {
  const Vec3 h = matrix(pose.R) * vector(world_down).normalized();
  const Vec3 error = h - vector(prior.down).normalized();
  const double weight = 1.0 / (prior.sigma_rad * prior.sigma_rad);
  // d h = w x h = -[h]x w; the two rows across h are those that count.
  const Vec3 gradient = weight * h.cross(error);
  *term = PriorTerm{};
  term->cost = weight * error.squaredNorm();
  for (int i = 0; i < 3; ++i) {
    term->gradient[0][i] = gradient[i];
    for (int j = 0; j < 3; ++j) {
      term->H[0][0][6 * i + j] = weight * ((i == j ? 1.0 : 0.0) - h[i] * h[j]);
    }
  }
}

void distance_term(const tv_distance_prior& prior, const WindowPose& pose0, const WindowPose& pose1,
                   PriorTerm* term) {
  const Vec3 across = vector(pose1.centre) - vector(pose0.centre);
  const double length = across.norm();
  const double r = (length - prior.distance) / prior.sigma;
  *term = PriorTerm{};
  term->cost = r * r;
  if (!(length > 0.0)) return;  // in one place: no direction is the better one
  // d centre = -R' v
  const Vec3 unit = across / (length * prior.sigma);
  const Vec3 slopes[2] = {matrix(pose0.R) * unit, -(matrix(pose1.R) * unit)};
  for (int a = 0; a < 2; ++a) {
    for (int i = 0; i < 3; ++i) {
      term->gradient[a][3 + i] = r * slopes[a][i];
      for (int b = 0; b <= a; ++b) {
        for (int j = 0; j < 3; ++j) {
          term->H[a][b][6 * (3 + i) + 3 + j] = slopes[a][i] * slopes[b][j];
        }
      }
    }
  }
}

}  // namespace tv
