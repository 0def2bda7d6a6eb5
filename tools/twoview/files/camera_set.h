// cameras.yaml of a data set: its cameras by name, and the choice of the camera of an image.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "twoview/camera.h"

namespace cli {

// The cameras of a set with their names, in the order of the file.
using NamedCameras = std::vector<std::pair<std::string, tv_camera>>;
// Adds to left_out the names of entries that are not needed and cannot concern the lens.
NamedCameras load_camera_set(const std::string& path, std::vector<std::string>* left_out = nullptr);
NamedCameras parse_camera_set(const std::string& text, const std::string& name,
                              std::vector<std::string>* left_out = nullptr);
// A line that names the entries of a camera file that were left out; empty where there are none.
std::string left_out_note(const std::string& path, const std::vector<std::string>& left_out);

// The entry of a set that serves an image. One entry serves every image. With several, it is the
// entry whose name begins the file's name (the longest such name; folders do not count), else the
// entry whose fx and cx equal those of K, the intrinsics on the pair's line, within one part in a
// million. Null when none fits; BadInput where K fits entries that differ. K may be null.
// twoview_tools.formats states the same rules, and test/formats has cases that both languages pass.
const tv_camera* choose_camera(const NamedCameras& cameras, const std::string& image_name,
                               const double K[9]);

// The camera of an image of a set, for the pixels that its file holds: the chosen entry's lens with
// the intrinsics of K where the pair's line gives them. `cameras` may be empty, then K makes a
// pinhole. Throws BadInput when no entry fits, when the entry is for another size, when there is
// neither an entry nor K, and when K is not of this picture (files/camera_doubts.h).
tv_camera camera_of_image(const NamedCameras& cameras, const std::string& image_name, int width,
                          int height, const std::array<double, 9>* K);

}  // namespace cli
