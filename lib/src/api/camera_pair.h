// The checks of two cameras, with their motion or alone, which several entry points share.
#pragma once

#include "twoview/camera.h"

namespace tv {

// Checks the cameras of a pair, and that its motion is finite with a rotation and a t that is not
// zero. The status is the one that the entry point must return.
tv_status check_pair(const tv_camera_pair& pair);

// Checks two cameras that may both be null; one alone is TV_ERR_ARGUMENT.
tv_status check_optional_cameras(const tv_camera* camera0, const tv_camera* camera1);

}  // namespace tv
