// The pose of a frame from the points of the map that it sees.
#pragma once

#include "odometry/odometry.h"

namespace tv {

struct PoseFit {
  tv_absolute_pose estimate;
  Rigid cam_from_world;
};

// Estimates the pose, and forgets the points that do not fit it. False: there is no pose, and the
// frame is as before.
bool fit_pose(Odometry* odometry, int32_t max_iterations, double max_error_px, Frame* frame,
              PoseFit* fit);

}  // namespace tv
