// The pose of a frame from the points of the map that it sees.
#pragma once

#include "odometry/odometry.h"

namespace tv {

struct PoseFit {
  tv_absolute_pose estimate;
  Rigid cam_from_world;
};

// Each estimates the pose from the keypoints that have a point, and forgets the points farther than
// max_error_px from their keypoint. False: there is no pose, and the frame is as before.

// Searches the pose: one that a refinement can start from. Only the numbers of matches and inliers
// of fit->estimate are written.
bool search_pose(Odometry* odometry, int32_t max_iterations, double max_error_px, Frame* frame,
                 PoseFit* fit);

// Refines the pose fit->cam_from_world over all matches near it.
bool refine_pose(Odometry* odometry, double max_error_px, Frame* frame, PoseFit* fit);

// Searches the pose, and refines it.
bool fit_pose(Odometry* odometry, int32_t max_iterations, double max_error_px, Frame* frame,
              PoseFit* fit);

}  // namespace tv
