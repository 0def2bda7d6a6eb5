#include "sources/camera_source.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>
#include <thread>
#include <vector>

#include "base/error.h"
#include "sources/film.h"

namespace cli {
namespace {

bool is_number(const std::string& name) {
  return !name.empty() && name.size() < 4 &&
         name.find_first_not_of("0123456789") == std::string::npos;
}

bool begins(const std::string& name, const char* prefix) { return name.rfind(prefix, 0) == 0; }

// Opens a name that the header describes. Throws BadInput for a backend that this OpenCV lacks.
bool open_capture(cv::VideoCapture& capture, const std::string& name) {
  if (is_number(name)) return capture.open(std::stoi(name));
  if (begins(name, "v4l2:")) return capture.open(name.substr(5), cv::CAP_V4L2);
  if (begins(name, "gst:")) {
    const std::vector<cv::VideoCaptureAPIs> backends = cv::videoio_registry::getBackends();
    if (std::find(backends.begin(), backends.end(), cv::CAP_GSTREAMER) == backends.end())
      throw BadInput("this program's OpenCV was built without GStreamer, which gst: needs");
    return capture.open(name.substr(4), cv::CAP_GSTREAMER);
  }
  return capture.open(name);
}

int64_t steady_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// Silences OpenCV, which prints a message for each backend that fails; the program prints one line
// instead.
struct Silence {
  Silence() : before(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~Silence() { cv::utils::logging::setLogLevel(before); }
  const cv::utils::logging::LogLevel before;
};

// A picture with its arrival time; `number` counts from 0.
struct Shot {
  cv::Mat luma;
  uint64_t number = 0;
  bool began_anew = false;  // its stream's clock
  tvs_time time{};
};

}  // namespace

struct CameraSource::State {
  explicit State(Kind given) : kind(given) {}

  bool take(Shot& shot);
  void wait_until(int64_t due_ns) const;
  void film();
  tvs_status next(tvs_frame* frame);

  const Kind kind;
  std::unique_ptr<Film> film_file;  // of a file that is not live; else `capture`
  cv::VideoCapture capture;
  cv::Mat colour;
  uint64_t num_taken = 0, next_number = 0;
  int64_t start_ns = 0;
  // For a live source: the state that the filming thread shares with the reader.
  std::mutex mutex;
  Shot latest;
  bool has_latest = false, has_ended = false;
  std::atomic<bool> stop{false};
  std::thread thread;
};

// Waits for the next picture of the file or camera. Returns false at the end.
bool CameraSource::State::take(Shot& shot) {
  try {
    if (film_file ? !film_file->next() : !capture.grab()) return false;
    if (film_file)
      colour = film_file->picture();
    else
      capture.retrieve(colour);
    if (colour.empty()) return false;
    shot.luma = cv::Mat();
    if (colour.channels() == 1)
      shot.luma = colour.clone();
    else
      cv::cvtColor(colour, shot.luma, cv::COLOR_BGR2GRAY);
  } catch (const cv::Exception&) {
    return false;  // OpenCV throws if the device was disconnected
  }
  if (shot.luma.depth() != CV_8U) return false;
  shot.number = num_taken++;
  shot.began_anew = film_file && film_file->began_anew();
  shot.time = tvs_time{};
  if (kind == Kind::kLive) {
    shot.time.received_ns = shot.time.host_ns = steady_ns();
    shot.time.uncertainty_ns = INT64_MAX;
    return true;
  }
  double seconds = 0;
  if (film_file) {
    seconds = film_file->time_s();
  } else {  // what OpenCV plays that is no file, such as numbered pictures
    const double fps = capture.get(cv::CAP_PROP_FPS);
    seconds = static_cast<double>(shot.number) / (fps > 0 && fps < 1e4 ? fps : 30);
  }
  shot.time.received_ns = shot.time.host_ns = start_ns + std::llround(seconds * 1e9);
  if (kind == Kind::kFile) {
    shot.time.device_ns = shot.time.host_ns;
    shot.time.clock_id = 1;
  }
  return true;
}

void CameraSource::State::wait_until(int64_t due_ns) const {
  while (!stop && steady_ns() < due_ns)
    std::this_thread::sleep_for(
        std::chrono::nanoseconds(std::min<int64_t>(due_ns - steady_ns(), 20000000)));
}

void CameraSource::State::film() {
  Shot shot;
  start_ns = steady_ns();
  while (!stop && take(shot)) {
    if (kind == Kind::kPaced) wait_until(shot.time.host_ns);
    const std::lock_guard<std::mutex> lock(mutex);
    latest = shot;
    has_latest = true;
  }
  const std::lock_guard<std::mutex> lock(mutex);
  has_ended = true;
}

tvs_status CameraSource::State::next(tvs_frame* frame) {
  if (frame == nullptr) return TVS_ERR_NULL;
  if (frame->struct_size != sizeof *frame) return TVS_ERR_STRUCT_SIZE;
  auto shot = std::make_unique<Shot>();
  if (kind == Kind::kFile) {
    if (!take(*shot)) return TVS_END;
  } else {
    if (kind == Kind::kPaced && !thread.joinable()) thread = std::thread([this] { film(); });
    const std::lock_guard<std::mutex> lock(mutex);
    if (!has_latest) return has_ended ? TVS_END : TVS_NONE;
    *shot = std::move(latest);
    has_latest = false;
  }
  const bool gap = shot->number != next_number || shot->began_anew;
  frame->flags =
      TVS_FRAME_KEY | (gap ? TVS_FRAME_GAP : 0) | (next_number == 0 ? TVS_FRAME_NEW_STREAM : 0);
  next_number = shot->number + 1;
  frame->image = {shot->luma.data, shot->luma.cols, shot->luma.rows,
                  static_cast<int64_t>(shot->luma.step)};
  frame->number = shot->number;
  frame->time = shot->time;
  std::memset(&frame->attitude, 0, sizeof frame->attitude);
  frame->handle = shot.release();
  return TVS_OK;
}

CameraSource::Kind CameraSource::kind_of(const std::string& name) {
  const bool is_live = is_number(name) || begins(name, "/dev/") || begins(name, "v4l2:") ||
                       begins(name, "gst:") || name.find("://") != std::string::npos;
  return is_live ? Kind::kLive : Kind::kFile;
}

CameraSource::CameraSource(const std::string& name) : CameraSource(name, kind_of(name)) {}

CameraSource::CameraSource(const std::string& name, Kind kind)
    : state_(std::make_unique<State>(kind)) {
  bool is_open = false;
  const Silence silence;
  try {
    std::error_code error;
    if (kind != Kind::kLive && std::filesystem::is_regular_file(name, error)) {
      state_->film_file = std::make_unique<Film>(name);
      is_open = true;
    } else {
      is_open = open_capture(state_->capture, name);
    }
  } catch (const cv::Exception&) {
  }
  if (!is_open)
    throw BadInput("no camera or film opens as '" + name + "'" +
                   (begins(name, "gst:") ? "; Debian's packages gstreamer1.0-plugins-base and "
                                           "-good have most of GStreamer's elements"
                                         : ""));
  if (kind == Kind::kLive) state_->thread = std::thread([this] { state_->film(); });
}

CameraSource::~CameraSource() {
  state_->stop = true;
  if (state_->thread.joinable()) state_->thread.join();
}

tvs_frame_source CameraSource::frames() {
  tvs_frame_source source{};
  source.struct_size = sizeof source;
  source.user = state_.get();
  source.next = [](void* user, tvs_frame* frame) { return static_cast<State*>(user)->next(frame); };
  source.release = [](void*, tvs_frame* frame) {
    if (frame != nullptr) delete static_cast<Shot*>(frame->handle);
  };
  return source;
}

}  // namespace cli
