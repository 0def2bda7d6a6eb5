// The reprojection errors of a pose: a fast robust cost of all matches, and the normal equations of
// the refinement. Tests: test/unit/test_absolute_pose.cc.
#pragma once

#include "geometry/vector3.h"
#include "pose/sightings.h"
#include "robust/m_estimate.h"

namespace tv {

inline constexpr int kSightingCost = TVK_SIGHTING_COST;  // of a match outside the threshold

// Sum over the different matches of min(|e|^2 / T^2, 1), T the threshold, each truncated to a
// multiple of 1 / kSightingCost: an integer, so that the order does not matter. Where the sum is
// above `bound`, or is likely to be by the first matches, INT64_MAX is returned.
int64_t reprojection_cost(const Sightings& sightings, const Pose& pose, double threshold_px,
                          int64_t bound);

// p = R point + t.
inline void place(const Pose& pose, const double point[3], double p[3]) {
  rotate(pose.R, point, p);
  for (int k = 0; k < 3; ++k) p[k] += pose.t[k];
}

// |e|^2 of a match, in pixels^2; infinite where the camera cannot see the point.
double reprojection_sq(const Sighting& sighting, const Pose& pose);

// The direction of gravity, "down", in the world and in the camera: unit vectors.
struct GravitySight {
  double weight = 0;  // the inverse of its variance in rad^-2; 0: not known
  Vec3 in_world = Vec3::Zero(), in_camera = Vec3::Zero();
};

// What the normal equations are of: the robust loss sum q / (1 + q) with q = |e|^2 / scale^2 (S.
// Geman, D. McClure, 1987) over the listed matches, and the prior of gravity, whose term is
// noise_sq weight |R in_world - in_camera|^2 / scale^2.
struct PoseProblem {
  const SightingInput* exact;  // null: errors to first order; else by projection with its lens
  const Sightings& sightings;
  const int32_t* indices;
  int count;
  double scale_px;
  GravitySight gravity;
  double noise_sq = 0;
};

// In the parameters (w, d): R <- exp([w]x) R, t <- t + d, for the points as Sightings has them.
struct PoseEquations {
  double upper[21], gradient[6];
  double cost;
  // For the variance of the estimate: psi = e / (1 + q)^2, and psi' is half its divergence; and how
  // many matches are visible.
  LossSums sums;
  int visible;
};
void pose_equations(const PoseProblem& problem, const Pose& pose, PoseEquations* equations);

// Lowers the loss by Levenberg-Marquardt steps, until one gains less than small_gain of it. Writes
// the equations at the result where `equations` is not null.
void refine_absolute(const PoseProblem& problem, int max_iterations, double small_gain, Pose* pose,
                     PoseEquations* equations);

}  // namespace tv
