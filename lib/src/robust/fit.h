// One pair while its estimate is finished (finish.cc): the matches, the scratch and the outcome
// that the steps of finish.cc share, and the functions on the outcome that several steps call.
#pragma once

#include "robust/final_pose.h"
#include "robust/two_view.h"

namespace tv {

struct Fit {
  TwoViewProblem& problem;  // only place_focal_length changes it, and only its cameras
  const Matches& matches;   // only the refiner may change the matches, and only their rays
  double threshold;
  int32_t* indices;  // scratch, one entry a match
  double* values;    // scratch, one entry a match
  int32_t* support;  // indices of the different inliers of the epipolar model
  int num_support;
  PoseRefiner refiner;  // works on these matches and this scratch
  TwoViewOutcome* out;
};

// Sets the outcome's inliers and the support to the inliers of the outcome's epipolar model.
void collect_support(Fit& f);

// Sets the outcome's inliers to the matches whose transfer residual from H is below the threshold.
void inliers_of_transfer(Fit& f, const Mat3& H);

void store_uncertainty(const PoseUncertainty& uncertainty, TwoViewOutcome* out);

}  // namespace tv
