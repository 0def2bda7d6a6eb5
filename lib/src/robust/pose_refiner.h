// The matches and the scratch that the final refinement of a pose works on (final_pose.h), and what
// is free beside the pose.
#pragma once

#include "robust/gravity.h"
#include "robust/principal_point.h"

namespace tv {

// What the refinement works on. The functions below do not change the matches; only
// place_principal_point moves their rays.
struct PoseRefiner {
  const TwoViewProblem& problem;
  Matches& matches;
  double threshold_px;
  GravityPrior gravity;
  PrincipalPoint principal_point;  // the one that the matches' rays were computed with
  int32_t* indices;                // scratch, one entry a match
  double* values;                  // scratch, one entry a match
  bool focal_is_free;              // whether the focal length of the rays was refined with the pose
};

}  // namespace tv
