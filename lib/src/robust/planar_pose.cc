#include "robust/planar_pose.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/chance.h"

#include <algorithm>

namespace tv {
namespace {

// Whether the matches decide against a rival of the outcome's pose, which num_inliers matches
// explain: of those that only one of the two explains, the outcome's are more than chance gives.
// If each were as likely to be either's, the outcome's would be d more with probability at most
// exp(-d^2 / (2 n)), n the number of both (the sign test, by Hoeffding's bound of 1963).
bool matches_decide(const Fit& f, const Pose& rival, int num_inliers) {
  const int num_rivals = near_matches(f.matches.pairs, f.matches.pairs.num, rival, f.threshold,
                                      f.threshold, f.indices);
  int common = 0;
  for (int k = 0; k < num_rivals; ++k) common += f.out->inlier[f.indices[k]] != 0;
  const double difference = num_inliers - num_rivals, apart = num_inliers + num_rivals - 2 * common;
  return difference > 0 && difference * difference > -2 * kLogMeaningful * apart;
}

// The cost of each pose without the matches of the plane: those that are not clearly off it nor off
// the pose's epipolar line, and in front of both cameras. Each motion of a plane explains them, and
// which one their residuals favour is up to noise and the camera's errors.
TVK_NOINLINE void costs_off_plane(const Fit& f, const Mat3& H, const Pose* poses, int num_poses,
                                  int64_t* costs) {
  constexpr int kChunk = 64;
  const RayPairs& pairs = f.matches.pairs;
  const double threshold_sq = f.threshold * f.threshold,
               limit_sq = kClearlyOff * kClearlyOff * threshold_sq;
  double squares[kChunk];
  transfer_squares(pairs, 0, pairs.num, H, f.values);
  for (int p = 0; p < num_poses; ++p) {
    costs[p] = 0;
    for (int first = 0; first < pairs.num; first += kChunk) {
      const int some = std::min(kChunk, pairs.num - first);
      pose_squares(pairs, first, some, poses[p], f.threshold, squares);
      for (int k = 0; k < some; ++k) {
        if (std::max(f.values[first + k], squares[k]) <= limit_sq) continue;
        costs[p] += static_cast<int64_t>(std::min(squares[k] / threshold_sq, 1.0) * kCostOne);
      }
    }
  }
}

}  // namespace

void choose_planar_pose(Fit& f, const Rivals& rivals) {
  TwoViewOutcome& out = *f.out;
  Vec3 mean = Vec3::Zero();
  for (int k = 0; k < f.num_support; ++k)
    mean += ray_of(f.matches.pairs, 0, f.support[k]).normalized();
  PlaneFit fit;
  Pose poses[3];
  int num_poses = 0;
  const bool plane_alone = 20 * rivals.homography_inliers >= 17 * f.num_support;
  if (plane_alone) num_poses = refine_on_plane(f.refiner, rivals.H, mean, &fit);
  const bool on_plane = num_poses > 0;
  for (int k = 0; k < num_poses; ++k) poses[k] = fit.pose[k];
  if (!on_plane) {
    poses[num_poses++] = out.epipolar.pose;
    PlanarPose planar[2];
    const int count = decompose_homography(rivals.H, mean, planar);
    for (int k = 0; k < count; ++k) poses[num_poses++] = refined_pose(f.refiner, planar[k].pose);
  }
  const PoseEstimator scorer{f.matches.pairs, f.threshold, f.indices, nullptr};
  int best = 0, inliers[3];
  int64_t cost[3], off_plane[3];
  costs_off_plane(f, rivals.H, poses, num_poses, off_plane);
  for (int k = 0; k < num_poses; ++k) {
    cost[k] = scorer.full_cost(poses[k], &inliers[k]);
    const bool same = off_plane[k] == off_plane[best];
    best = (same ? cost[k] < cost[best] : off_plane[k] < off_plane[best]) ? k : best;
  }
  out.epipolar.pose = poses[best];
  out.epipolar.M = essential_from_pose(poses[best]);
  collect_support(f);
  int other = -1;
  double farthest = 1e-4;  // squared distance, about half a degree; nearer poses count as one
  for (int k = 0; k < num_poses; ++k) {
    const double turned =
        (poses[k].R - poses[best].R).squaredNorm() + (poses[k].t - poses[best].t).squaredNorm();
    // One of the other two may be the best pose again, where its refinement stopped near the same
    // flat minimum; so the most different pose is taken.
    if (k == best || turned <= farthest) continue;
    if (10 * inliers[k] >= 9 * inliers[best] || !matches_decide(f, poses[k], inliers[best])) {
      other = k;
      farthest = turned;
    }
  }
  if (other >= 0) {
    out.evidence->has_alternative = true;
    out.alternative = poses[other];
  }
  PoseUncertainty uncertainty;
  const bool certain =
      on_plane ? fit.certain[best] : uncertainty_of(f.refiner, poses[best], &uncertainty);
  if (certain) store_uncertainty(on_plane ? fit.uncertainty[best] : uncertainty, &out);
  if (other < 0) return;
  out.has_alternative_covariance =
      on_plane ? fit.certain[other] : uncertainty_of(f.refiner, poses[other], &uncertainty);
  if (out.has_alternative_covariance) {
    const PoseUncertainty& u = on_plane ? fit.uncertainty[other] : uncertainty;
    std::copy(u.covariance, u.covariance + 25, out.alternative_covariance);
  }
}

}  // namespace tv
