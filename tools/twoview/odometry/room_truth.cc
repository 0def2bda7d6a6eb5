#include "odometry/room_truth.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "files/camera_file.h"
#include "files/image_file.h"
#include "odometry/accuracy.h"
#include "odometry/numbers.h"
#include "odometry/ply_mesh.h"
#include "pair/options.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
constexpr size_t kMostPictures = 60;  // of depths, spread evenly over the flight
constexpr double kMostApart = 0.02;   // seconds between a frame and the picture of its depths

std::string stem_of(const std::string& name) { return fs::path(name).stem().string(); }

bool is_digits(const std::string& text) {
  return !text.empty() &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// Which file of depths belongs to which view: by the name of the picture without its ending, else
// by the number of the frame (as depth/NNNNN.png of `twoview room` has), else by the time (as in
// TUM's RGB-D folders).
std::map<size_t, std::string> files_by_view(const std::vector<std::string>& files,
                                            const RoomScene& scene) {
  std::map<size_t, std::string> found;
  std::map<std::string, std::string> by_stem;
  std::map<int64_t, std::string> by_number;
  std::vector<std::pair<double, std::string>> by_time;
  for (const std::string& file : files) {
    const std::string stem = stem_of(file);
    by_stem[stem] = file;
    if (is_digits(stem) && stem.size() < 10) by_number[std::stol(stem)] = file;
    double time = 0;
    if (!is_digits(stem) && to_number(stem, time)) by_time.emplace_back(time, file);
  }
  for (size_t k = 0; k < scene.views.size(); ++k)
    if (const auto at = by_stem.find(stem_of(scene.views[k].name)); at != by_stem.end())
      found[k] = at->second;
  if (!found.empty()) return found;
  for (size_t k = 0; k < scene.views.size(); ++k)
    if (const auto at = by_number.find(scene.views[k].index); at != by_number.end())
      found[k] = at->second;
  if (!found.empty()) return found;
  std::sort(by_time.begin(), by_time.end());
  for (const auto& [time, file] : by_time) {
    size_t best = 0;
    for (size_t k = 1; k < scene.views.size(); ++k)
      if (std::abs(scene.views[k].time_s - time) < std::abs(scene.views[best].time_s - time))
        best = k;
    if (!scene.views.empty() && std::abs(scene.views[best].time_s - time) <= kMostApart)
      found[best] = file;
  }
  return found;
}

// How much of its length a path spreads across its main direction.
double spread_across(const std::vector<Vector3>& places) {
  cv::Mat rows(static_cast<int>(places.size()), 3, CV_64F);
  for (int i = 0; i < rows.rows; ++i)
    for (int k = 0; k < 3; ++k)
      rows.at<double>(i, k) = places[static_cast<size_t>(i)][static_cast<size_t>(k)];
  const cv::PCA axes(rows, cv::noArray(), cv::PCA::DATA_AS_ROW);
  const double along = axes.eigenvalues.at<double>(0), across = axes.eigenvalues.at<double>(1);
  return along > 0 ? std::sqrt(across / along) : 0;
}

// The mean of the rotations from the poses `from` to the poses `to`, made a rotation again.
Matrix3 mean_turn(const std::vector<Pose>& from, const std::vector<Pose>& to) {
  cv::Matx33d sum = cv::Matx33d::zeros();
  for (size_t i = 0; i < from.size(); ++i) {
    const Matrix3 turn = product(to[i].R, transposed(from[i].R));
    sum += cv::Matx33d(turn.data());
  }
  cv::Matx31d w;
  cv::Matx33d u, vt;
  cv::SVD::compute(sum, w, u, vt);
  const double sign = cv::determinant(u) * cv::determinant(vt) < 0 ? -1 : 1;
  const cv::Matx33d R = u * cv::Matx33d::diag(cv::Vec3d(1, 1, sign)) * vt;
  Matrix3 mean;
  std::copy(R.val, R.val + 9, mean.begin());
  return mean;
}

// The similarity from the world of the path to the truth's frame by the positions alone. Where they
// lie on a line, which says nothing of a turn about it, the rotation is the mean of the poses'.
Placement placement_of(const std::vector<Pose>& from, const std::vector<Pose>& to) {
  constexpr double kLeastSpread = 0.05;
  std::vector<Vector3> places, true_places;
  for (const Pose& pose : from) places.push_back(pose.t);
  for (const Pose& pose : to) true_places.push_back(pose.t);
  Similarity fit = fitted(places, true_places, true);
  if (std::min(spread_across(places), spread_across(true_places)) < kLeastSpread) {
    const Matrix3 turn = mean_turn(from, to);
    for (Vector3& place : places) place = applied(turn, place);
    fit = fitted(places, true_places, true);
    // The positions' own turn, which is one about the line at best, is left out.
    Vector3 mean{0, 0, 0}, true_mean{0, 0, 0};
    const double n = static_cast<double>(places.size());
    for (size_t i = 0; i < places.size(); ++i)
      for (size_t k = 0; k < 3; ++k)
        mean[k] += places[i][k] / n, true_mean[k] += true_places[i][k] / n;
    fit.R = turn;
    for (size_t k = 0; k < 3; ++k) fit.t[k] = true_mean[k] - fit.scale * mean[k];
  }
  return {fit.scale, fit.R, fit.t};
}

}  // namespace

const char* const kMeshNeedsPath =
    "--truth-mesh: --truth is required, the true poses of the frames: without them nothing says "
    "where the mesh lies";

std::vector<CLI::Option*> add_truth_options(CLI::App& verb, RoomTruthOptions& options) {
  CLI::Option* mesh =
      verb.add_option("--truth-mesh", options.mesh,
                      "true surface to compare with: a PLY file of triangles, in metres and in the "
                      "frame of the true poses")
          ->type_name("FILE");
  CLI::Option* depth =
      verb.add_option("--truth-depth", options.depth,
                      "true depths to compare with: a folder of 16-bit pictures named as the "
                      "frames, along the optical axis, 0 where unknown")
          ->type_name("DIR")
          ->excludes(mesh);
  CLI::Option* scale = add_number(verb, "truth-scale", &options.depth_scale, 1e-3, 1e9,
                                  "grey levels a metre of --truth-depth")
                           ->default_str("")
                           ->needs(depth);
  depth->needs(scale);
  return {mesh, depth, scale};
}

nlohmann::ordered_json truth_options_json(const RoomTruthOptions& options) {
  nlohmann::ordered_json json;
  json["truth_mesh"] = json["truth_depth"] = json["truth_scale"] = nullptr;
  if (!options.mesh.empty()) json["truth_mesh"] = options.mesh;
  if (!options.depth.empty()) {
    json["truth_depth"] = options.depth;
    json["truth_scale"] = options.depth_scale;
  }
  return json;
}

TrueRoom::TrueRoom(const RoomTruthOptions& options) : options_(options) {
  if (!options.mesh.empty()) {
    mesh_ = load_ply_mesh(options.mesh);
    files_.push_back(options.mesh);
  }
  if (options.depth.empty()) return;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options.depth, error)) {
    const std::string name = entry.path().filename().string();
    std::string ending = entry.path().extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    if (name[0] != '.' &&
        (ending == ".png" || ending == ".tif" || ending == ".tiff" || ending == ".pgm"))
      files_.push_back(entry.path().string());
  }
  if (error) throw BadInput("--truth-depth: cannot read the folder " + options.depth);
  if (files_.empty())
    throw BadInput("--truth-depth: " + options.depth + " holds no pictures (PNG, TIFF or PGM)");
  std::sort(files_.begin(), files_.end());
}

std::vector<TrueRoom::Shown> TrueRoom::pictures_of(const RoomScene& scene) const {
  const std::map<size_t, std::string> found = files_by_view(files_, scene);
  if (found.empty())
    throw BadInput("--truth-depth: no picture of " + options_.depth +
                   " belongs to a frame with a pose: names are compared, then the frames' numbers, "
                   "then times (" +
                   stem_of(files_[0]) + ", " + stem_of(scene.views.front().name) + ")");
  std::vector<Shown> shown;
  const size_t step = (found.size() - 1) / kMostPictures + 1;
  size_t number = 0;
  for (const auto& [view, file] : found) {
    if (number++ % step != 0) continue;
    const cv::Mat grey = load_pixels(file);
    if (grey.type() != CV_16UC1)
      throw BadInput("--truth-depth: " + file + " is not one grey level of 16 bits a pixel");
    const double ratio = static_cast<double>(grey.cols) * scene.camera.height /
                         (static_cast<double>(grey.rows) * scene.camera.width);
    if (std::abs(ratio - 1) > 0.01)
      throw BadInput("--truth-depth: " + file + " is " + std::to_string(grey.cols) + "x" +
                     std::to_string(grey.rows) + ", another shape than the frames' " +
                     std::to_string(scene.camera.width) + "x" +
                     std::to_string(scene.camera.height));
    Shown one{view, {}};
    one.picture.camera = resized(scene.camera, grey.cols, grey.rows);
    grey.convertTo(one.picture.depth, CV_32F, 1 / options_.depth_scale);
    shown.push_back(std::move(one));
  }
  return shown;
}

TrueSurface TrueRoom::surface(const RoomScene& scene, const TruePath& path) const {
  // The scene's pose and the true one of each view that has one.
  std::map<size_t, Pose> true_poses;
  Trajectory own;
  for (const RoomView& view : scene.views) own.push_back({view.time_s, {view.R, view.t}});
  std::vector<Pose> from, to;
  if (!path.poses.empty()) {
    for (const Association& pair : associated(own, path.poses)) {
      true_poses[pair.idx_estimate] = path.poses[pair.idx_truth].pose;
      from.push_back(own[pair.idx_estimate].pose);
      to.push_back(path.poses[pair.idx_truth].pose);
    }
  }
  TrueSurface truth;
  const bool has_path = from.size() >= 3;
  if (path.is_own) {
    truth.placed_by = "the given poses";
    for (size_t k = 0; k < own.size(); ++k) true_poses[k] = own[k].pose;
  } else if (has_path) {
    truth.placed_by = "the true path";
    truth.truth_from_world = placement_of(from, to);
    if (!(truth.truth_from_world.scale > 0))
      throw BadInput("the true path has no length: the true surface cannot be placed");
  } else if (!options_.mesh.empty()) {
    throw BadInput(path.poses.empty()
                       ? kMeshNeedsPath
                       : "--truth-mesh: fewer than three true poses have the time of a frame" +
                             (path.problem.empty() ? std::string() : "; " + path.problem));
  }
  if (!options_.mesh.empty()) {
    truth.mesh = mesh_;
    return truth;
  }
  std::vector<Shown> shown = pictures_of(scene);
  if (!path.is_own && !has_path) {
    truth.placed_by = "its own poses and a metre of its own";
    if (!scene.is_metric) {
      std::vector<double> ratios;
      for (const Shown& one : shown) {
        const RoomView& view = scene.views[one.view];
        for (const Vector3& point : scene.points) {
          Vector3 away = point;
          for (size_t k = 0; k < 3; ++k) away[k] -= view.t[k];
          const Vector3 ray = applied(transposed(view.R), away);
          double pixel[2];
          if (!(ray[2] > 0) || tv_camera_project(&one.picture.camera, ray.data(), pixel, nullptr))
            continue;
          const double x = std::round(pixel[0]), y = std::round(pixel[1]);
          if (!(x >= 0 && y >= 0 && x < one.picture.depth.cols && y < one.picture.depth.rows))
            continue;
          const double depth = static_cast<double>(
              one.picture.depth.at<float>(static_cast<int>(y), static_cast<int>(x)));
          if (depth > 0) ratios.push_back(depth / ray[2]);
        }
      }
      if (ratios.size() < 20)
        throw BadInput("--truth-depth: fewer than 20 points of the map have a true depth");
      std::nth_element(ratios.begin(),
                       ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2),
                       ratios.end());
      truth.truth_from_world.scale = ratios[ratios.size() / 2];
      truth.placed_by = "its own poses, with a scale fitted to the map's points";
    }
    for (size_t k = 0; k < own.size(); ++k)
      true_poses[k] = {own[k].pose.R, truth.truth_from_world.of(own[k].pose.t)};
  }
  for (Shown& one : shown) {
    const auto pose = true_poses.find(one.view);
    if (pose == true_poses.end()) continue;
    one.picture.R = pose->second.R;
    one.picture.t = pose->second.t;
    truth.pictures.push_back(std::move(one.picture));
  }
  truth.mesh = mesh_of(truth.pictures);
  if (truth.mesh.triangles.empty())
    throw BadInput("--truth-depth: the pictures of " + options_.depth + " hold no surface");
  return truth;
}

}  // namespace cli
