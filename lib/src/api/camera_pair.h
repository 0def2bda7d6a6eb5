// The check of two cameras and their motion, which several entry points share.
#pragma once

#include "twoview/camera.h"

namespace tv {

// Checks the cameras of a pair, and that its motion is finite with a rotation and a t that is not
// zero. The status is the one that the entry point must return.
tv_status check_pair(const tv_camera_pair& pair);

}  // namespace tv
