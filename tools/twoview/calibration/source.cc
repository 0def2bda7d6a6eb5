#include "calibration/source.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/error.h"
#include "base/output.h"
#include "files/image_file.h"

namespace cli {
namespace {

constexpr double kLooksPerSecond = 4;
constexpr int kMaxLooks = 240;
// A container may round the number of frames that it states.
constexpr double kMinShareOfFrames = 0.9;
constexpr int64_t kMaxFrames = 1000000;  // most frames that are read; an endless stream has more

std::string size_text(cv::Size size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

cv::Mat grey_frame(const cv::Mat& frame, const std::string& name) {
  if (frame.empty() || frame.depth() != CV_8U || frame.cols > kMaxSide || frame.rows > kMaxSide)
    throw BadInput("video " + name + " has frames that cannot be used");
  if (frame.channels() == 1) return frame;
  cv::Mat grey;
  cv::cvtColor(frame, grey, frame.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  return grey;
}

// Without this, libav prints lines of its own on stderr.
void silence_decoders() { ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0); }

std::string frame_name(int64_t index) {
  char text[32];
  std::snprintf(text, sizeof text, "frame %05lld", static_cast<long long>(index));
  return text;
}

}  // namespace

void read_images(const std::vector<std::string>& paths, const TakeFrame& take) {
  cv::Size size;
  for (const std::string& path : paths) {
    const Picture picture = load_picture(path);
    if (size.area() == 0) size = picture.luma.size();
    if (picture.luma.size() != size)
      throw BadInput("image " + path + " is " + size_text(picture.luma.size()) + ", but " +
                     paths[0] + " is " + size_text(size) +
                     ": take all with one camera at one resolution, and do not turn or crop them");
    if (!take(picture.luma, picture.name)) return;
  }
}

bool is_live(const std::string& video) {
  const bool is_number = !video.empty() && video.size() < 4 &&
                         video.find_first_not_of("0123456789") == std::string::npos;
  return (is_number && !std::filesystem::exists(video)) || video.rfind("/dev/", 0) == 0 ||
         video.find("://") != std::string::npos;
}

void read_video_file(const std::string& path, const TakeFrame& take) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    throw BadInput("video " + path + ": No such file or directory");
  if (!std::filesystem::is_regular_file(path, error))
    throw BadInput("video " + path + " is not a file");
  silence_decoders();
  cv::VideoCapture video(path, cv::CAP_FFMPEG);
  if (!video.isOpened())
    throw BadInput("video " + path +
                   " is no video that can be read, or is cut off: record or copy it again");
  const double promised = video.get(cv::CAP_PROP_FRAME_COUNT);
  const double fps = video.get(cv::CAP_PROP_FPS);
  double step = fps > 1 && fps < 1000 ? fps / kLooksPerSecond : 6;
  if (promised > 0 && promised < 1e9) step = std::max(step, promised / kMaxLooks);
  const auto stride = std::max<int64_t>(1, std::llround(step));
  int64_t index = 0;
  int num_looks = 0;
  for (; index < kMaxFrames && video.grab(); ++index) {
    if (index % stride != 0) continue;
    cv::Mat frame;
    if (!video.retrieve(frame)) break;
    if (++num_looks > kMaxLooks || !take(grey_frame(frame, path), frame_name(index))) return;
  }
  if (promised > 0 && promised < 1e9 && static_cast<double>(index) < kMinShareOfFrames * promised)
    throw BadInput("video " + path + " ends early, after " + std::to_string(index) + " of " +
                   std::to_string(std::llround(promised)) +
                   " frames: copy or record it again, or save its good frames as images");
}

void read_live(const std::string& device, double duration_s, const TakeFrame& take) {
  const bool is_number = device.find_first_not_of("0123456789") == std::string::npos;
  silence_decoders();
  cv::VideoCapture video;
  if (is_number)
    video.open(std::stoi(device));
  else
    video.open(device);
  if (!video.isOpened())
    throw BadInput("camera " + device + " cannot be opened: is it plugged in, free and allowed?");
  using Clock = std::chrono::steady_clock;
  const std::atomic<bool>& stop = stop_flag_for_signals();
  const auto start = Clock::now();
  auto next = start;
  for (int64_t index = 0; !stop; ++index) {
    const auto now = Clock::now();
    if (std::chrono::duration<double>(now - start).count() > duration_s) return;
    if (!video.grab())
      throw BadInput("camera " + device + " stopped after " + std::to_string(index) + " frames");
    if (now < next) continue;
    next = now + std::chrono::milliseconds(static_cast<int>(1000 / kLooksPerSecond));
    cv::Mat frame;
    if (video.retrieve(frame) && !take(grey_frame(frame, device), frame_name(index))) return;
  }
}

}  // namespace cli
