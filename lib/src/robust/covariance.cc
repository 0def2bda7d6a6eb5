#include "robust/covariance.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/parallax.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/ldlt.h"
#include "robust/m_estimate.h"

namespace tv {

namespace {

// Normal residuals under Cauchy's loss: the variance of the M-estimate over that of the residuals,
// at the loss's scale that the refinement takes (1.5 deviations for the epipolar residual,
// kPlaneScale for the plane's).
constexpr double kVarianceOfCauchy = 1.1484187788317, kVarianceOnPlane = 1.0919;

constexpr double kLeastResidual = 0.05;  // least deviation of a residual, in scales of the loss
constexpr int kChunk = 64;               // matches that are handled at a time, on the stack

// Huber's variance for n residuals of `dimensions` each and p parameters; negative where the mean
// curvature of the loss is too small. cut_slope: what the mean of psi' loses because matches beyond
// a limit take no part: 2 psi(limit) times the density of the residuals there.
double variance_of(const LossSums& sums, int n, int dimensions, int p, double scale_px,
                   double cut_slope) {
  const double mean = sums.slope / n - cut_slope;
  if (!(mean > 0.05)) return -1;
  const double K = small_sample_factor(sums, n, dimensions, p, mean);
  const int left = dimensions * n - p;
  if (left <= 2) return -1;
  // The variance of Student's distribution, since the noise itself is estimated from `left` degrees
  // of freedom.
  const double student = static_cast<double>(left) / (left - 2);
  const double variance = student * K * K * sums.psi_sq / left / (mean * mean);
  const double least = kLeastResidual * scale_px;
  return std::max(variance, least * least);
}

void multiply5(const double A[25], const double B[25], double C[25]) {
  for (int r = 0; r < 5; ++r) {
    for (int c = 0; c < 5; ++c) {
      double sum = 0;
      for (int k = 0; k < 5; ++k) sum += A[5 * r + k] * B[5 * k + c];
      C[5 * r + c] = sum;
    }
  }
}

// J C J'.
void map_covariance(const double J[5][5], const double covariance[25], double mapped[25]) {
  double half[5][5];
  for (int r = 0; r < 5; ++r) {
    for (int c = 0; c < 5; ++c) {
      half[r][c] = 0;
      for (int k = 0; k < 5; ++k) half[r][c] += J[r][k] * covariance[5 * k + c];
    }
  }
  for (int r = 0; r < 5; ++r) {
    for (int c = r; c < 5; ++c) {
      double sum = 0;
      for (int k = 0; k < 5; ++k) sum += half[r][k] * J[c][k];
      mapped[5 * r + c] = mapped[5 * c + r] = sum;
    }
  }
}

}  // namespace

double rotation_sigma(const double covariance[25]) {
  return std::sqrt(covariance[0] + covariance[6] + covariance[12]);
}

double largest_sigma(const double covariance[25]) {
  return std::max(rotation_sigma(covariance), std::sqrt(covariance[18] + covariance[24]));
}

double direction_sigma(const Vec3& t, const double covariance[25]) {
  // The inverse's direction moves by R' (w x t - a b1 - b b2).
  Vec3 b1, b2;
  tangent_basis(t, &b1, &b2);
  const Mat3 of_rotation = -cross_matrix(t);
  double inverse = 0;
  for (int r = 0; r < 3; ++r) {
    const double row[5] = {of_rotation(r, 0), of_rotation(r, 1), of_rotation(r, 2), -b1[r], -b2[r]};
    for (int k = 0; k < 25; ++k) inverse += row[k / 5] * covariance[k] * row[k % 5];
  }
  return std::sqrt(std::max(covariance[18] + covariance[24], inverse));
}

bool pose_uncertainty(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                      double scale_px, double limit_px, PoseUncertainty* uncertainty) {
  constexpr int P = PoseModel::kParameters;
  if (count <= P) return false;
  double upper[15], gradient[P], inverse[25], squares[kChunk];
  PoseModel{pose}.normal_equations(pairs, indices, count, kLeastSquares, upper, gradient);
  if (!invert_symmetric(P, upper, inverse)) return false;
  const Mat3 E = essential_from_pose(pose);
  const double inverse_sq = 1 / (scale_px * scale_px);
  LossSums sums;
  for (int first = 0; first < count; first += kChunk) {
    const int some = std::min(kChunk, count - first);
    sampson_squares(pairs, indices + first, some, E, squares);
    for (int k = 0; k < some; ++k) {
      const double q = squares[k] * inverse_sq, weight = 1 / (1 + q);
      const double slope = (1 - q) * weight * weight;
      sums.psi_sq += squares[k] * weight * weight;
      sums.slope += slope;
      sums.slope_sq += slope * slope;
      sums.weight += weight;
    }
  }
  const double uncut = variance_of(sums, count, 1, P, scale_px, 0);
  if (!(uncut > 0)) return false;
  const double noise_px = std::sqrt(uncut / kVarianceOfCauchy);
  const double density =
      exp(-0.5 * limit_px * limit_px / (noise_px * noise_px)) / (2.5066282746310002 * noise_px);
  const double cut_slope = 2 * limit_px / (1 + limit_px * limit_px * inverse_sq) * density;
  const double variance = variance_of(sums, count, 1, P, scale_px, cut_slope);
  uncertainty->noise_px = noise_px;
  uncertainty->variance_px = variance;
  uncertainty->mean_weight = sums.weight / count;
  uncertainty->mean_slope = sums.slope / count - cut_slope;
  if (!(variance > 0)) return false;
  // A = J' J is computed at the noisy pixels. A0 is A less what the noise adds to it, that is, the
  // information of the points' motion alone: C = A0^-1 A A0^-1.
  double noise[3];
  direction_noise(pairs, indices, count, pose, noise);
  double exact[15], A[25], half[25];
  for (int k = 0; k < 15; ++k) exact[k] = upper[k];
  const double noise_sq = noise_px * noise_px;
  exact[12] -= noise_sq * noise[0];
  exact[13] -= noise_sq * noise[1];
  exact[14] -= noise_sq * noise[2];
  if (!invert_symmetric(P, exact, inverse)) return false;
  for (int r = 0, slot = 0; r < 5; ++r) {
    for (int c = r; c < 5; ++c) A[5 * r + c] = A[5 * c + r] = upper[slot++];
  }
  multiply5(inverse, A, half);
  multiply5(half, inverse, uncertainty->covariance);
  for (int r = 0; r < 5; ++r) {
    for (int c = r; c < 5; ++c) {
      uncertainty->covariance[5 * r + c] *= variance;
      uncertainty->covariance[5 * c + r] = uncertainty->covariance[5 * r + c];
    }
  }
  return all_finite(uncertainty->covariance, 25);
}

double growth_by_disagreement(int num_inliers, int num_matches) {
  constexpr double kUsual = 0.3;
  const double ratio = (num_matches - num_inliers) / (kUsual * num_matches);
  return ratio > 1 ? ratio * ratio * ratio : 1;
}

bool plane_uncertainty(const RayPairs& pairs, const int32_t* indices, int count,
                       const PlaneModel& model, double scale_px, PoseUncertainty* uncertainty) {
  constexpr int P = PlaneModel::kParameters;
  if (2 * count <= P) return false;
  double upper[P * (P + 1) / 2], gradient[P], inverse[P * P];
  model.normal_equations(pairs, indices, count, kLeastSquares, upper, gradient);
  if (!invert_symmetric(P, upper, inverse)) return false;
  const Mat3 H = model.matrix();
  const double inverse_sq = 1 / (scale_px * scale_px);
  LossSums sums;
  for (int k = 0; k < count; ++k) {
    const double r_sq = transfer_residual(pairs, indices[k], H).r_sq;
    const double weight = 1 / (1 + r_sq * inverse_sq), slope = weight * weight;
    sums.psi_sq += r_sq * slope;
    sums.slope += slope;
    sums.slope_sq += slope * slope;
    sums.weight += weight;
  }
  const double variance = variance_of(sums, count, 2, P, scale_px, 0);
  for (int r = 0; r < 5; ++r) {
    for (int c = 0; c < 5; ++c) uncertainty->covariance[5 * r + c] = variance * inverse[P * r + c];
  }
  uncertainty->variance_px = variance;
  uncertainty->mean_weight = sums.weight / count;
  uncertainty->mean_slope = sums.slope / count;
  uncertainty->noise_px = std::sqrt(std::max(variance, 0.0) / kVarianceOnPlane);
  return variance > 0 && all_finite(uncertainty->covariance, 25);
}

void invert_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                       double inverse_covariance[25]) {
  Vec3 b1, b2, c1, c2;
  tangent_basis(pose.t, &b1, &b2);
  tangent_basis(inverse.t, &c1, &c2);
  double J[5][5] = {};
  for (int k = 0; k < 5; ++k) {
    // The steps of the inverse pose's rotation and translation for a unit step of parameter k.
    Vec3 w = Vec3::Zero(), move = Vec3::Zero();
    if (k < 3) {
      Vec3 axis = Vec3::Zero();
      axis[k] = 1;
      w = -(pose.R.transpose() * axis);
      move = pose.R.transpose() * axis.cross(pose.t);
    } else {
      move = -(pose.R.transpose() * (k == 3 ? b1 : b2));
    }
    for (int r = 0; r < 3; ++r) J[r][k] = w[r];
    J[3][k] = move.dot(c1);
    J[4][k] = move.dot(c2);
  }
  map_covariance(J, covariance, inverse_covariance);
}

void carry_covariance(const Vec3& t, const Vec3& to, const double covariance[25],
                      double carried[25]) {
  Vec3 b[2], c[2];
  tangent_basis(t, &b[0], &b[1]);
  tangent_basis(to, &c[0], &c[1]);
  double J[5][5] = {};
  for (int k = 0; k < 3; ++k) J[k][k] = 1;
  for (int r = 0; r < 2; ++r) {
    for (int k = 0; k < 2; ++k) J[3 + r][3 + k] = c[r].dot(b[k]);
  }
  map_covariance(J, covariance, carried);
}

}  // namespace tv
