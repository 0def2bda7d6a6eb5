// The options --camera, --camera0, --camera1 and --focal-35mm, and the camera of each image: from a
// file, from the focal length that the user gives, or from the photographs' EXIF data.
#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/cli_fwd.h"
#include "files/camera_file.h"
#include "files/image_file.h"

namespace cli {

// The camera of an image and where it is from.
struct ImageCamera {
  enum Source { kNone, kFile, kFocal, kExif, kEstimated } source = kNone;
  tv_camera camera{};
  CalibrationSigmas sigmas{0, 0};
  std::string file;       // the camera file as given
  double focal_35mm = 0;  // millimetres, where source is kFocal, kExif or kEstimated (start)
  std::vector<std::string> notes;  // of the file: what was left out, and that it was scaled
  std::string doubt;               // what may be wrong with EXIF's focal length: "; a.jpg was ..."
};
using ImageCameras = std::array<ImageCamera, 2>;

// What a camera is chosen by.
struct ImageFacts {
  std::string name;
  int width = 0, height = 0;  // pixels; 0: unknown, then a camera file is not checked against them
  ExifFocal exif;
};
ImageFacts facts_of(const Picture& picture);

struct CameraOptions {
  std::string both, of[2];
  double focal_35mm = 0;  // millimetres, or kAutoFocal; 0: not given
  bool scales_camera = false;

  // may_be_auto: the verb estimates the focal length of a pair.
  void add_to(CLI::App& verb, bool may_be_auto = false);
  // The camera file of each image; both are empty if no camera file is given. Throws BadInput if
  // only one of --camera0 and --camera1 is given, if either is given beside --camera, and if
  // --focal-35mm is given beside a file.
  std::array<std::string, 2> files() const;
  // Whether a file or --focal-35mm is given.
  bool given() const { return focal_35mm > 0 || !files()[0].empty(); }
  // The cameras of two images of these sizes: of the files, else of --focal-35mm, else of the EXIF
  // data of both; else without a source. Throws BadInput where a camera is for another size.
  ImageCameras cameras_of(const ImageFacts& image0, const ImageFacts& image1) const;
};

// A camera with the most common focal length (as for 35 mm film), and with a standard deviation
// that covers all usual ones: the start for estimating the focal length of a pair.
ImageCamera camera_to_estimate(const ImageFacts& image);

// A line that says which focal length EXIF gave; empty where it gave none.
std::string exif_note(const ImageCameras& cameras);

// A list of two: `source` ("file", "focal_35mm", "exif", "estimated" or null), `file`,
// `focal_35mm`.
nlohmann::ordered_json cameras_json(const ImageCameras& cameras);

}  // namespace cli
