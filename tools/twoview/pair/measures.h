// Measures of the accuracy of a result: pose errors, AUC, precision, percentiles.
#pragma once

#include <vector>

#include "base/matrix.h"
#include "twoview/twoview.h"

namespace cli {

// The angle of R_est R_gt^T in degrees; precise for small angles too.
double rotation_error_deg(const Matrix3& R_est, const Matrix3& R_gt);

// The angle between two directions in degrees, [0, 180]; infinite if either is zero.
double translation_error_signed_deg(const Vector3& t_est, const Vector3& t_gt);

// SuperGlue's translation error, which ignores the sign: min(e, 180 - e), in degrees.
double translation_error_deg(const Vector3& t_est, const Vector3& t_gt);

// SuperGlue's AUC in per cent: the area below recall as a function of the error threshold, from 0
// to threshold_deg, divided by threshold_deg. Recall is linear between (0, 0) and the points (e_i,
// i / n), and constant after the last error below the threshold. A failed pair has an infinite
// error. An empty list gives 0.
double auc_percent(std::vector<double> errors_deg, double threshold_deg);

// The percentile by linear interpolation between order statistics, as numpy's default. `share` is
// in [0, 1]; `values` must not be empty.
double percentile(std::vector<double> values, double share);

// SuperGlue's precision: the share of matches whose symmetric squared epipolar distance under the
// true pose is below 5e-4 in normalised coordinates. It is 0 without matches. A pixel whose ray the
// lens model cannot compute, or whose ray points backward, counts as wrong.
double match_precision(const tv_camera& camera0, const tv_camera& camera1, const Matrix3& R,
                       const Vector3& t, const tv_reconstruction& reconstruction);

// Returns true if the result has both rotation and translation, for which the exit status is 0.
bool has_full_pose(const tv_two_view& two_view);
Matrix3 rotation_of(const tv_two_view& two_view);
Vector3 translation_of(const tv_two_view& two_view);

// The standard deviation of a point's distance from camera 0 that the pose's covariance causes, to
// first order, in baselines; 0 where there is no covariance. `point`: in camera 0's frame, in
// baselines. The formula is in docs/algorithms/dense.md.
double distance_sigma_of_pose(const tv_two_view& two_view, const Vector3& point);

}  // namespace cli
