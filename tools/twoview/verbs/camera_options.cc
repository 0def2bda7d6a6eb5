#include "verbs/camera_options.h"

#include "base/error.h"
#include "files/camera_file.h"

namespace cli {

void CameraOptions::add_to(CLI::App& verb) {
  verb.add_option("--camera", both, "camera of both images, OpenCV or ROS YAML")->type_name("FILE");
  verb.add_option("--camera0", of[0], "camera of image 0")->type_name("FILE");
  verb.add_option("--camera1", of[1], "camera of image 1")->type_name("FILE");
}

std::array<std::string, 2> CameraOptions::files() const {
  if (!both.empty() && (!of[0].empty() || !of[1].empty()))
    throw BadInput("give --camera, or --camera0 and --camera1, not both");
  if (!both.empty()) return {both, both};
  if (of[0].empty() != of[1].empty())
    throw BadInput(std::string("--camera") + (of[0].empty() ? "0" : "1") + " is missing");
  return {of[0], of[1]};
}

std::array<tv_camera, 2> CameraOptions::load(const std::array<std::string, 2>& files) {
  const tv_camera camera0 = load_camera(files[0]);
  return {camera0, files[1] == files[0] ? camera0 : load_camera(files[1])};
}

}  // namespace cli
