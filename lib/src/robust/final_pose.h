// The pose that a pair ends with: refined over all matches near it, with its uncertainty.
#pragma once

#include "robust/covariance.h"
#include "robust/gravity.h"
#include "robust/principal_point.h"

namespace tv {

// Refining a pose leaves the matches as they are; place_principal_point, which is given a refiner
// that is not const, moves their rays.
struct PoseRefiner {
  const TwoViewProblem& problem;
  Matches& matches;
  double threshold_px;
  GravityPrior gravity;
  PrincipalPoint principal_point;  // of the rays of the matches
  int32_t* indices;                // scratch, as many as matches
  double* values;                  // the same
};

// Minimises Cauchy's loss over the matches near the epipolar lines, gravity's prior added to it.
Pose refined_pose(const PoseRefiner& refiner, const Pose& start);

// Whether the matches speak against refiner.principal_point, with one chance in a thousand to be
// wrong where it is right. The pose is what refined_pose gave.
bool principal_point_is_off(const PoseRefiner& refiner, const Pose& pose);
// One step of Gauss and Newton of the pose and the principal point together. What the point moves
// by, in pixels, goes to shift_px; the rays are as they were. False when it is not determined.
bool move_together(const PoseRefiner& refiner, Pose* pose, double shift_px[2]);

// Allows for a principal point that is free.
bool uncertainty_of(const PoseRefiner& refiner, const Pose& pose, PoseUncertainty* uncertainty);

// The two motions of a plane that explains the matches by itself: eight parameters and two
// residuals a match, against five and one above, which leaves a flat valley along which a plane's
// epipolar geometry may slide. Writes up to two poses and the covariance of each; returns how many.
struct PlaneFit {
  Pose pose[2];
  bool certain[2];  // whether there is an uncertainty
  PoseUncertainty uncertainty[2];
};
int refine_on_plane(const PoseRefiner& refiner, const Mat3& H, const Vec3& mean_ray0,
                    PlaneFit* fit);

// The inliers' median residual as the standard deviation of normal noise, over the matches of
// refiner.indices that lie within the threshold of M.
double median_noise_px(const PoseRefiner& refiner, const Mat3& M, int count);

// The final loss around a model of which `count` matches are listed in refiner.indices.
RobustLoss final_loss(const PoseRefiner& refiner, const Mat3& M, int count);

// The final refinement looks this many thresholds far, this often, each time with so many steps.
inline constexpr double kFinalNear = 3;
inline constexpr int kFinalRounds = 2, kFinalIterations = 20;

}  // namespace tv
