// Reads the camera files of every format that the program knows: OpenCV's YAML, JSON and XML, ROS's
// camera_info, Kalibr's camchain and EuRoC's sensor.yaml, ORB-SLAM's, stella_vslam's, VINS's and
// SVO's settings, nerfstudio's transforms.json, a data set's cameras.yaml, and COLMAP's
// cameras.txt. Files of other programs that are known are refused by name. camera_entries.h has the
// names of the entries, and says which of them are refused.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "files/camera_file.h"
#include "files/camera_set.h"

namespace cli {

// The cameras of a file, in its order. A camera of a format without names has the name "".
struct CameraFile {
  std::string path;
  NamedCameras cameras;
  CalibrationSigmas sigmas = kPlainFile;
  bool is_colmap = false;  // the names are COLMAP's camera ids, which say nothing of files' names
  std::vector<std::string> left_out;  // names of entries that are not needed and cannot matter
  YAML::Node root;                    // of YAML, JSON and XML; null of COLMAP's text

  // The camera that serves an image: the only one, else the one whose name begins the image's file
  // name (choose_camera). Throws BadInput that lists the names if none does.
  const tv_camera& of(const std::string& image_name) const;
  // A line that names the entries that were left out; empty where there are none.
  std::string note() const;
};

// Parses the text of a camera file. `path` is used in messages. Throws BadInput that names the
// entry and, where no format is recognised, the formats that are known.
CameraFile parse_camera_file(const std::string& text, const std::string& path);

// The one camera of such a text.
tv_camera parse_camera(const std::string& text, const std::string& path);

// Reads a camera file. `given` is a path, or PATH:NAME for one camera of a file with several.
CameraFile load_camera_file(const std::string& given);

// The camera of a file that serves an image.
tv_camera load_camera(const std::string& given, const std::string& image_name = "");

// The path in `given`, without the camera's name.
std::string camera_path(const std::string& given);

}  // namespace cli
