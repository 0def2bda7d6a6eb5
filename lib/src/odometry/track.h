// The steps of a frame: extraction, tracking, keyframes, loss and relocation.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// The frame has been checked. Writes all of *state but for struct_size.
void track_frame(Odometry* odometry, const tv_odometry_frame& input, tv_odometry_state* state);

// A keyframe is adjusted when the next frame comes, before that is tracked, so that no frame takes
// the time of both. `frame`: the one that became the keyframe. False: none waits.
bool finish_keyframe(Odometry* odometry, Frame* frame);

// Does the work that was left for the frames to come.
void finish_map(Odometry* odometry);

// mask: null, or of the image's size.
void locate_frame(Odometry* odometry, const tv_image& image, const tv_image* mask, int32_t near_id,
                  tv_odometry_state* state);

}  // namespace tv
