// twoview undistort IMAGE...: computes the images that a camera without distortion would have
// taken.

#include <CLI/App.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "files/camera_formats.h"
#include "files/folder.h"
#include "files/image_file.h"
#include "pair/options.h"
#include "pair/result.h"
#include "pictures/undistorted.h"
#include "verbs/camera_options.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
constexpr double kMinFocalScale = 0.05, kMaxFocalScale = 20;

struct Arguments {
  Common common;
  std::vector<std::string> images;
  std::string camera;
  double focal_35mm = 0, focal_scale = 1;
  int resize = 0;  // longer side of the results, pixels; 0: as the images are
  bool mask = false;
  bool scales_camera = false;
};

// The file name of each result: that of the image, with the ending of PNG. Throws BadInput if two
// results would have the same name.
std::vector<std::string> result_names(const std::vector<std::string>& images, bool mask) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  if (mask) taken.insert("mask.png");
  for (const std::string& image : images) {
    names.push_back(fs::path(image).stem().string() + ".png");
    if (!taken.insert(names.back()).second)
      throw BadInput("two results would be named " + names.back() + "; the second is of " + image);
  }
  return names;
}

// The size of the images: that of most by their headers, or of the first that can be read. Throws
// BadInput where none can.
cv::Size usual_size(const std::vector<std::string>& images) {
  std::vector<cv::Size> sizes;
  for (const std::string& image : images) sizes.push_back(header_size(image));
  const cv::Size usual = most_frequent(sizes);
  return usual.area() > 0 ? usual : load_pixels(images[0]).size();
}

// The camera of the images, which are all of one size.
tv_camera lens_of(Arguments& a) {
  const bool has_focal = a.focal_35mm > 0;
  if (!a.camera.empty() && has_focal) throw BadInput("give either --camera or --focal-35mm");
  if (a.camera.empty() && !has_focal)
    throw BadInput("give either --camera or " + focal_option(load_picture(a.images[0]).exif));
  const std::string name = fs::path(a.images[0]).filename().string();
  if (!a.camera.empty() && !a.scales_camera) {
    const CameraFile file = load_camera_file(a.camera);
    if (!file.note().empty()) a.common.note(file.note());
    return file.of(name);
  }
  const cv::Size size = usual_size(a.images);
  if (a.camera.empty()) return film_camera(a.focal_35mm, size.width, size.height);
  const tv_camera camera = load_camera(a.camera, name);
  const std::string note = scaled_note(camera, a.camera, size.width, size.height);
  if (!note.empty()) a.common.note(note);
  return fitted(camera, a.camera, size.width, size.height, a.images[0], true);
}

// The camera's name for messages.
std::string camera_name(const Arguments& a) {
  return a.camera.empty() ? "of --focal-35mm, of the first image," : a.camera;
}

constexpr size_t kMostNamed = 3;

// A line that names each image that was left out with its reason, if there are few.
std::string left_out_note(const std::vector<LeftOut>& left_out) {
  const size_t count = left_out.size();
  std::string text =
      std::to_string(count) + (count == 1 ? " image is left out: " : " images are left out: ");
  for (size_t k = 0; k < std::min(count, kMostNamed); ++k)
    text += (k == 0 ? "" : "; ") + left_out[k].reason;
  return text + (count > kMostNamed ? "; --json names all" : "");
}

int undistort(Arguments& a) {
  Common& common = a.common;
  const tv_camera whole = lens_of(a);
  const cv::Size size = shrunk_size({whole.width, whole.height}, a.resize);
  const tv_camera lens = resized(whole, size.width, size.height);
  if (lens.width > kMaxSide || lens.height > kMaxSide)
    throw BadInput("camera " + a.camera + " is for images above " + std::to_string(kMaxSide) +
                   " a side");
  tv_camera pinhole = pinhole_of(lens);
  pinhole.fx *= a.focal_scale;
  pinhole.fy *= a.focal_scale;
  const std::vector<std::string> names = result_names(a.images, a.mask);
  OutputSet files(common.output);
  if (!a.camera.empty()) files.keep(camera_path(a.camera));
  for (const std::string& image : a.images) files.keep(image);
  files.require_own({"undistort", {"camera.yaml"}, {}, {"calibration.json"}});
  const UndistortMap map = undistort_map(lens, pinhole);
  const double share = cv::countNonZero(map.seen) / static_cast<double>(map.seen.total());
  if (share == 0)
    throw BadInput("camera " + a.camera +
                   " sees no pixel of the result: check its principal point and "
                   "distortion, or --focal-scale");
  const Progress progress(!common.quiet && a.images.size() > 1);
  std::vector<std::string> written;
  std::vector<LeftOut> left_out;
  bool has_more = false;
  for (size_t i = 0; i < a.images.size(); ++i) {
    progress.tell(std::to_string(i + 1) + " of " + std::to_string(a.images.size()) + " images");
    cv::Mat image;
    try {
      image = load_pixels(a.images[i], &has_more);
      fitted(whole, camera_name(a), image.cols, image.rows, a.images[i], false);
    } catch (const BadInput& e) {
      std::error_code ignored;
      if (!fs::exists(a.images[i], ignored)) throw;  // a name that was not meant
      left_out.push_back({a.images[i], e.what()});
      continue;
    }
    if (size != image.size()) {
      cv::Mat smaller;
      cv::resize(image, smaller, size, 0, 0, cv::INTER_AREA);
      image = smaller;
    }
    files.add(names[i], png_bytes(undistorted(image, map)));
    written.push_back(names[i]);
  }
  if (written.empty()) throw BadInput(left_out[0].reason);
  if (!left_out.empty()) common.note(left_out_note(left_out));
  if (has_more) common.note(kMoreNote);
  if (a.mask) files.add("mask.png", png_bytes(map.seen));
  files.add("camera.yaml", camera_yaml(pinhole));

  if (common.json) {
    nlohmann::ordered_json json;
    json["images"] = written;
    json["left_out"] = nlohmann::ordered_json::array();
    for (const LeftOut& image : left_out)
      json["left_out"].push_back({{"image", image.name}, {"reason", image.reason}});
    json["camera"] = "camera.yaml";
    json["image_size"] = {pinhole.width, pinhole.height};
    json["camera_matrix"] = {pinhole.fx, 0, pinhole.cx, 0, pinhole.fy, pinhole.cy, 0, 0, 1};
    json["seen_share"] = share;
    json["options"] = {
        {"camera", a.camera.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(a.camera)},
        {"focal_35mm",
         a.focal_35mm > 0 ? nlohmann::ordered_json(a.focal_35mm) : nlohmann::ordered_json()},
        {"resize", a.resize},
        {"focal_scale", a.focal_scale},
        {"mask", a.mask}};
    json["version"] = tv_version_string();
    print(json_text(json));
  }
  const std::string notes = common.note_lines();
  if (common.speaks()) {
    char text[160];
    std::snprintf(text, sizeof text, "%zu undistorted, %.1f %% of the pixels seen\nfiles        ",
                  written.size(), 100 * share);
    std::string line = text + files.folder().string() + ":";
    for (const std::string& name : files.names()) line += " " + name;
    print(notes + line + "\n");
  }
  files.commit();
  return 0;
}

}  // namespace

void add_undistort(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      program.add_subcommand("undistort", "images without the lens's distortion, and their camera");
  verb->add_option("IMAGE", a->images, "images of one camera")->required()->type_name("IMAGE");
  verb->add_option("--camera", a->camera,
                   "their camera: YAML of OpenCV, ROS or Kalibr, cameras.yaml, or COLMAP's "
                   "cameras.txt; FILE:NAME takes one of several")
      ->type_name("FILE");
  add_scale_camera(*verb, a->scales_camera);
  add_focal_35mm(*verb, a->focal_35mm);
  verb->add_option("--resize", a->resize,
                   "scale images and camera down to this longer side, pixels; 0: as they are")
      ->check([](const std::string& text) {
        int value = 0;
        const bool good = CLI::detail::lexical_cast(text, value) && value >= 0 && value <= kMaxSide;
        return good ? std::string() : "'" + text + "' is not a whole number in [0, 16384]";
      })
      ->type_name("[0, 16384]")
      ->capture_default_str();
  verb->add_option("--focal-scale", a->focal_scale,
                   "focal lengths of the result over the camera's; below 1 shows more of the scene")
      ->check([](const std::string& text) {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        const bool in_range = is_number && value >= kMinFocalScale && value <= kMaxFocalScale;
        return in_range ? std::string() : "'" + text + "' is not in [0.05, 20]";
      })
      ->type_name("[0.05, 20]")
      ->capture_default_str();
  verb->add_flag("--mask", a->mask, "also write mask.png: 255 where the camera saw something");
  add_common(*verb, a->common, 0, "folder for the images and camera.yaml");
  verb->final_callback([a, &run] { run = [a] { return undistort(*a); }; });
}

}  // namespace cli
