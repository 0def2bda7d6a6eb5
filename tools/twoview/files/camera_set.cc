#include "files/camera_set.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "base/output.h"
#include "files/camera_file.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 20;

bool is_same(const tv_camera& a, const tv_camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.fx == b.fx &&
         a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         std::equal(std::begin(a.k), std::end(a.k), std::begin(b.k));
}

}  // namespace

NamedCameras camera_set_from_yaml(const YAML::Node& root, const std::string& name) {
  NamedCameras cameras;
  for (const auto& item : root) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?";
    const std::string where = name + ": " + key;
    if (!item.second.IsMap()) throw BadInput(where + " is not a map of names and values");
    tv_camera camera{};
    camera.width = side_at(item.second, "image_width", where);
    camera.height = side_at(item.second, "image_height", where);
    camera.fx = number_at(item.second, "fx", where);
    camera.fy = number_at(item.second, "fy", where);
    camera.cx = number_at(item.second, "cx", where);
    camera.cy = number_at(item.second, "cy", where);
    require_focal(camera.fx, "fx", where);
    require_focal(camera.fy, "fy", where);
    const char* const entries[] = {"k1", "k2", "p1", "p2", "k3"};
    for (int i = 0; i < 5; ++i) {
      if (item.second[entries[i]]) camera.k[i] = number_at(item.second, entries[i], where);
      if (camera.k[i] != 0) camera.model = TV_CAMERA_BROWN_CONRADY;
    }
    check(tv_camera_check(&camera), where);
    cameras.emplace_back(key, camera);
  }
  if (cameras.empty()) throw BadInput(name + ": no camera in it");
  return cameras;
}

NamedCameras parse_camera_set(const std::string& text, const std::string& name) {
  return camera_set_from_yaml(parse_yaml(text, name), name);
}

NamedCameras load_camera_set(const std::string& path) {
  return parse_camera_set(read_file(path, kMaxFileBytes), path);
}

const tv_camera* choose_camera(const NamedCameras& cameras, const std::string& image_name,
                               const double K[9]) {
  if (cameras.size() == 1) return &cameras[0].second;
  const std::string file = image_name.substr(image_name.find_last_of('/') + 1);
  const tv_camera* best = nullptr;
  size_t best_length = 0;
  for (const auto& [name, camera] : cameras) {
    if (name.size() > best_length && file.compare(0, name.size(), name) == 0) {
      best = &camera;
      best_length = name.size();
    }
  }
  if (best || !K) return best;
  const auto is_near = [](double a, double b) { return std::abs(a - b) <= 1e-6 * std::abs(b); };
  std::string best_name;
  for (const auto& [name, camera] : cameras) {
    if (!is_near(K[0], camera.fx) || !is_near(K[2], camera.cx)) continue;
    if (best && !is_same(*best, camera)) {
      throw BadInput("image " + image_name + ": its K fits the cameras " + best_name + " and " +
                     name + ", which differ");
    }
    if (!best) {
      best = &camera;
      best_name = name;
    }
  }
  return best;
}

tv_camera camera_of_image(const NamedCameras& cameras, const std::string& image_name, int width,
                          int height, const std::array<double, 9>* K) {
  tv_camera camera{};
  if (!cameras.empty()) {
    const tv_camera* const entry = choose_camera(cameras, image_name, K ? K->data() : nullptr);
    if (!entry) throw BadInput("no entry of cameras.yaml fits image " + image_name);
    require_size(*entry, "in cameras.yaml", width, height, image_name);
    camera = *entry;
  } else if (!K) {
    throw BadInput("no camera for image " + image_name);
  }
  camera.width = width;
  camera.height = height;
  if (K) {
    camera.fx = (*K)[0];
    camera.cx = (*K)[2];
    camera.fy = (*K)[4];
    camera.cy = (*K)[5];
  }
  return camera;
}

}  // namespace cli
