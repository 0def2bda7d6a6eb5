#include "robust/fit.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"

#include <algorithm>
#include <cmath>

namespace tv {

void collect_support(Fit& f) {
  const EpipolarModel& epipolar = f.out->epipolar;
  f.num_support = 0;
  const Matches& matches = f.matches;
  if (epipolar.has_pose) {
    pose_squares(matches.pairs, 0, matches.num_all, epipolar.pose, f.threshold, f.values);
  } else {
    sampson_squares(matches.pairs, 0, matches.num_all, epipolar.M, f.values);
  }
  for (int i = 0; i < matches.num_all; ++i) {
    const bool inlier = f.values[i] <= f.threshold * f.threshold;
    f.out->inlier[i] = inlier;
    if (inlier && i < matches.num_unique()) f.support[f.num_support++] = i;
  }
}

void store_uncertainty(const PoseUncertainty& uncertainty, TwoViewOutcome* out) {
  out->has_covariance = true;
  out->evidence->noise_px = uncertainty.noise_px;
  out->focal_sigma = uncertainty.focal_sigma;
  out->evidence->sigma_rad = uncertainty.sigma_rad;
  out->evidence->direction_sigma_rad = uncertainty.direction_sigma_rad;
  out->evidence->misfit = uncertainty.misfit;
  std::copy(uncertainty.covariance, uncertainty.covariance + 25, out->covariance);
}

void inliers_of_transfer(Fit& f, const Mat3& H) {
  const double limit = kTransferThresholdScale * f.threshold;
  transfer_squares(f.matches.pairs, 0, f.matches.num_all, H, f.values);
  for (int i = 0; i < f.matches.num_all; ++i) f.out->inlier[i] = f.values[i] <= limit * limit;
}

}  // namespace tv
