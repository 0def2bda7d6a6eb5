// The final refinement of a pose over all matches near it; its covariance; the test and the step of
// the principal point; the two motions of a plane; and the loss that they share.
#pragma once

#include "robust/covariance.h"
#include "robust/pose_refiner.h"

namespace tv {

// The pose that minimises Cauchy's loss over the matches near the epipolar lines, with gravity as a
// prior where it is known.
Pose refined_pose(const PoseRefiner& refiner, const Pose& start);

// Tests the given principal point against the matches. pose: the result of refined_pose. With a
// prior of the deviations sigma_px, true where they contradict it at a significance of 0.001; with
// sigma_px = 0 always false.
bool principal_point_is_off(const PoseRefiner& refiner, const Pose& pose, const double sigma_px[2],
                            PrincipalPointTest* test);
// One Gauss-Newton step of the pose and the principal point together. Writes the principal point's
// step, in pixels, to shift_px; the caller then moves the rays. False when the step is not
// determined.
bool move_together(const PoseRefiner& refiner, Pose* pose, double shift_px[2]);

// One Gauss-Newton step of the pose and the logarithm of the focal length together, with the
// options' deviation as its prior. growth: by how much the matches' covariance grows through shared
// errors; 0 in the first call, which computes it. The caller then moves the rays by *step. False,
// and nothing is changed, where the step is not determined, or where the matches would not lower
// the deviation by a fifth.
bool step_focal_length(const PoseRefiner& refiner, double* growth, Pose* pose, double* step);

// The covariance of a refined pose and the noise of a pixel. It includes the uncertainty of a
// principal point and a focal length that are free, the errors that matches share, and the sigmas
// of the calibration. False when the pose is not determined.
bool uncertainty_of(const PoseRefiner& refiner, const Pose& pose, PoseUncertainty* uncertainty);

// The two motions of a plane that explains nearly all matches, refined together with the plane:
// eight parameters, and two residuals for each match. A pose alone has five and one; on a plane its
// minimum is so flat that the pose is poorly determined. Writes up to two poses and the covariance
// of each; returns how many.
struct PlaneFit {
  Pose pose[2];
  bool certain[2];  // whether the pose's uncertainty is known
  PoseUncertainty uncertainty[2];
};
int refine_on_plane(const PoseRefiner& refiner, const Mat3& H, const Vec3& mean_ray0,
                    PlaneFit* fit);

// The standard deviation of the noise in pixels: 1.4826 times the median of the absolute residuals
// under M, as for a normal distribution, over those of the first `count` matches in refiner.indices
// whose residual is at most the threshold (where the distribution is cut off, which is not
// corrected for). The threshold, where there is none.
double median_noise_px(const PoseRefiner& refiner, const Mat3& M, int count);

// The final loss around a model of which `count` matches are listed in refiner.indices.
RobustLoss final_loss(const PoseRefiner& refiner, const Mat3& M, int count);

// The final refinement takes the matches within kFinalNear thresholds.
inline constexpr double kFinalNear = 3;

}  // namespace tv
