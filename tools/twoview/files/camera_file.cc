#include "files/camera_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/output.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 20;

void read_matrix(const YAML::Node& root, const std::string& file, tv_camera& camera) {
  const std::vector<double> K = numbers_at(root, "camera_matrix", file);
  if (K.size() != 9)
    throw BadInput(file + ": camera_matrix has " + std::to_string(K.size()) + " numbers, not 9");
  const YAML::Node node = root["camera_matrix"];
  if (node.IsMap()) {
    for (const char* side : {"rows", "cols"})
      if (node[side] && number_at(node, side, file + ": camera_matrix") != 3)
        throw BadInput(file + ": camera_matrix: " + side + " is not 3");
  }
  require_focal(K[0], "fx (camera_matrix[0])", file);
  require_focal(K[4], "fy (camera_matrix[4])", file);
  if (K[1] != 0) throw BadInput(file + ": camera_matrix[1] is not 0; skew is not supported");
  if (K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw BadInput(file + ": camera_matrix is not [fx 0 cx; 0 fy cy; 0 0 1]");
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
  const YAML::Node node = root["distortion_coefficients"];
  if (!node || node.IsNull() || model == "none") {
    if (model.empty() || model == "none") return;
    throw BadInput(file + ": distortion_coefficients is missing");
  }
  const std::vector<double> k = numbers_at(root, "distortion_coefficients", file);
  const bool equidistant = model == "equidistant";
  const bool fits =
      equidistant ? k.size() == 4 : k.empty() || k.size() == 4 || k.size() == 5 || k.size() == 8;
  if (!fits)
    throw BadInput(file + ": distortion_coefficients has " + std::to_string(k.size()) +
                   " numbers, not " + (equidistant ? "4" : "4, 5 or 8"));
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

tv_camera parse_camera(const std::string& text, const std::string& name) {
  const YAML::Node root = parse_yaml(text, name);
  tv_camera camera{};
  camera.width = side_at(root, "image_width", name);
  camera.height = side_at(root, "image_height", name);
  read_matrix(root, name, camera);
  read_distortion(root, name, camera);
  check(tv_camera_check(&camera), name);
  return camera;
}

tv_camera load_camera(const std::string& path) {
  return parse_camera(read_file(path, kMaxFileBytes), path);
}

CalibrationSigmas load_sigmas(const std::string& path) {
  const YAML::Node root = parse_yaml(read_file(path, kMaxFileBytes), path);
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
  throw BadInput("image " + image_name + " is " + size_text(width, height) + ", but camera " +
                 camera_name + " is for " + size_text(camera.width, camera.height) +
                 ": give the picture as the camera took it (--resize L makes both smaller), or a "
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
