// How sure a calibration is, writing a camera in OpenCV's format, and the camera of an image that
// was resized or turned. camera_formats.h reads files of every format.
#pragma once

#include <string>

#include "twoview/camera.h"

namespace cli {

// How uncertain a calibration is: relative standard deviation of the focal length, and standard
// deviation of the principal point in focal lengths.
struct CalibrationSigmas {
  double focal, center;
};
// The standard deviations that are assumed for a camera file which states none, chosen on the pairs
// of the data sets (docs/decisions/0024-honest-covariance.md), and for a focal length as for 35 mm
// film.
inline constexpr CalibrationSigmas kPlainFile{0.01, 0.005}, kFilm{0.1, 0.01};

// The text of a camera file in OpenCV's format. Reading it gives the same camera, bit for bit,
// except that a Brown-Conrady lens whose coefficients are all 0 is read as a pinhole.
std::string camera_yaml(const tv_camera& camera);

// A pinhole camera from the focal length for 35 mm film (EXIF's FocalLengthIn35mmFilm), which is
// defined by an equal angle across the image diagonal, 43.27 mm on film (CIPA DCG-001). The
// principal point is the middle of the image. pixel_aspect is the width of a pixel over its height:
// the diagonal is that of the picture as it is shown.
tv_camera film_camera(double focal_35mm, int width, int height, double pixel_aspect = 1);

// Throws BadInput that names both sizes if the camera's image size is another one.
void require_size(const tv_camera& camera, const std::string& camera_name, int width, int height,
                  const std::string& image_name);

// The camera of --camera for an image of this size: itself where the size is its own. Where
// `may_scale` (--scale-camera), that of the same picture at another size; else, and for another
// shape (a crop), throws BadInput that names both sizes.
tv_camera fitted(const tv_camera& camera, const std::string& camera_name, int width, int height,
                 const std::string& image_name, bool may_scale);
// A line that says that `fitted` scaled the camera; empty where it did not.
std::string scaled_note(const tv_camera& camera, const std::string& camera_name, int width,
                        int height);

// The camera of an image that was resized to width x height. On each axis, with s = new size / old
// size: f' = s f and c' = s (c + 0.5) - 0.5.
tv_camera resized(const tv_camera& camera, int width, int height);

// The camera of an image that was turned by quarter turns counter-clockwise.
tv_camera turned(const tv_camera& camera, int quarters);

}  // namespace cli
