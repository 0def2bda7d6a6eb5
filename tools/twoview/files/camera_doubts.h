// Refuses intrinsics that do not fit their image, but would fit it if their values were in another
// order, or fit an image of another size.
#pragma once

#include <string>

#include "twoview/camera.h"

namespace cli {

// Throws BadInput where the camera's focal lengths and principal point fit its image in another
// order and not as they are: cx and cy exchanged, or a focal length with a centre. `where` is what
// the message begins with. python/twoview/camera.py has the same rule.
void refuse_exchanged(const tv_camera& camera, const std::string& where);

// For intrinsics that were read without an image size and were given that of the image: throws
// BadInput where their principal point is the centre of an image that is larger, or smaller, on
// both axes.
void refuse_other_scale(const tv_camera& camera, const std::string& where);

// Throws BadInput where intrinsics for an image, as those on the line of a list of pairs, are not
// those of the camera file's entry for images of the same size.
void refuse_other_intrinsics(const tv_camera& camera, const tv_camera& entry,
                             const std::string& where);

}  // namespace cli
