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
#include "files/folder.h"
#include "files/image_file.h"
#include "sources/film.h"

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
  return luma_of(frame);
}

// Without this, libav prints lines of its own on stderr.
void silence_decoders() { ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0); }

std::string frame_name(int64_t index) {
  char text[32];
  std::snprintf(text, sizeof text, "frame %05lld", static_cast<long long>(index));
  return text;
}

}  // namespace

std::vector<std::string> read_images(const std::vector<std::string>& paths, const TakeFrame& take,
                                     const LeaveOut& leave_out) {
  std::vector<cv::Size> sizes;
  for (const std::string& path : paths) sizes.push_back(header_size(path));
  cv::Size usual = most_frequent(sizes);
  std::string first_problem;
  int num_taken = 0;
  bool has_more = false;
  for (const std::string& path : paths) {
    const std::string name = std::filesystem::path(path).filename().string();
    Picture picture;
    try {
      picture = load_picture(path);
    } catch (const BadInput& e) {
      std::error_code error;
      if (!std::filesystem::exists(path, error)) throw;  // a name that was not meant
      if (first_problem.empty()) first_problem = e.what();
      leave_out(name, true, e.what());
      continue;
    }
    if (usual.area() == 0) usual = picture.luma.size();  // no header tells
    if (picture.luma.size() != usual) {
      leave_out(name, false, size_text(picture.luma.size()) + ", most are " + size_text(usual));
      continue;
    }
    ++num_taken;
    has_more = has_more || picture.has_more;
    if (!take(picture.luma, picture.name)) break;
  }
  if (num_taken == 0) throw BadInput(first_problem);
  return has_more ? std::vector<std::string>{kMoreNote} : std::vector<std::string>{};
}

bool is_live(const std::string& video) {
  const bool is_number = !video.empty() && video.size() < 4 &&
                         video.find_first_not_of("0123456789") == std::string::npos;
  return (is_number && !std::filesystem::exists(video)) || video.rfind("/dev/", 0) == 0 ||
         video.find("://") != std::string::npos;
}

std::vector<std::string> read_video_file(const std::string& path, const TakeFrame& take) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    throw BadInput("video " + path + ": No such file or directory");
  if (!std::filesystem::is_regular_file(path, error))
    throw BadInput("video " + path + " is not a file");
  Film video(path);
  const FilmFacts& facts = video.facts();
  std::vector<std::string> notes;
  if (const std::string stored = stored_words(facts); !stored.empty())
    notes.push_back(stored + ": the camera is of such pictures");
  if (facts.pixel_aspect != 1)
    notes.push_back("the video's pixels are not square, so fx and fy of the camera differ");
  if (facts.is_joined) notes.emplace_back(kJoinedNote);
  if (facts.is_interlaced) notes.emplace_back(kInterlacedNote);
  const auto promised = static_cast<double>(video.num_promised());
  const double fps = facts.rate_hz;
  double step = fps > 1 && fps < 1000 ? fps / kLooksPerSecond : 6;
  step = std::max(step, promised / kMaxLooks);
  const auto stride = std::max<int64_t>(1, std::llround(step));
  int64_t index = 0;
  int num_looks = 0;
  for (; index < kMaxFrames && video.next(); ++index) {
    if (index % stride != 0) continue;
    const cv::Mat frame = video.picture();
    if (frame.empty()) break;
    if (++num_looks > kMaxLooks || !take(grey_frame(frame, path), frame_name(index))) return notes;
  }
  if (static_cast<double>(index) < kMinShareOfFrames * promised)
    throw BadInput("video " + path + " ends early, after " + std::to_string(index) + " of " +
                   std::to_string(std::llround(promised)) +
                   " frames: copy or record it again, or save its good frames as images");
  if (const std::string words = other_size_words(facts); !words.empty()) notes.push_back(words);
  return notes;
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
