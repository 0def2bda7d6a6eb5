// The pose of three rays and gravity, for the robust loop (loop.h).
#pragma once

#include "geometry/relpose_upright_3pt.h"
#include "robust/estimators.h"
#include "robust/gravity.h"

namespace tv {

// Scores as PoseEstimator does. A sampled pose has the error of the measured gravity. Local
// optimisation therefore refines all five parameters, with gravity as a prior, and with a threshold
// that begins at width_first thresholds and is halved down to one.
struct UprightEstimator : PoseEstimator {
  static constexpr int kSampleSize = 3;
  static constexpr int kMaxModels = kMaxRelposeUpright3pt;
  static constexpr int kBatch = 1;
  const GravityPrior& gravity;
  Mat3 level0, level1;  // level_from_camera of each view's gravity.down
  double width_first;   // the first threshold of local optimisation, in units of threshold_px
  int generate_models(const int32_t* sample, Pose* models) const;
  void refine_model(Pose* model) const;
};

UprightEstimator make_upright_estimator(const RayPairs& pairs, double threshold_px,
                                        int32_t* indices, const GravityPrior& gravity);

}  // namespace tv
