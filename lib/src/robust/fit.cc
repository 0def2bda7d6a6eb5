#include "robust/fit.h"

#include <algorithm>
#include <cmath>

namespace tv {

void collect_support(Fit& f) {
  const EpipolarModel& epipolar = f.out->epipolar;
  f.num_support = 0;
  const RayPairs& pairs = f.matches.pairs;
  if (epipolar.has_pose) {
    pose_squares(pairs, 0, pairs.num, epipolar.pose, f.threshold, f.values);
  } else {
    sampson_squares(pairs, 0, pairs.num, epipolar.M, f.values);
  }
  for (int i = 0; i < pairs.num; ++i) {
    const bool inlier = f.values[i] <= f.threshold * f.threshold;
    f.out->inlier[i] = inlier;
    if (inlier && i < f.pairs.num) f.support[f.num_support++] = i;
  }
}

void store_uncertainty(const PoseUncertainty& uncertainty, TwoViewOutcome* out) {
  out->has_covariance = true;
  out->noise_px = uncertainty.noise_px;
  std::copy(uncertainty.covariance, uncertainty.covariance + 25, out->covariance);
}

void inliers_of_transfer(Fit& f, const Mat3& H) {
  const double limit = kTransferThresholdScale * f.threshold;
  transfer_squares(f.matches.pairs, 0, f.matches.pairs.num, H, f.values);
  for (int i = 0; i < f.matches.pairs.num; ++i) f.out->inlier[i] = f.values[i] <= limit * limit;
}

}  // namespace tv
