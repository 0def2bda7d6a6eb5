// The steps of a frame: extraction, tracking, keyframes, loss and relocation.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// The frame has been checked. Writes all of *state but for struct_size.
void track_frame(Odometry* odometry, const tv_odometry_frame& input, tv_odometry_state* state);

// mask: null, or of the image's size.
void locate_frame(Odometry* odometry, const tv_image& image, const tv_image* mask, int32_t near_id,
                  tv_odometry_state* state);

}  // namespace tv
