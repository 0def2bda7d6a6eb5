// --camera, --camera0, --camera1: which camera file serves which image.
#pragma once

#include <CLI/App.hpp>
#include <array>
#include <string>

#include "twoview/camera.h"

namespace cli {

struct CameraOptions {
  std::string both, of[2];

  void add_to(CLI::App& verb);
  // The file of each image; both empty without cameras. Throws BadInput for half a choice.
  std::array<std::string, 2> files() const;
  // Of files that are not empty; one that serves both is read once, for it may be a pipe.
  static std::array<tv_camera, 2> load(const std::array<std::string, 2>& files);
};

}  // namespace cli
