// The sources of pictures of a board: image files, a video file, or a live camera.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace cli {

// Receives each 8-bit grey image and its name. It returns false when no further image is needed.
using TakeFrame = std::function<bool(const cv::Mat& luma, const std::string& name)>;

// Receives the name of an image that is left out, whether it cannot be read (else it is of another
// size than most), and the details.
using LeaveOut =
    std::function<void(const std::string& name, bool is_unreadable, const std::string& detail)>;

// These functions throw BadInput for a source that cannot be read. An image that cannot be read, or
// is of another size than most of them, is left out; BadInput where none is left, or where a file
// is missing.
// Returns what the user must know of the images, as lines without an end.
std::vector<std::string> read_images(const std::vector<std::string>& paths, const TakeFrame& take,
                                     const LeaveOut& leave_out);

// Returns true for a live source: a number of at most three digits that names no file, a path that
// begins with /dev/, or an address that contains "://".
bool is_live(const std::string& video);

// Reads four frames a second (every sixth frame if the rate is unknown), or 240 spread over a
// longer video. Throws BadInput for a file with less than 90 % of the frames that it states, which
// is truncated. Returns what the user must know of the video, as lines without an end.
std::vector<std::string> read_video_file(const std::string& path, const TakeFrame& take);

// Reads four frames a second until `take` returns false, the duration is over, or Ctrl-C is
// pressed.
void read_live(const std::string& device, double duration_s, const TakeFrame& take);

}  // namespace cli
