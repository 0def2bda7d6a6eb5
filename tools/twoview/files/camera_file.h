// Reading and writing a camera in OpenCV's and ROS's format, and the camera of an image that was
// resized or turned. camera_formats.h reads files of every format.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

#include "twoview/camera.h"

namespace cli {

// How sure a calibration is: relative standard deviation of the focal length, and standard
// deviation of the principal point in focal lengths.
struct CalibrationSigmas {
  double focal, center;
};
// Of a camera file that does not say how sure it is, chosen on the data sets' pairs
// (docs/decisions/0024-honest-covariance.md), and of a focal length as for 35 mm film.
inline constexpr CalibrationSigmas kPlainFile{0.01, 0.005}, kFilm{0.1, 0.01};

// Reads the entries focal_sigma and center_sigma of a camera file, each in [0, 0.5]; kPlainFile's
// where one is missing. Throws BadInput that names the entry.
CalibrationSigmas sigmas_from_yaml(const YAML::Node& root, const std::string& path);

// Whether the map has a 3 x 3 camera matrix under one of its names: camera_matrix, K or k.
bool has_camera_matrix(const YAML::Node& root);

// Reads a camera in OpenCV's or ROS's format: the size (image_width or width, and so on), the
// camera matrix, and the lens under distortion_coefficients, D or d. Of OpenCV's 12 or 14
// coefficients those behind the eighth must be 0. Throws BadInput that names the file and the entry
// that is missing, zero, not finite, of the wrong length, or of no lens that tv_camera has.
tv_camera camera_from_yaml(const YAML::Node& root, const std::string& name);

// Parses the text of such a file; `name` is used in messages.
tv_camera parse_camera(const std::string& text, const std::string& name);

// The text of a camera file in OpenCV's format. Reading it gives the same camera, bit for bit,
// except that a Brown-Conrady lens whose coefficients are all 0 is read as a pinhole.
std::string camera_yaml(const tv_camera& camera);

// A pinhole camera from the focal length for 35 mm film (EXIF's FocalLengthIn35mmFilm), which is
// defined by an equal angle across the image diagonal, 43.27 mm on film (CIPA DCG-001). The
// principal point is the middle of the image.
tv_camera film_camera(double focal_35mm, int width, int height);

// Throws BadInput that names both sizes if the camera's image size is another one.
void require_size(const tv_camera& camera, const std::string& camera_name, int width, int height,
                  const std::string& image_name);

// The camera of an image that was resized to width x height. On each axis, with s = new size / old
// size: f' = s f and c' = s (c + 0.5) - 0.5.
tv_camera resized(const tv_camera& camera, int width, int height);

// The camera of an image that was turned by quarter turns counter-clockwise.
tv_camera turned(const tv_camera& camera, int quarters);

}  // namespace cli
