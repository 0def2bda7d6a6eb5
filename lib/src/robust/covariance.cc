#include "robust/covariance.h"

#include <cmath>

namespace tv {

namespace {

// Normal residuals, cut at three deviations, under Cauchy's loss with a scale of 1.5 deviations:
// the variance of the M-estimate over that of the residuals.
constexpr double kVarianceOfCauchy = 1.1405946331327699;

constexpr double kLeastResidual = 0.05;  // of the loss's scale

}  // namespace

bool pose_uncertainty(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                      double scale_px, PoseUncertainty* uncertainty) {
  if (count <= 5) return false;
  double upper[15], gradient[5];
  // A scale that no residual reaches: plain least squares.
  constexpr double kNoLimit = 1e140;
  const PoseModel model{pose};
  model.normal_equations(pairs, indices, count, RobustLoss{Loss::kTruncated, kNoLimit}, upper,
                         gradient);
  double inverse[25];
  if (!invert_symmetric5(upper, inverse)) return false;
  const Mat3 E = essential_from_pose(pose);
  const double inverse_sq = 1 / (scale_px * scale_px);
  double psi_sq = 0, slope = 0;
  for (int k = 0; k < count; ++k) {
    const double r_sq = sampson_sq(pairs, indices[k], E);
    const double q = r_sq * inverse_sq, weight = 1 / (1 + q);
    psi_sq += r_sq * weight * weight;
    slope += (1 - q) * weight * weight;
  }
  slope /= count;
  if (!(slope > 0.05)) return false;  // residuals that no curve of the loss holds together
  double variance = psi_sq / (count - 5) / (slope * slope);
  const double least = kLeastResidual * scale_px;
  if (variance < least * least) variance = least * least;
  for (int k = 0; k < 25; ++k) {
    uncertainty->covariance[k] = variance * inverse[k];
    if (!(uncertainty->covariance[k] - uncertainty->covariance[k] == 0.0)) return false;
  }
  uncertainty->noise_px = std::sqrt(variance / kVarianceOfCauchy);
  return true;
}

void invert_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                       double inverse_covariance[25]) {
  Vec3 b1, b2, c1, c2;
  tangent_basis(pose.t, &b1, &b2);
  tangent_basis(inverse.t, &c1, &c2);
  double J[5][5] = {};
  for (int k = 0; k < 5; ++k) {
    Vec3 w = Vec3::Zero(), move = Vec3::Zero();  // of the inverse, for a unit step of parameter k
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
      inverse_covariance[5 * r + c] = inverse_covariance[5 * c + r] = sum;
    }
  }
}

}  // namespace tv
