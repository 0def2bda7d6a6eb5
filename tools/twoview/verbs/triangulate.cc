// twoview triangulate MATCHES: computes points from matched pixels and a known pose.

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/output.h"
#include "base/two_views.h"
#include "files/camera_formats.h"
#include "files/image_file.h"
#include "files/matches_file.h"
#include "pair/measures.h"
#include "pair/session.h"
#include "pair/truth.h"
#include "report/tables.h"
#include "verbs/camera_options.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
constexpr double kDegrees = 57.29577951308232;  // degrees in a radian

// What is said against the pose, the cameras and the matches.
struct PoseDoubt {
  std::string words;  // empty: none
  bool is_contradicted = false;
};

struct Arguments {
  Common common;
  std::string matches, pose;
  std::vector<std::string> images;  // none, or the two that were matched
  CameraOptions cameras;
  double max_error_px = Options().estimate.max_error_px;
  PoseDoubt doubt;
};

std::string camera_in_words(const ImageCamera& camera) {
  if (camera.source == ImageCamera::kFile) return "camera " + camera.file;
  char text[80];
  std::snprintf(text, sizeof text,
                camera.source == ImageCamera::kExif ? "the camera of EXIF's focal length, %.4g mm,"
                                                    : "the camera of --focal-35mm %.4g",
                camera.focal_35mm);
  return text;
}

// Throws BadInput where a matched pixel is not in the image that its camera is for: then the
// matches are of images of another size. Without images to compare with, matches of images that
// were made smaller show by a large part of the camera's image in which there is no match.
void require_inside(const Arguments& a, const MatchList& matches, const ImageCameras& cameras) {
  constexpr size_t telling = 20;  // matches
  bool leaves_room = matches.size() >= telling && a.images.empty() && a.common.options.resize < 0;
  double farthest[2][2] = {{0, 0}, {0, 0}};
  for (size_t v = 0; v < 2; ++v) {
    const tv_camera& camera = cameras[v].camera;
    for (size_t i = 0; i < matches.size(); ++i) {
      const double x = matches.pixels[v][2 * i], y = matches.pixels[v][2 * i + 1];
      farthest[v][0] = std::max(farthest[v][0], x);
      farthest[v][1] = std::max(farthest[v][1], y);
      if (!(x < -1 || y < -1 || x > camera.width || y > camera.height)) continue;
      char text[96];
      std::snprintf(text, sizeof text, " has the pixel (%g, %g) in image %d, but ", x, y,
                    static_cast<int>(v));
      throw BadInput(a.matches + text + camera_in_words(cameras[v]) + " is for " +
                     std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                     ": give the camera of the images that were matched, and --resize as there");
    }
    leaves_room =
        leaves_room && 2 * farthest[v][0] < camera.width && 2 * farthest[v][1] < camera.height;
  }
  if (!leaves_room) return;
  char text[200];
  std::snprintf(text, sizeof text,
                " has no pixel beyond (%.0f, %.0f), but the camera is for %dx%d: were the images "
                "made smaller before? --resize L scales the camera with them, --resize 0 leaves it",
                farthest[0][0], farthest[0][1], cameras[0].camera.width, cameras[0].camera.height);
  throw BadInput(a.matches + text);
}

// What is known of each image: of the image files, else, for --focal-35mm, of the file with the
// pose; the width is 0 where nothing is known.
std::array<ImageFacts, 2> images_of(const Arguments& a, const KnownPose& pose) {
  std::array<ImageFacts, 2> images;
  for (size_t v = 0; v < 2; ++v) {
    if (!a.images.empty()) {
      images[v] = facts_of(load_picture(a.images[v]));
    } else if (a.cameras.focal_35mm > 0) {
      images[v] = {"", pose.sizes[v][0], pose.sizes[v][1], {}};
    }
  }
  return images;
}

// The cameras of the matched images, scaled as `match` with the same --resize scaled the images.
ImageCameras matched_cameras(Arguments& a, const KnownPose& pose) {
  if (!a.cameras.given() && a.images.empty())
    throw BadInput(
        "cameras are needed: give --camera, or --camera0 and --camera1, or --focal-35mm; or "
        "--images A B with a focal length in their EXIF data");
  const std::array<ImageFacts, 2> images = images_of(a, pose);
  for (const ImageFacts& image : images)
    if (image.width == 0 && a.cameras.focal_35mm > 0)
      throw BadInput(
          "--focal-35mm needs the size of the images: give --images A B, or a --pose "
          "with image_size0 and image_size1");
  ImageCameras cameras = a.cameras.cameras_of(images[0], images[1]);
  if (cameras[0].source == ImageCamera::kNone) {
    const ImageFacts& without = images[images[0].exif.focal_35mm > 0 ? 1 : 0];
    throw BadInput("cameras are needed: " + without.name + " " + without.exif.gap +
                   "; give --camera or --focal-35mm");
  }
  for (const ImageCamera& camera : cameras)
    for (const std::string& line : camera.notes) a.common.note(line);
  const std::string note = exif_note(cameras);
  if (!note.empty()) a.common.note(note);
  for (ImageCamera& camera : cameras) {
    Options& options = a.common.options;
    // Where no images are given, only --resize says by how much they were made smaller.
    const int longer = a.images.empty()
                           ? std::max(options.resize, 0)
                           : options.longer_side(camera.camera.width, camera.camera.height);
    const tv_camera whole = camera.camera;
    const cv::Size size = shrunk_size({whole.width, whole.height}, longer);
    camera.camera = resized(whole, size.width, size.height);
    if (options.resize != kByItself || camera.camera.width == whole.width) continue;
    options.was_large = true;
    a.common.note("the matches are taken as of images at " + std::to_string(size.width) + "x" +
                  std::to_string(size.height) + ", as match makes those of " +
                  std::to_string(whole.width) + "x" + std::to_string(whole.height) +
                  " (--resize 0: as they are)");
  }
  return cameras;
}

// Returns true if the cloud should hold the point: it is in front of both cameras and not
// at infinity, and its reprojection error is at most max_error_px.
bool is_wanted(const tv_point& point, double max_error_px) {
  return point.status == TV_POINT_OK && static_cast<double>(point.error_px) <= max_error_px;
}

using Pose3 = std::pair<Matrix3, Vector3>;

Pose3 inverse(const Pose3& pose) {
  const Matrix3 R = transposed(pose.first);
  Vector3 t = applied(R, pose.second);
  for (double& value : t) value = -value;
  return {R, t};
}

// Throws where the matches contradict the pose and confirm another reading of its numbers.
// share_of: of a pose, the share of the matches that meet in front of both cameras.
template <class ShareOf>
void require_direction(const Arguments& a, const Pose3& pose, const ShareOf& share_of) {
  constexpr double kContradicted = 0.2, kConfirmed = 0.5;
  const double share = share_of(pose);
  if (share >= kContradicted) return;
  const Vector3 turned = applied(pose.first, pose.second);
  const struct {
    const char* words;
    Pose3 pose;
  } readings[] = {
      {"are of cam0_from_cam1, or the matches of the images in the other order", inverse(pose)},
      {"are cam1_from_cam0's rotation and the place of camera 1 in camera 0 (t = -R place)",
       {pose.first, {-turned[0], -turned[1], -turned[2]}}},
  };
  for (const auto& reading : readings)
    if (const double other = share_of(reading.pose); other > kConfirmed)
      throw BadInput(a.pose + ": the matches contradict this pose: " +
                     std::to_string(std::lround(100 * share)) +
                     " % of them meet in front of both cameras, and " +
                     std::to_string(std::lround(100 * other)) + " % if R and t " + reading.words);
}

// The pose that is estimated from the matches alone; empty where they do not determine one.
std::optional<Pose3> free_pose(const Arguments& a, const tv_pixel_pairs& pixels,
                               const tv_camera& camera0, const tv_camera& camera1) {
  Session session(a.common.options);
  tv_context* const context =
      session.context(std::max(camera0.width, camera1.width),
                      std::max(camera0.height, camera1.height), static_cast<size_t>(pixels.num));
  tv_two_view found;
  tv_two_view_init(&found);
  std::vector<uint8_t> is_inlier(static_cast<size_t>(pixels.num));
  check(tv_estimate_two_view(context, &camera0, &camera1, &pixels, &a.common.options.estimate,
                             &found, nullptr, is_inlier.data()),
        "cannot estimate");
  if (!has_full_pose(found)) return {};
  return Pose3{rotation_of(found), translation_of(found)};
}

// Compares the matches that meet by the given pose with those that meet by their own one: a wrong
// lens, matches of pictures of another size and poses of another pair leave few. A doubt where
// less than kSure of them do; contradicted where less than half do. Of 38 pairs of nine sets with
// their estimated pose none is doubted, with 19 true poses one, which is of a motion capture.
template <class ShareOf>
PoseDoubt pose_doubt(const Arguments& a, double share, const std::optional<Pose3>& own,
                     const ShareOf& share_of) {
  constexpr double kContradicted = 0.5, kSure = 0.8, kTold = 0.2;
  if (!own) return {};
  const double most = share_of(*own);
  if (most < kTold || share >= kSure * most) return {};
  char numbers[160];
  std::snprintf(numbers, sizeof numbers,
                "%.0f %% of them meet to %g px by it, and %.0f %% by the pose that they ask for "
                "themselves",
                100 * share, a.max_error_px, 100 * most);
  const bool is_contradicted = share < kContradicted * most;
  return {(is_contradicted ? "the matches contradict the pose or the cameras: "
                           : "the pose, the cameras or the matches are doubtful: ") +
              std::string(numbers) +
              " (a pose of another pair, matches of pictures of another size, another camera or "
              "lens?)",
          is_contradicted};
}

std::vector<tv_point> triangulated(Arguments& a, const MatchList& matches, const KnownPose& pose,
                                   const ImageCameras& cameras) {
  constexpr size_t kTelling = 20;  // matches
  require_inside(a, matches, cameras);
  const tv_camera camera0 = pose.corrected(cameras[0].camera);
  const tv_camera camera1 = pose.corrected(cameras[1].camera);
  const tv_pixel_pairs pixels = pixel_pairs(matches.pixels);
  std::vector<tv_point> points(matches.size());
  const auto method = static_cast<tv_triangulation>(a.common.options.triangulation);
  const auto triangulate = [&](const Pose3& by) {
    const tv_camera_pair pair = camera_pair(camera0, camera1, by.first, by.second);
    check(tv_triangulate(&pair, &pixels, method, points.data()), "cannot triangulate " + a.matches);
  };
  const auto share_of = [&](const Pose3& by) {
    triangulate(by);
    const auto count = std::count_if(points.begin(), points.end(), [&a](const tv_point& point) {
      return is_wanted(point, a.max_error_px);
    });
    return static_cast<double>(count) / static_cast<double>(points.size());
  };
  const Pose3 given{pose.R, pose.t};
  if (matches.size() >= kTelling) {
    require_direction(a, given, share_of);
    const double share = share_of(given);
    a.doubt = pose_doubt(a, share, free_pose(a, pixels, camera0, camera1), share_of);
    if (!a.doubt.words.empty()) a.common.note(a.doubt.words);
  }
  triangulate(given);
  return points;
}

std::vector<CloudPoint> cloud(const std::vector<tv_point>& points, double max_error_px) {
  constexpr uint8_t grey = 200;  // grey level of all points: there is no image
  std::vector<CloudPoint> cloud;
  for (const tv_point& p : points)
    if (is_wanted(p, max_error_px))
      cloud.push_back({p.position[0], p.position[1], p.position[2], grey, grey, grey,
                       static_cast<float>(p.angle_rad * kDegrees), p.error_px});
  return cloud;
}

Json result(const Arguments& a, const std::vector<tv_point>& points, const KnownPose& pose,
            const ImageCameras& cameras) {
  int counts[4] = {};
  int num_wanted = 0;
  double sum_sq = 0;
  std::vector<double> angles;
  for (const tv_point& p : points) {
    ++counts[p.status];
    if (!is_wanted(p, a.max_error_px)) continue;
    ++num_wanted;
    sum_sq += static_cast<double>(p.error_px) * p.error_px;
    angles.push_back(p.angle_rad * kDegrees);
  }
  Json json;
  json["verdict"] = a.doubt.words.empty() ? "ok" : "doubtful";
  json["notes"] = a.common.notes;
  json["num_matches"] = points.size();
  json["num_points"] = num_wanted;
  for (int status = 0; status < 4; ++status)
    json["num_" + std::string(point_status_name(status))] = counts[status];
  json["rms_reprojection_px"] = num_wanted ? Json(std::sqrt(sum_sq / num_wanted)) : Json(nullptr);
  json["median_angle_deg"] = num_wanted ? Json(percentile(angles, 0.5)) : Json(nullptr);
  json["R"] = pose.R;
  json["t"] = pose.t;
  json["points"] = Json::array();
  for (const tv_point& p : points)
    json["points"].push_back({{"position", Json(p.position)},
                              {"angle_deg", p.angle_rad * kDegrees},
                              {"error_px", shortest(p.error_px)},
                              {"status", point_status_name(p.status)}});
  json["cameras"] = cameras_json(cameras);
  json["options"] = options_json(a.common.options, kTriangulate | kResize);
  json["options"]["max_error_px"] = a.max_error_px;
  for (size_t v = 0; v < 2; ++v) {
    const std::string& file = cameras[v].file;
    json["options"]["camera" + std::to_string(v)] = file.empty() ? Json() : Json(file);
  }
  json["version"] = tv_version_string();
  return json;
}

std::string summary(const Json& json, const OutputSet& files) {
  char text[256];
  std::snprintf(text, sizeof text,
                "%d points of %d matches; %d above %g px, %d infinite, %d behind a camera, "
                "%d invalid\n",
                json["num_points"].get<int>(), json["num_matches"].get<int>(),
                json["num_ok"].get<int>() - json["num_points"].get<int>(),
                json["options"]["max_error_px"].get<double>(), json["num_infinite"].get<int>(),
                json["num_behind"].get<int>(), json["num_invalid"].get<int>());
  std::string words = text;
  if (json["num_points"].get<int>() > 0) {
    std::snprintf(text, sizeof text, "reprojection %.2f px rms, angle %.2f deg (median)\n",
                  json["rms_reprojection_px"].get<double>(),
                  json["median_angle_deg"].get<double>());
    words += text;
  }
  words += "files        " + files.folder().string() + ":";
  for (const std::string& name : files.names()) words += " " + name;
  return words + "\n";
}

// Adds the outputs: -o names a folder, or one file if it ends in .csv or .ply.
void add_files(const fs::path& output, const std::string& csv, const std::string& ply,
               OutputSet& files) {
  const std::string kind = output.extension().string();
  const bool is_file = files.folder() != output;
  if (!is_file || kind == ".csv")
    files.add(is_file ? output.filename().string() : "points.csv", csv);
  if (!is_file || kind == ".ply")
    files.add(is_file ? output.filename().string() : "cloud.ply", ply);
}

int triangulate(Arguments& a) {
  Common& common = a.common;
  common.options.settle();
  const std::array<std::string, 2> camera_files = a.cameras.files();
  const KnownPose pose = load_pose(a.pose);
  const MatchList matches = load_matches(a.matches);
  const ImageCameras cameras = matched_cameras(a, pose);
  const std::vector<tv_point> points = triangulated(a, matches, pose, cameras);

  const fs::path output(common.output);
  const std::string kind = output.extension().string();
  const bool is_file = (kind == ".csv" || kind == ".ply") && !fs::is_directory(output);
  OutputSet files(is_file ? output.parent_path() : output);
  files.keep(a.matches);
  files.keep(a.pose);
  for (const std::string& camera : camera_files) files.keep(camera_path(camera));
  for (const std::string& image : a.images) files.keep(image);
  if (!is_file) files.require_own({"triangulate", {"points.csv", "cloud.ply"}, {"points.csv"}, {}});
  const Json json = result(a, points, pose, cameras);
  add_files(output, points_csv(points), cloud_ply(cloud(points, a.max_error_px), "that of t"),
            files);
  if (common.json) print(json_text(json));
  const std::string notes = common.note_lines();
  if (common.speaks()) print(notes + summary(json, files));
  files.commit();
  return a.doubt.is_contradicted ? kExitNoPose : 0;
}

}  // namespace

void add_triangulate(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      program.add_subcommand("triangulate", "points from matched pixels and a known pose");
  verb->add_option("MATCHES", a->matches, "table of x0 y0 x1 y1, such as matches.csv")
      ->required()
      ->type_name("FILE");
  a->cameras.add_to(*verb);
  verb->add_option("--images", a->images,
                   "the two images that were matched, whose sizes are checked and whose EXIF data "
                   "are read")
      ->expected(2)
      ->type_name("A B");
  verb->add_option("--pose", a->pose,
                   "R and t of cam1_from_cam0: result.json, whose principal_point_shift_px and "
                   "focal_length.scale are used too, or YAML")
      ->required()
      ->type_name("FILE");
  verb->add_option("--max-error-px", a->max_error_px,
                   "leave points of a larger error out of the cloud")
      ->check([](const std::string& text) {
        double value = 0;
        const bool in_range = CLI::detail::lexical_cast(text, value) && value > 0 && value <= 1e9;
        return in_range ? std::string() : "'" + text + "' is not in (0, 1e9]";
      })
      ->type_name("(0, 1e9]")
      ->capture_default_str();
  add_common(*verb, a->common, kTriangulate | kResize,
             "folder for points.csv and cloud.ply, or one file ending in .csv or .ply");
  verb->final_callback([a, &run] { run = [a] { return triangulate(*a); }; });
}

}  // namespace cli
