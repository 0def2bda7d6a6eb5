#include "pair/truth.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "base/output.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 20;

template <size_t N>
std::array<double, N> fixed(const YAML::Node& root, const std::string& entry,
                            const std::string& file) {
  const std::vector<double> values = numbers_at(root, entry, file);
  if (values.size() != N)
    throw BadInput(file + ": " + entry + " has " + std::to_string(values.size()) +
                   " numbers, not " + std::to_string(N));
  std::array<double, N> result{};
  std::copy(values.begin(), values.end(), result.begin());
  return result;
}

KnownPose read_pose(const YAML::Node& root, const std::string& path) {
  KnownPose pose;
  pose.R = made_rotation(fixed<9>(root, "R", path), path + ": R");
  pose.t = fixed<3>(root, "t", path);
  if (norm(pose.t) == 0) throw BadInput(path + ": t is 0");
  return pose;
}

// Reads the factor of the focal length, which `reconstruct` writes into result.json where it was
// refined; it is optional in other files.
void read_focal_scale(const YAML::Node& root, const std::string& path, KnownPose& pose) {
  const YAML::Node focal = root["focal_length"];
  if (!focal || focal.IsNull()) return;
  if (!focal.IsMap()) throw BadInput(path + ": focal_length is not a map with scale");
  if (!focal["scale"] || focal["scale"].IsNull()) return;
  pose.focal_scale = number_at(focal, "scale", path + ": focal_length");
  if (pose.focal_scale == 0) pose.focal_scale = 1;
  if (!(pose.focal_scale > 0)) throw BadInput(path + ": focal_length: scale is not above 0");
}

// Reads the shift of the principal point, which `reconstruct` writes into result.json; it is
// optional in other files.
void read_shift(const YAML::Node& root, const std::string& path, KnownPose& pose) {
  const YAML::Node shift = root["principal_point_shift_px"];
  if (!shift || shift.IsNull()) return;
  const auto pixels = fixed<2>(root, "principal_point_shift_px", path);
  std::copy(pixels.begin(), pixels.end(), pose.principal_point_shift_px);
  if (!root["image_size0"]) return;
  pose.image_width = fixed<2>(root, "image_size0", path)[0];
  if (!(pose.image_width > 0)) throw BadInput(path + ": image_size0 is not above 0");
}

void read_sizes(const YAML::Node& root, const std::string& path, KnownPose& pose) {
  for (size_t i = 0; i < 2; ++i) {
    const std::string entry = "image_size" + std::to_string(i);
    if (!root[entry] || root[entry].IsNull()) continue;
    const auto size = fixed<2>(root, entry, path);
    for (size_t k = 0; k < 2; ++k) {
      if (!(size[k] >= 1 && size[k] <= 1e6))
        throw BadInput(path + ": " + entry + " is not a size in pixels");
      pose.sizes[i][k] = static_cast<int>(size[k]);
    }
  }
}

// The error of a depth, given in baselines, in per cent of that of the nearest pixel of the depth
// map; NaN where it is unknown.
double depth_error_percent(const Truth& truth, const Picture& picture0, double column, double row,
                           double depth) {
  const long x = std::lround((column + 0.5) / picture0.scale_x() - 0.5);
  const long y = std::lround((row + 0.5) / picture0.scale_y() - 0.5);
  if (x < 0 || y < 0 || x >= truth.depth0.cols || y >= truth.depth0.rows) return NAN;
  const double known = truth.depth0.at<float>(static_cast<int>(y), static_cast<int>(x));
  if (!std::isfinite(known) || known <= 0) return NAN;
  return 100 * std::abs(depth * truth.baseline - known) / known;
}

// The depth errors of the cloud's points in per cent.
std::vector<double> depth_errors_percent(const Truth& truth, const Picture& picture0,
                                         const tv_reconstruction& reconstruction) {
  std::vector<double> errors;
  if (truth.depth0.empty()) return errors;
  for (int32_t i = 0; i < reconstruction.num_matches; ++i) {
    const tv_point& point = reconstruction.points[i];
    if (point.status != TV_POINT_OK) continue;
    const tv_keypoint& keypoint = reconstruction.keypoints[0][reconstruction.matches[i].idx0];
    const double error =
        depth_error_percent(truth, picture0, keypoint.x, keypoint.y, point.position[2]);
    if (std::isfinite(error)) errors.push_back(error);
  }
  return errors;
}

}  // namespace

tv_camera KnownPose::corrected(const tv_camera& camera) const {
  tv_camera corrected = camera;
  const double scale = image_width > 0 ? camera.width / image_width : 1;
  corrected.fx *= focal_scale;
  corrected.fy *= focal_scale;
  corrected.cx += scale * principal_point_shift_px[0];
  corrected.cy += scale * principal_point_shift_px[1];
  return corrected;
}

KnownPose load_pose(const std::string& path) {
  const YAML::Node root = parse_yaml(read_file(path, kMaxFileBytes), path);
  KnownPose pose = read_pose(root, path);
  read_focal_scale(root, path, pose);
  read_shift(root, path, pose);
  read_sizes(root, path, pose);
  return pose;
}

Truth load_truth(const std::string& path) {
  const YAML::Node root = parse_yaml(read_file(path, kMaxFileBytes), path);
  Truth truth;
  const KnownPose pose = read_pose(root, path);
  truth.R = pose.R;
  truth.t = pose.t;
  truth.baseline = root["baseline"] ? number_at(root, "baseline", path) : norm(truth.t);
  if (truth.baseline <= 0) throw BadInput(path + ": baseline is not above 0");
  if (const YAML::Node depth = root["depth0"]) {
    if (!depth.IsScalar()) throw BadInput(path + ": depth0 is not a path");
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    truth.depth0 = load_depth((folder / depth.Scalar()).string());
  }
  return truth;
}

void check_truth(const Truth& truth, const Picture& picture0) {
  if (truth.depth0.empty()) return;
  if (truth.depth0.cols == picture0.file_width && truth.depth0.rows == picture0.file_height) return;
  throw BadInput("depth0 is " + std::to_string(truth.depth0.cols) + "x" +
                 std::to_string(truth.depth0.rows) + ", but image " + picture0.path + " is " +
                 std::to_string(picture0.file_width) + "x" + std::to_string(picture0.file_height));
}

nlohmann::ordered_json truth_json(const Truth& truth, const Picture& picture0,
                                  const tv_two_view& two_view,
                                  const tv_reconstruction& reconstruction) {
  nlohmann::ordered_json json = {
      {"rotation_error_deg", nullptr},           {"translation_error_deg", nullptr},
      {"translation_error_signed_deg", nullptr}, {"depth_error_median_percent", nullptr},
      {"depth_error_p95_percent", nullptr},      {"num_depths", 0}};
  if (two_view.has_R)
    json["rotation_error_deg"] = rotation_error_deg(rotation_of(two_view), truth.R);
  if (!has_full_pose(two_view)) return json;
  const Vector3 t = translation_of(two_view);
  json["translation_error_deg"] = translation_error_deg(t, truth.t);
  json["translation_error_signed_deg"] = translation_error_signed_deg(t, truth.t);
  const std::vector<double> errors = depth_errors_percent(truth, picture0, reconstruction);
  json["num_depths"] = errors.size();
  if (!errors.empty()) {
    json["depth_error_median_percent"] = percentile(errors, 0.5);
    json["depth_error_p95_percent"] = percentile(errors, 0.95);
  }
  return json;
}

void add_dense_truth(const Truth& truth, const Picture& picture0,
                     const std::vector<tv_dense_point>& points, nlohmann::ordered_json& json) {
  std::vector<double> errors;
  if (!truth.depth0.empty())
    for (const tv_dense_point& point : points) {
      const double error =
          depth_error_percent(truth, picture0, point.pixel0[0], point.pixel0[1], point.position[2]);
      if (std::isfinite(error)) errors.push_back(error);
    }
  json["num_dense_depths"] = errors.size();
  const bool known = !errors.empty();
  json["dense_depth_error_median_percent"] =
      known ? nlohmann::ordered_json(percentile(errors, 0.5)) : nlohmann::ordered_json(nullptr);
  json["dense_depth_error_p95_percent"] =
      known ? nlohmann::ordered_json(percentile(errors, 0.95)) : nlohmann::ordered_json(nullptr);
}

}  // namespace cli
