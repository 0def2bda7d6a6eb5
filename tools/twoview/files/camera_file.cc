#include "files/camera_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "base/error.h"

namespace cli {
namespace {

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

// Whether a picture of this size may be the camera's picture made smaller or larger: a scale gives
// both sides to within a pixel, to which a side is rounded.
bool has_shape(const tv_camera& camera, int width, int height) {
  const double sx = static_cast<double>(width) / camera.width;
  const double sy = static_cast<double>(height) / camera.height;
  return std::abs(height - sx * camera.height) < 1 || std::abs(width - sy * camera.width) < 1;
}

[[noreturn]] void refuse_size(const tv_camera& camera, const std::string& camera_name, int width,
                              int height, const std::string& image_name, const char* more) {
  const std::string found = " is " + size_text(width, height) + ", but camera " + camera_name +
                            " is for " + size_text(camera.width, camera.height) + ": ";
  if (image_name.empty())
    throw BadInput("the recording" + found +
                   "calibrate with pictures of the same video, or give a camera file for this "
                   "size" +
                   more);
  throw BadInput("image " + image_name + found +
                 "give the picture as the camera took it (--resize L makes both smaller), or a "
                 "camera file for this size" +
                 more);
}

}  // namespace

tv_camera film_camera(double focal_35mm, int width, int height, double pixel_aspect) {
  tv_camera camera{};
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = width;
  camera.height = height;
  camera.fy = focal_35mm * std::hypot(width * pixel_aspect, height) / std::hypot(36.0, 24.0);
  camera.fx = camera.fy / pixel_aspect;
  camera.cx = (width - 1) / 2.0;
  camera.cy = (height - 1) / 2.0;
  return camera;
}

std::string camera_yaml(const tv_camera& camera) {
  const auto matrix = [](const char* name, const char* shape, const std::vector<double>& values) {
    std::string text = name + std::string(": !!opencv-matrix\n") + shape + "   dt: d\n   data: [ ";
    for (size_t i = 0; i < values.size(); ++i) {
      char digits[32];
      const auto end = std::to_chars(digits, digits + sizeof digits, values[i]).ptr;
      text += (i ? ", " : "") + std::string(digits, end);
    }
    return text + " ]\n";
  };
  const bool is_fisheye = camera.model == TV_CAMERA_KANNALA_BRANDT;
  const bool is_rational = std::any_of(camera.k + 5, camera.k + 8, [](double k) { return k != 0; });
  const int count = is_fisheye ? 4 : is_rational ? 8 : 5;
  std::vector<double> k(camera.k, camera.k + count);
  if (camera.model == TV_CAMERA_PINHOLE) k.assign(5, 0);
  return "%YAML:1.0\n---\nimage_width: " + std::to_string(camera.width) +
         "\nimage_height: " + std::to_string(camera.height) + "\n" +
         matrix("camera_matrix", "   rows: 3\n   cols: 3\n",
                {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1}) +
         (is_fisheye ? "distortion_model: equidistant\n" : "") +
         matrix("distortion_coefficients",
                ("   rows: 1\n   cols: " + std::to_string(k.size()) + "\n").c_str(), k);
}

void require_size(const tv_camera& camera, const std::string& camera_name, int width, int height,
                  const std::string& image_name) {
  if (camera.width == width && camera.height == height) return;
  refuse_size(camera, camera_name, width, height, image_name, "");
}

tv_camera fitted(const tv_camera& camera, const std::string& camera_name, int width, int height,
                 const std::string& image_name, bool may_scale) {
  if (camera.width == width && camera.height == height) return camera;
  if (!has_shape(camera, width, height))
    refuse_size(
        camera, camera_name, width, height, image_name,
        may_scale ? "; its shape is another one (a crop?), so --scale-camera does not help" : "");
  if (!may_scale)
    refuse_size(camera, camera_name, width, height, image_name,
                "; --scale-camera where the whole picture was made smaller or larger");
  return resized(camera, width, height);
}

std::string scaled_note(const tv_camera& camera, const std::string& camera_name, int width,
                        int height) {
  if (camera.width == width && camera.height == height) return "";
  return "camera " + camera_name + " is scaled from " + size_text(camera.width, camera.height) +
         " to " + size_text(width, height) + " (--scale-camera)";
}

tv_camera resized(const tv_camera& camera, int width, int height) {
  tv_camera result = camera;
  const double sx = static_cast<double>(width) / camera.width;
  const double sy = static_cast<double>(height) / camera.height;
  result.fx = sx * camera.fx;
  result.fy = sy * camera.fy;
  result.cx = sx * (camera.cx + 0.5) - 0.5;
  result.cy = sy * (camera.cy + 0.5) - 0.5;
  result.width = width;
  result.height = height;
  return result;
}

tv_camera turned(const tv_camera& camera, int quarters) {
  tv_camera result = camera;
  for (int i = 0; i < (quarters & 3); ++i) {
    // A pixel (x, y) moves to (y, width - 1 - x); a camera-frame point (X, Y) moves to (Y, -X).
    const tv_camera before = result;
    result.width = before.height;
    result.height = before.width;
    result.fx = before.fy;
    result.fy = before.fx;
    result.cx = before.cy;
    result.cy = before.width - 1 - before.cx;
    // The tangential coefficients p1 and p2, k[2] and k[3], rotate with the image.
    if (result.model == TV_CAMERA_BROWN_CONRADY) {
      result.k[2] = -before.k[3];
      result.k[3] = before.k[2];
    }
  }
  return result;
}

}  // namespace cli
