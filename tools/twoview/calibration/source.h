// The sources of pictures of a board: image files, a video file, or a live camera.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace cli {

// Receives each 8-bit grey image and its name. It returns false when no further image is needed.
using TakeFrame = std::function<bool(const cv::Mat& luma, const std::string& name)>;

// These functions throw BadInput for a source that cannot be read, and for images of different
// sizes.
void read_images(const std::vector<std::string>& paths, const TakeFrame& take);

// Returns true for a live source: a number of at most three digits that names no file, a path that
// begins with /dev/, or an address that contains "://".
bool is_live(const std::string& video);

// Reads four frames a second (every sixth frame if the rate is unknown), or 240 spread over a
// longer video. Throws BadInput for a file with less than 90 % of the frames that it states, which
// is truncated.
void read_video_file(const std::string& path, const TakeFrame& take);

// Reads four frames a second until `take` returns false, the duration is over, or Ctrl-C is
// pressed.
void read_live(const std::string& device, double duration_s, const TakeFrame& take);

}  // namespace cli
