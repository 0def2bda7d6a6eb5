#include "verbs/camera_options.h"

#include <CLI/App.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "files/camera_formats.h"
#include "pair/options.h"
#include "pair/simple_lens.h"

namespace cli {
namespace {

ImageCamera film(double focal_35mm, const ImageFacts& image) {
  const tv_camera camera = film_camera(focal_35mm, image.width, image.height);
  return {ImageCamera::kFocal, camera, kFilm, "", focal_35mm, {}, ""};
}

ImageCamera by_exif(const ImageFacts& image) {
  ImageCamera found = film(image.exif.focal_35mm, image);
  found.source = ImageCamera::kExif;
  found.sigmas.focal = image.exif.sigma;
  for (const std::string& words : {image.exif.doubt, image.exif.assumed})
    if (!words.empty()) found.doubt += "; " + image.name + " " + words;
  return found;
}

}  // namespace

ImageFacts facts_of(const Picture& picture) {
  return {picture.name, picture.file_width, picture.file_height, picture.exif};
}

void CameraOptions::add_to(CLI::App& verb, bool may_be_auto) {
  verb.add_option("--camera", both,
                  "camera of both images: YAML of OpenCV, ROS or Kalibr, cameras.yaml, or COLMAP's "
                  "cameras.txt; FILE:NAME takes one of several")
      ->type_name("FILE");
  verb.add_option("--camera0", of[0], "camera of image 0")->type_name("FILE");
  verb.add_option("--camera1", of[1], "camera of image 1")->type_name("FILE");
  add_scale_camera(verb, scales_camera);
  add_focal_35mm(verb, focal_35mm, may_be_auto);
}

std::array<std::string, 2> CameraOptions::files() const {
  if (!both.empty() && (!of[0].empty() || !of[1].empty()))
    throw BadInput("give --camera, or --camera0 and --camera1, not both");
  if (focal_35mm != 0 && !(both.empty() && of[0].empty() && of[1].empty()))
    throw BadInput("--focal-35mm is for photographs without a camera file");
  if (!both.empty()) return {both, both};
  if (of[0].empty() != of[1].empty())
    throw BadInput(std::string("--camera") + (of[0].empty() ? "0" : "1") + " is missing");
  return {of[0], of[1]};
}

ImageCameras CameraOptions::cameras_of(const ImageFacts& image0, const ImageFacts& image1) const {
  const ImageFacts* const images[2] = {&image0, &image1};
  const std::array<std::string, 2> given = files();
  ImageCameras cameras;
  if (!given[0].empty()) {
    const CameraFile file0 =
        load_camera_file(given[0]);  // a file for both may be a pipe: read once
    const CameraFile file1 = given[1] == given[0] ? file0 : load_camera_file(given[1]);
    const CameraFile* const read[2] = {&file0, &file1};
    for (size_t i = 0; i < 2; ++i) {
      const tv_camera camera = read[i]->of(images[i]->name);
      const int width = images[i]->width, height = images[i]->height;
      cameras[i] = {ImageCamera::kFile, camera, read[i]->sigmas, given[i], 0, {}, ""};
      if (!read[i]->note().empty()) cameras[i].notes.push_back(read[i]->note());
      if (width == 0) continue;
      cameras[i].camera = fitted(camera, given[i], width, height, images[i]->name, scales_camera);
      const std::string scaled = scaled_note(camera, given[i], width, height);
      if (!scaled.empty()) cameras[i].notes.push_back(scaled);
    }
  } else if (focal_35mm > 0) {
    for (size_t i = 0; i < 2; ++i) cameras[i] = film(focal_35mm, *images[i]);
  } else if (focal_35mm == kAutoFocal) {
    for (size_t i = 0; i < 2; ++i) cameras[i] = camera_to_estimate(*images[i]);
  } else if (image0.exif.focal_35mm > 0 && image1.exif.focal_35mm > 0) {
    for (size_t i = 0; i < 2; ++i) cameras[i] = by_exif(*images[i]);
  }
  return cameras;
}

ImageCamera camera_to_estimate(const ImageFacts& image) {
  ImageCamera camera = film(kPriorFocal35mm, image);
  camera.source = ImageCamera::kEstimated;
  camera.sigmas.focal = kPriorLogFocal;
  return camera;
}

std::string exif_note(const ImageCameras& cameras) {
  if (cameras[0].source != ImageCamera::kExif) return "";
  char text[160], known[48] = "";
  const double f0 = cameras[0].focal_35mm, f1 = cameras[1].focal_35mm;
  const double sigma = std::max(cameras[0].sigmas.focal, cameras[1].sigmas.focal);
  if (sigma > kFilm.focal)
    std::snprintf(known, sizeof known, ", known to %.0f %% only", 100 * sigma);
  if (f0 == f1)
    std::snprintf(text, sizeof text,
                  "focal length %.4g mm (35 mm equivalent) from EXIF%s; --camera is better", f0,
                  known);
  else
    std::snprintf(text, sizeof text,
                  "focal lengths %.4g and %.4g mm (35 mm equivalent) from EXIF%s; --camera0 and "
                  "--camera1 are better",
                  f0, f1, known);
  return text + cameras[0].doubt + cameras[1].doubt;
}

nlohmann::ordered_json cameras_json(const ImageCameras& cameras) {
  using Json = nlohmann::ordered_json;
  const Json names[] = {nullptr, "file", "focal_35mm", "exif", "estimated"};
  Json list = Json::array();
  for (const ImageCamera& camera : cameras)
    list.push_back({{"source", names[camera.source]},
                    {"file", camera.file.empty() ? Json() : Json(camera.file)},
                    {"focal_35mm", camera.focal_35mm > 0 ? Json(camera.focal_35mm) : Json()}});
  return list;
}

}  // namespace cli
