#include "adjust/window_prior.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/essential.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

// Products of plain arrays, which take half as much code as Eigen's expressions.
double product_of(const double a[3], const double b[3]) {
  return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]);
}

double norm_of(const double v[3]) { return std::sqrt(product_of(v, v)); }

void multiply(const double R[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = product_of(R + 3 * i, v);
}

// A B', that is, B is given by its columns.
void multiply_rows(const double A[9], const double B[9], double out[9]) {
  for (int i = 0; i < 3; ++i) multiply(B, A + 3 * i, out + 3 * i);
}

void normalise(const double v[3], double out[3]) {
  const double length = norm_of(v);
  for (int i = 0; i < 3; ++i) out[i] = length > 0.0 ? v[i] / length : v[i];
}

Vec3 vector(const double v[3]) { return Vec3(v[0], v[1], v[2]); }

// The vector w with exp([w]x) = R, and its derivative dw for R -> exp([dx]x) R, the inverse of the
// left Jacobian of SO(3).
void rotation_vector(const double R[9], double w[3], double jacobian[9]) {
  const double axis[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]};  // 2 sin(angle) axis
  const double sine = 0.5 * norm_of(axis), cosine = 0.5 * (R[0] + R[4] + R[8] - 1.0);
  const double angle = atan2(sine, cosine);
  const bool near_half_turn = angle > kPi - 1e-3;
  double square = 1.0 / 12.0;  // the factor of [w]x^2
  for (int i = 0; i < 3; ++i) w[i] = 0.5 * axis[i];
  if (near_half_turn) {
    // The axis is the longest column (or row) of R + R' - (tr R - 1) I = 2 (1 - cos) a a'.
    double sum[9];
    for (int i = 0; i < 9; ++i) {
      sum[i] = R[i] + R[3 * (i % 3) + i / 3] - (i % 4 == 0 ? 2.0 * cosine : 0.0);
    }
    int longest = 0;
    for (int i = 1; i < 3; ++i) longest = sum[4 * i] > sum[4 * longest] ? i : longest;
    const double* column = sum + 3 * longest;
    const double scale = (product_of(column, axis) < 0.0 ? -angle : angle) / norm_of(column);
    for (int i = 0; i < 3; ++i) w[i] = column[i] * scale;
  } else if (sine > 0.0) {
    const double scale = angle / sine;
    scale_by(scale, w);
  }
  if (angle > 1e-3) square = 1.0 / (angle * angle) - (1.0 + cosine) / (2.0 * angle * sine);
  if (near_half_turn) square = 1.0 / (angle * angle);
  const Mat3 K = cross_matrix(vector(w));
  double squared[9], scaled[9];  // K^2 = -K K'
  for (int i = 0; i < 9; ++i) scaled[i] = square * K.data()[i];
  multiply_rows(scaled, K.data(), squared);
  for (int i = 0; i < 9; ++i) {
    jacobian[i] = ((i % 4 == 0 ? 1.0 : 0.0) - 0.5 * K.data()[i]) - squared[i];
  }
}

}  // namespace

WindowPose stepped(const WindowPose& pose, const double step[6]) {
  const Mat3 turn = rotation_step(vector(step));
  WindowPose result;
  write_matrix(orthonormal_product(turn, matrix_of(pose.R)), result.R);
  multiply(turn.data(), pose.t, result.t);
  for (int i = 0; i < 3; ++i) result.t[i] += step[3 + i];
  set_centre(&result);
  return result;
}

void pose_term(const tv_pose_prior& prior, const WindowPose& pose, PriorTerm* term) {
  double turn[9], slope[9], moved[3];
  multiply_rows(pose.R, prior.R, turn);
  multiply(turn, prior.t, moved);
  // r = (w, v), J = d r / d step = [slope 0; -[v]x I].
  double r[6], J[6][6] = {}, M[6][6] = {};
  rotation_vector(turn, r, slope);
  for (int i = 0; i < 3; ++i) r[3 + i] = pose.t[i] - moved[i];
  const Mat3 V = cross_matrix(vector(r + 3));
  for (int i = 0; i < 3; ++i) {
    J[3 + i][3 + i] = 1.0;
    for (int j = 0; j < 3; ++j) {
      J[i][j] = slope[3 * i + j];
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
  double in_world[3], h[3], measured[3], error[3], across[3];
  normalise(world_down, in_world);
  multiply(pose.R, in_world, h);
  normalise(prior.down, measured);
  for (int i = 0; i < 3; ++i) error[i] = h[i] - measured[i];
  const double weight = 1.0 / (prior.sigma_rad * prior.sigma_rad);
  // d h = w x h = -[h]x w; the two rows across h are those that count.
  cross(h, error, across);
  *term = PriorTerm{};
  term->cost = weight * product_of(error, error);
  for (int i = 0; i < 3; ++i) {
    term->gradient[0][i] = weight * across[i];
    for (int j = 0; j < 3; ++j) {
      term->H[0][0][6 * i + j] = weight * ((i == j ? 1.0 : 0.0) - h[i] * h[j]);
    }
  }
}

void distance_term(const tv_distance_prior& prior, const WindowPose& pose0, const WindowPose& pose1,
                   PriorTerm* term) {
  double unit[3], slopes[2][3];
  for (int i = 0; i < 3; ++i) unit[i] = pose1.centre[i] - pose0.centre[i];
  const double length = norm_of(unit);
  const double r = (length - prior.distance) / prior.sigma;
  *term = PriorTerm{};
  term->cost = r * r;
  if (!(length > 0.0)) return;  // in one place: no direction is the better one
  // d centre = -R' v
  for (double& x : unit) x /= length * prior.sigma;
  multiply(pose0.R, unit, slopes[0]);
  multiply(pose1.R, unit, slopes[1]);
  for (double& x : slopes[1]) x = -x;
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
