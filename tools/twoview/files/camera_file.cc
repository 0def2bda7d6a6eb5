#include "files/camera_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <vector>

#include "base/error.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

constexpr size_t kModelled = 8;  // coefficients k1 k2 p1 p2 k3 k4 k5 k6 that tv_camera has

// The names of an entry in the formats that this reader knows: OpenCV's and ROS's files, ROS 1's
// message (K, D) and ROS 2's (k, d).
constexpr std::initializer_list<const char*> kMatrixNames = {"camera_matrix", "K", "k"};
constexpr std::initializer_list<const char*> kDistortionNames = {"distortion_coefficients", "D",
                                                                 "d"};
constexpr std::initializer_list<const char*> kWidthNames = {"image_width", "width"};
constexpr std::initializer_list<const char*> kHeightNames = {"image_height", "height"};

// The first of the names that the file has; without any of them the first, which messages name.
std::string name_in(const YAML::Node& root, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (root[name] && !root[name].IsNull()) return name;
  return *names.begin();
}

void read_matrix(const YAML::Node& root, const std::string& file, tv_camera& camera) {
  const std::string entry = name_in(root, kMatrixNames);
  const std::vector<double> K = numbers_at(root, entry, file);
  if (K.size() != 9)
    throw BadInput(file + ": " + entry + " has " + std::to_string(K.size()) + " numbers, not 9");
  const YAML::Node node = root[entry];
  if (node.IsMap()) {
    for (const char* side : {"rows", "cols"})
      if (node[side] && number_at(node, side, file + ": " + entry) != 3)
        throw BadInput(file + ": " + entry + ": " + side + " is not 3");
  }
  require_focal(K[0], "fx (" + entry + "[0])", file);
  require_focal(K[4], "fy (" + entry + "[4])", file);
  if (K[1] != 0) throw BadInput(file + ": " + entry + "[1] is not 0; skew is not supported");
  if (K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw BadInput(file + ": " + entry + " is not [fx 0 cx; 0 fy cy; 0 0 1]");
  camera.fx = K[0];
  camera.cx = K[2];
  camera.fy = K[4];
  camera.cy = K[5];
}

void read_distortion(const YAML::Node& root, const std::string& file, tv_camera& camera) {
  const YAML::Node model_node = root["distortion_model"];
  if (model_node && !model_node.IsScalar() && !model_node.IsNull())
    throw BadInput(file + ": distortion_model is not a word");
  std::string model = model_node && model_node.IsScalar() ? model_node.Scalar() : "";
  const std::string known[] = {"", "plumb_bob", "rational_polynomial", "equidistant", "none"};
  if (std::find(std::begin(known), std::end(known), model) == std::end(known))
    throw BadInput(file + ": distortion_model '" + model +
                   "' is not one of plumb_bob, rational_polynomial, equidistant");
  const std::string entry = name_in(root, kDistortionNames);
  const YAML::Node node = root[entry];
  if (!node || node.IsNull() || model == "none") {
    if (model.empty() || model == "none") return;
    throw BadInput(file + ": " + entry + " is missing");
  }
  std::vector<double> k = numbers_at(root, entry, file);
  const bool equidistant = model == "equidistant";
  constexpr size_t counts[] = {0, 4, 5, 8, 12, 14};  // OpenCV's, of calibrateCamera
  const bool fits =
      equidistant ? k.size() == 4
                  : std::find(std::begin(counts), std::end(counts), k.size()) != std::end(counts);
  if (!fits)
    throw BadInput(file + ": " + entry + " has " + std::to_string(k.size()) + " numbers, not " +
                   (equidistant ? "4" : "4, 5, 8, 12 or 14"));
  for (size_t i = kModelled; i < k.size(); ++i) {
    if (k[i] == 0) continue;
    throw BadInput(file + ": " + entry + " has " + std::to_string(k.size()) +
                   " numbers, of which " + entry + "[" + std::to_string(i) +
                   "] is not 0: the lens models here end with " +
                   "the first 8 (no thin prism, no tilted sensor); calibrate with 5 or 8");
  }
  k.resize(std::min(k.size(), kModelled));
  std::copy(k.begin(), k.end(), camera.k);
  // An equidistant lens is no pinhole, even if its four coefficients are zero.
  const bool straight = std::all_of(k.begin(), k.end(), [](double v) { return v == 0; });
  camera.model = equidistant ? TV_CAMERA_KANNALA_BRANDT
                 : straight  ? TV_CAMERA_PINHOLE
                             : TV_CAMERA_BROWN_CONRADY;
}

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

}  // namespace

bool has_camera_matrix(const YAML::Node& root) {
  return std::any_of(kMatrixNames.begin(), kMatrixNames.end(),
                     [&](const char* name) { return static_cast<bool>(root[name]); });
}

tv_camera camera_from_yaml(const YAML::Node& root, const std::string& name) {
  tv_camera camera{};
  camera.width = side_at(root, name_in(root, kWidthNames), name);
  camera.height = side_at(root, name_in(root, kHeightNames), name);
  read_matrix(root, name, camera);
  read_distortion(root, name, camera);
  check(tv_camera_check(&camera), name);
  return camera;
}

tv_camera parse_camera(const std::string& text, const std::string& name) {
  return camera_from_yaml(parse_yaml(text, name), name);
}

CalibrationSigmas sigmas_from_yaml(const YAML::Node& root, const std::string& path) {
  CalibrationSigmas sigmas = kPlainFile;
  for (auto [name, value] :
       {std::pair{"focal_sigma", &sigmas.focal}, std::pair{"center_sigma", &sigmas.center}}) {
    if (!root[name]) continue;
    *value = number_at(root, name, path);
    if (!(*value >= 0 && *value <= 0.5)) throw BadInput(path + ": " + name + " is not in [0, 0.5]");
  }
  return sigmas;
}

tv_camera film_camera(double focal_35mm, int width, int height) {
  tv_camera camera{};
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal_35mm * std::hypot(width, height) / std::hypot(36.0, 24.0);
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
  const std::string found = " is " + size_text(width, height) + ", but camera " + camera_name +
                            " is for " + size_text(camera.width, camera.height) + ": ";
  if (image_name.empty())
    throw BadInput(
        "the recording" + found +
        "calibrate with pictures of the same video, or give a camera file for this size");
  throw BadInput("image " + image_name + found +
                 "give the picture as the camera took it (--resize L makes both smaller), or a "
                 "camera file for this size");
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
