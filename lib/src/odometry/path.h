// The poses of the frames of a flight in the last state of the map. Tests:
// test/api/test_odometry_path.c.
#pragma once

#include "odometry/odometry.h"
#include "twoview/path.h"

namespace tv {

// Whether the numbers of frames ascend.
bool is_in_order(const tv_path_frame* frames, int32_t num_frames);

// The pose of a frame, that as well of one that became a keyframe without having been tracked;
// TV_PATH_UNKNOWN where nothing is left of its segment.
tv_path_pose path_pose(const Map& map, const tv_path_frame& frame);

// Whether the frame number idx of the path can be at `pose`: places that look alike are farther
// from the tracked frames before and after it than the camera can have flown in between.
bool can_have_flown(const Map& map, const tv_path_frame* frames, int32_t num_frames, int32_t idx,
                    const tv_path_pose& pose);

}  // namespace tv
