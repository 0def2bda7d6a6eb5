// The start of a map, or of a segment of it, from two views.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// Looks for a frame that waits for a second view and with which this frame determines a pose beyond
// doubt. True: the two are keyframes with points between them, and the frame has its pose. False:
// the frame may wait itself; *reasons says what was missing.
bool start_map(Odometry* odometry, Frame* frame, uint32_t* reasons);

// Copies a frame's keypoints, which see no point in the copy, and makes its grid.
void copy_frame(const Odometry& odometry, const Frame& from, Frame* to);

// Estimates how the camera turned between two frames from their own matches, for frames that the
// map does not reach. turn: of cam_from_cam, without a translation.
bool estimate_turn(Odometry* odometry, const Frame& frame0, const Frame& frame1, Rigid* turn);

// Removes all points of the segment, so that nothing is found in it any more.
void remove_segment_points(Odometry* odometry);

}  // namespace tv
