// Camera files, in OpenCV's YAML or ROS camera_info, and what resizing and turning an image does to
// its camera.
#pragma once

#include <string>

#include "twoview/camera.h"

namespace cli {

// Reads either format. Throws BadInput that names the file and the entry that is missing, zero, not
// finite, or of the wrong length.
tv_camera load_camera(const std::string& path);

// The same from the file's text; `name` is for the messages.
tv_camera parse_camera(const std::string& text, const std::string& name);

// The text of a file in OpenCV's format that reads back to the same camera, bit for bit.
std::string camera_yaml(const tv_camera& camera);

// A pinhole whose focal length is that of 35 mm film (EXIF's FocalLengthIn35mmFilm: the same angle
// across the diagonal, 43.27 mm there, by CIPA DCG-001), with the principal point in the image's
// middle.
tv_camera film_camera(double focal_35mm, int width, int height);

// Throws BadInput with both sizes unless the camera is for images of this size.
void require_size(const tv_camera& camera, const std::string& camera_name, int width, int height,
                  const std::string& image_name);

// The camera of an image that was resized from the camera's size to width x height: per axis with
// s = new size / old size, f' = s f and c' = s (c + 0.5) - 0.5.
tv_camera resized(const tv_camera& camera, int width, int height);

// The camera of an image that was turned by quarter turns counter-clockwise.
tv_camera turned(const tv_camera& camera, int quarters);

}  // namespace cli
