// One pair while its estimate is finished (finish.cc): the matches, the scratch and the outcome
// that the steps of finish.cc share, and the functions on the outcome that several steps call.
#pragma once

#include "robust/final_pose.h"
#include "robust/two_view.h"

namespace tv {

struct Fit {
  const TwoViewProblem& problem;
  const Matches& matches;  // the refiner may move their rays, and nothing else does
  double threshold;
  int32_t* indices;  // scratch
  double* values;    // scratch
  int32_t* support;  // the different inliers of the epipolar model
  int num_support;
  PoseRefiner refiner;  // of the same matches and scratch
  TwoViewOutcome* out;
};

// Sets the outcome's inliers and the support to the inliers of the outcome's epipolar model.
void collect_support(Fit& f);

// Sets the outcome's inliers to the matches whose transfer residual from H is below the threshold.
void inliers_of_transfer(Fit& f, const Mat3& H);

void store_uncertainty(const PoseUncertainty& uncertainty, TwoViewOutcome* out);

}  // namespace tv
