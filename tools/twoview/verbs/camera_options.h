// The options --camera, --camera0 and --camera1, and the camera file of each image.
#pragma once

#include <CLI/App.hpp>
#include <array>
#include <string>

#include "twoview/camera.h"

namespace cli {

struct CameraOptions {
  std::string both, of[2];

  void add_to(CLI::App& verb);
  // The camera file of each image; both are empty if no camera is given. Throws BadInput if only
  // one of --camera0 and --camera1 is given, or either beside --camera.
  std::array<std::string, 2> files() const;
  // Loads the cameras of files(), which must not be empty. A file for both images is read once,
  // since it may be a pipe.
  static std::array<tv_camera, 2> load(const std::array<std::string, 2>& files);
};

}  // namespace cli
