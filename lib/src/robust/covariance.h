// How sure a pose is.
#pragma once

#include "robust/estimators.h"

namespace tv {

struct PoseUncertainty {
  double covariance[25];  // in the parameters (w, a, b) of PoseModel
  double noise_px;        // standard deviation of a pixel's coordinate
};

// The covariance of the M-estimate that minimises Cauchy's loss with scale_px over the listed
// matches (P. Huber, "Robust Statistics", 1981, 7.6): with psi the derivative of the loss and p = 5
// parameters,
//     C = sum psi(r)^2 / (n - p) / (mean psi'(r))^2 (J' J)^-1.
// It allows for what the loss loses against least squares, and for the wrong matches among the
// listed. Residuals of a twentieth of scale_px and less count as that: exact input is no exact
// camera. False when a parameter is not determined.
bool pose_uncertainty(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                      double scale_px, PoseUncertainty* uncertainty);

// The covariance of the inverse pose (R', -R' t) in its own parameters: to first order
// w' = -R' w, and t' moves by -R' (a b1 + b b2) + R' (w x t).
void invert_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                       double inverse_covariance[25]);

}  // namespace tv
