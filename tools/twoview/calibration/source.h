// Where the pictures of a board come from: image files, a video file, or a live camera.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace cli {

// Is handed each 8-bit grey image and its name; false: enough.
using TakeFrame = std::function<bool(const cv::Mat& luma, const std::string& name)>;

// All throw BadInput for what cannot be read, and for images of different sizes.
void read_images(const std::vector<std::string>& paths, const TakeFrame& take);

// A number or /dev/video..., or an address with "://".
bool is_live(const std::string& video);

// Four frames a second of the video, at most 240 of the whole. A file that holds clearly fewer
// frames than it says is refused.
void read_video_file(const std::string& path, const TakeFrame& take);

// Four frames a second until `take` has enough, the time is over, or Ctrl-C.
void read_live(const std::string& device, double duration_s, const TakeFrame& take);

}  // namespace cli
