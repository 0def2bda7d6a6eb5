#include "files/camera_set.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "base/output.h"
#include "files/camera_doubts.h"
#include "files/camera_entries.h"
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

NamedCameras parse_camera_set(const std::string& text, const std::string& name,
                              std::vector<std::string>* left_out) {
  const YAML::Node root = parse_yaml(text, name);
  std::vector<std::string> ignored;
  NamedCameras cameras;
  for (const auto& item : root) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?";
    const std::string where = name + ": " + key;
    if (!item.second.IsMap()) throw BadInput(where + " is not a map of names and values");
    CameraEntries entries(item.second, where);
    cameras.emplace_back(key, take_camera(entries, left_out ? *left_out : ignored));
  }
  if (cameras.empty()) throw BadInput(name + ": no camera in it");
  return cameras;
}

NamedCameras load_camera_set(const std::string& path, std::vector<std::string>* left_out) {
  return parse_camera_set(read_file(path, kMaxFileBytes), path, left_out);
}

std::string left_out_note(const std::string& path, const std::vector<std::string>& left_out) {
  constexpr size_t most = 8;
  std::string names;
  for (size_t i = 0; i < std::min(most, left_out.size()); ++i)
    names += (i ? ", " : "") + left_out[i];
  if (names.empty()) return "";
  return "camera " + path + ": left out: " + names + (left_out.size() > most ? ", ..." : "");
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
  if (!K) return camera;
  const tv_camera entry = camera;
  const std::string where = "image " + image_name + ": K of the list's line";
  camera.fx = (*K)[0];
  camera.cx = (*K)[2];
  camera.fy = (*K)[4];
  camera.cy = (*K)[5];
  refuse_exchanged(camera, where);
  if (cameras.empty())
    refuse_other_scale(camera, where);
  else
    refuse_other_intrinsics(camera, entry, where);
  return camera;
}

}  // namespace cli
