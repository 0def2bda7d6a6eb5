// twoview undistort IMAGE...: computes the images that a camera without distortion would have
// taken.

#include <filesystem>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <set>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "files/camera_formats.h"
#include "files/image_file.h"
#include "pair/options.h"
#include "pair/result.h"
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

// The position in the old image of each pixel of the new one, by the library's lens models.
struct Map {
  cv::Mat place;  // for each new pixel x y in the old image, 32-bit floats
  // 255 if the lens model is valid there and the position is in the old image, else 0
  cv::Mat seen;
};

Map map_to(const tv_camera& lens, const tv_camera& pinhole) {
  Map map{cv::Mat(pinhole.height, pinhole.width, CV_32FC2),
          cv::Mat(pinhole.height, pinhole.width, CV_8U)};
  const auto width = static_cast<size_t>(pinhole.width);
  std::vector<double> rays(3 * width), pixels(2 * width);
  std::vector<uint8_t> inside(width);
  for (int y = 0; y < pinhole.height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      rays[3 * x] = (static_cast<double>(x) - pinhole.cx) / pinhole.fx;
      rays[3 * x + 1] = (y - pinhole.cy) / pinhole.fy;
      rays[3 * x + 2] = 1;
    }
    check(tv_camera_project_points(&lens, rays.data(), pinhole.width, pixels.data(), inside.data()),
          "cannot project");
    for (size_t x = 0; x < width; ++x) {
      const double u = pixels[2 * x], v = pixels[2 * x + 1];
      const bool seen =
          inside[x] && u >= -0.5 && v >= -0.5 && u <= lens.width - 0.5 && v <= lens.height - 0.5;
      map.seen.at<uint8_t>(y, static_cast<int>(x)) = seen ? 255 : 0;
      map.place.at<cv::Vec2f>(y, static_cast<int>(x)) =
          seen ? cv::Vec2f(static_cast<float>(u), static_cast<float>(v)) : cv::Vec2f(0, 0);
    }
  }
  return map;
}

// Interpolates bicubically. At the border the nearest pixels are repeated, and pixels without a
// position in the old image are black.
cv::Mat undistorted(const cv::Mat& image, const Map& map) {
  cv::Mat remapped, result;
  cv::remap(image, remapped, map.place, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  remapped.copyTo(result, map.seen);  // pixels without a position stay 0
  return result;
}

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
  const cv::Mat image = load_pixels(a.images[0]);
  if (a.camera.empty()) return film_camera(a.focal_35mm, image.cols, image.rows);
  const tv_camera camera = load_camera(a.camera, name);
  const std::string note = scaled_note(camera, a.camera, image.cols, image.rows);
  if (!note.empty()) a.common.note(note);
  return fitted(camera, a.camera, image.cols, image.rows, a.images[0], true);
}

// The camera's name for messages.
std::string camera_name(const Arguments& a) {
  return a.camera.empty() ? "of --focal-35mm, of the first image," : a.camera;
}

int undistort(Arguments& a) {
  Common& common = a.common;
  const tv_camera whole = lens_of(a);
  const cv::Size size = shrunk_size({whole.width, whole.height}, a.resize);
  const tv_camera lens = resized(whole, size.width, size.height);
  if (lens.width > kMaxSide || lens.height > kMaxSide)
    throw BadInput("camera " + a.camera + " is for images above " + std::to_string(kMaxSide) +
                   " a side");
  tv_camera pinhole = lens;
  pinhole.model = TV_CAMERA_PINHOLE;
  std::fill(std::begin(pinhole.k), std::end(pinhole.k), 0.0);
  pinhole.fx *= a.focal_scale;
  pinhole.fy *= a.focal_scale;
  const std::vector<std::string> names = result_names(a.images, a.mask);
  OutputSet files(common.output);
  if (!a.camera.empty()) files.keep(camera_path(a.camera));
  for (const std::string& image : a.images) files.keep(image);
  files.require_own({"undistort", {"camera.yaml"}, {}, {"calibration.json"}});
  const Map map = map_to(lens, pinhole);
  const double share = cv::countNonZero(map.seen) / static_cast<double>(map.seen.total());
  if (share == 0)
    throw BadInput("camera " + a.camera +
                   " sees no pixel of the result: check its principal point and "
                   "distortion, or --focal-scale");
  const Progress progress(!common.quiet && a.images.size() > 1);
  for (size_t i = 0; i < a.images.size(); ++i) {
    cv::Mat image = load_pixels(a.images[i]);
    fitted(whole, camera_name(a), image.cols, image.rows, a.images[i], false);
    if (size != image.size()) {
      cv::Mat smaller;
      cv::resize(image, smaller, size, 0, 0, cv::INTER_AREA);
      image = smaller;
    }
    files.add(names[i], png_bytes(undistorted(image, map)));
    progress.tell(std::to_string(i + 1) + " of " + std::to_string(a.images.size()) + " images");
  }
  if (a.mask) files.add("mask.png", png_bytes(map.seen));
  files.add("camera.yaml", camera_yaml(pinhole));

  if (common.json) {
    nlohmann::ordered_json json;
    json["images"] = names;
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
                  names.size(), 100 * share);
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
