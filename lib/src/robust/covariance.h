// The covariance of a pose, alone or fitted with a plane, and the noise of a pixel, both from the
// residuals; and the covariance of the inverse pose.
#pragma once

#include "robust/estimators.h"
#include "robust/pair_evidence.h"

namespace tv {

struct PoseUncertainty {
  double covariance[25];  // in the parameters (w, a, b) of PoseModel
  double noise_px;        // standard deviation of a pixel's coordinate
  double variance_px;  // variance of the M-estimate for a residual: C = variance_px (J' J)^-1, px^2
  double mean_weight, mean_slope;  // means of the loss's weight and of psi' over the matches
  double focal_sigma;  // relative standard deviation of a refined focal length; else the given one
  // The standard deviations by which the verdict judges: largest_sigma of the noise alone, and
  // direction_sigma with the errors that matches share. Where a focal length is uncertain and not
  // refined, all errors count: sigma_rad is then at least rotation_sigma with them, and
  // direction_sigma_rad is computed with them.
  double sigma_rad, direction_sigma_rad;
  CameraMisfit misfit;  // in the covariance; of a pose that was fitted with a plane not tested
};

// An upper bound of the standard deviations of the rotation and of the direction about any axis:
// the root of the larger trace of their two blocks.
double largest_sigma(const double covariance[25]);
// The same of the rotation alone.
double rotation_sigma(const double covariance[25]);
// The same of the direction alone: of that of t or of the inverse pose's, whichever is larger.
double direction_sigma(const Vec3& t, const double covariance[25]);

// The covariance of the M-estimate that minimises Cauchy's loss with scale_px over the listed
// matches (P. Huber, "Robust Statistics", 1981, 7.6): with psi the derivative of the loss and p = 5
// parameters,
//     C = K^2 sum psi(r)^2 / (n - p - 2) / (mean psi'(r))^2 (J' J)^-1,
//     K = 1 + p / n var(psi') / (mean psi')^2.
// The formula includes the lower efficiency of the loss compared with least squares, and the effect
// of wrong matches among the listed ones. limit_px: the largest residual of a listed match. What
// the noise of the pixels contributes to J' J is subtracted, because at a low parallax it is a
// considerable part. The standard deviation of a residual counts as at least scale_px / 20, since
// even exact input comes from a camera that is not exact. False when a parameter is not determined.
bool pose_uncertainty(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                      double scale_px, double limit_px, PoseUncertainty* uncertainty);

// By how much the variances grow because of wrong matches among the inliers. Where more than 30 per
// cent of the matches are no inliers, those that happen to lie near the epipolar lines, or agree
// with one another, turn the pose by more than their residuals tell: the third power of that share
// over 0.3, at least 1. docs/decisions/0024-honest-covariance.md.
double growth_by_disagreement(int num_inliers, int num_matches);

// Like pose_uncertainty, for a pose that is fitted together with a plane (PlaneModel). Its
// residuals have two dimensions: with w the loss's weight, E[psi'] is the mean of w^2.
inline constexpr double kPlaneScale = 2;  // scale of the loss, in standard deviations of the noise
bool plane_uncertainty(const RayPairs& pairs, const int32_t* indices, int count,
                       const PlaneModel& model, double scale_px, PoseUncertainty* uncertainty);

// The covariance of the inverse pose (R', -R' t) in its own parameters: to first order
// w' = -R' w, and t' moves by -R' (a b1 + b b2) + R' (w x t).
void invert_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                       double inverse_covariance[25]);

// The covariance of a pose with the direction t, in the parameters of a pose near it whose
// direction is `to`.
void carry_covariance(const Vec3& t, const Vec3& to, const double covariance[25],
                      double carried[25]);

}  // namespace tv
