// Intrinsics that are those of the image only in another order.
#pragma once

#include <string>

#include "twoview/camera.h"

namespace cli {

// Throws BadInput where the camera's focal lengths and principal point fit its image in another
// order and not as they are: cx and cy exchanged, or a focal length with a centre. `where` is what
// the message begins with. python/twoview/camera.py has the same rule.
void refuse_exchanged(const tv_camera& camera, const std::string& where);

}  // namespace cli
