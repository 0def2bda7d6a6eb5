// How much of a pose a camera may explain that is not as it was given: a rolling shutter, and a
// principal point elsewhere. docs/algorithms/camera_misfit.md.
#pragma once

#include "robust/covariance.h"
#include "robust/pose_refiner.h"

namespace tv {

// Tests whether the listed matches contradict the cameras: whether their residuals fall with a turn
// of each camera while its rows were exposed one after another and, where one camera saw both
// views, with another principal point, with the prior that options.readout_turn_sigma_rad gives.
// Where they do, the pose's covariance grows by the step that the pose would take, as a deviation,
// and by what the priors leave open of it. pose: of least loss over the listed matches. Writes
// *misfit.
void add_camera_misfit(const PoseRefiner& refiner, int count, const Pose& pose,
                       const RobustLoss& loss, CameraMisfit* misfit, double covariance[25]);

}  // namespace tv
