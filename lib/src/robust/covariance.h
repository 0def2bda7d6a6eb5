// How sure a pose is.
#pragma once

#include "robust/estimators.h"

namespace tv {

// sigma^2 (J' J)^-1 over the listed inliers, sigma^2 = sum r^2 / (count - 5): Gauss-Newton's
// covariance at the optimum, in the parameters (w, a, b) of PoseModel. False when a parameter is
// not determined.
bool pose_covariance(const RayPairs& pairs, const int32_t* inliers, int count, const Pose& pose,
                     double covariance[25]);

// The covariance of the inverse pose (R', -R' t) in its own parameters: to first order
// w' = -R' w, and t' moves by -R' (a b1 + b b2) + R' (w x t).
void invert_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                       double inverse_covariance[25]);

}  // namespace tv
