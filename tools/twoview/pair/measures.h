// How accurate a result is: pose errors, AUC, precision, percentiles.
#pragma once

#include <vector>

#include "base/matrix.h"
#include "twoview/twoview.h"

namespace cli {

// Angle of R_est R_gt^T, degrees; exact for small angles too.
double rotation_error_deg(const Matrix3& R_est, const Matrix3& R_gt);

// Angle between directions, degrees, [0, 180]. Infinite when either is zero.
double translation_error_signed_deg(const Vector3& t_est, const Vector3& t_gt);

// SuperGlue's, sign-free: min(e, 180 - e).
double translation_error_deg(const Vector3& t_est, const Vector3& t_gt);

// Area under recall against threshold from 0 to threshold_deg, divided by it, in per cent, by
// SuperGlue's definition: recall runs in straight lines from (0, 0) through (e_i, i / n), and flat
// after the last error below the threshold. A failure is infinity. 0 for an empty list.
double auc_percent(std::vector<double> errors_deg, double threshold_deg);

// Linear between order statistics, as numpy's default; share in [0, 1]; values not empty.
double percentile(std::vector<double> values, double share);

// Share of matches whose symmetric squared epipolar distance under the true pose is below 5e-4 in
// normalised coordinates, SuperGlue's precision; 0 without matches. A pixel outside the lens model
// counts as wrong.
double match_precision(const tv_camera& camera0, const tv_camera& camera1, const Matrix3& R,
                       const Vector3& t, const tv_reconstruction& reconstruction);

// True when the two-view result has rotation and translation: exit status 0.
bool has_full_pose(const tv_two_view& two_view);
Matrix3 rotation_of(const tv_two_view& two_view);
Vector3 translation_of(const tv_two_view& two_view);

}  // namespace cli
