// Films and cameras that OpenCV opens as sources of frames.

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/error.h"
#include "base/silence.h"
#include "files/image_file.h"
#include "odometry/frames.h"
#include "pair/session.h"

namespace cli {
namespace {

cv::Mat luma_of(const cv::Mat& picture) {
  cv::Mat luma;
  if (picture.depth() != CV_8U) return luma;
  switch (picture.channels()) {
    case 1: return picture;
    case 3: cv::cvtColor(picture, luma, cv::COLOR_BGR2GRAY); return luma;
    case 4: cv::cvtColor(picture, luma, cv::COLOR_BGRA2GRAY); return luma;
    default: return luma;
  }
}

class Film : public FrameSource {
 public:
  Film(const std::string& file, double fps) : file_(file), fps_(fps) {
    cv::VideoCapture film;
    {
      const StderrSilence silence;  // FFmpeg prints messages
      film.open(file);
    }
    if (!film.isOpened()) {
      const std::string picture = unread_picture_file(file);
      if (!picture.empty()) throw BadInput(file + " " + picture);
      throw BadInput("cannot read " + file + ": it is no film that OpenCV reads");
    }
    if (fps_ > 0) return;
    fps_ = film.get(cv::CAP_PROP_FPS);
    if (!(fps_ > 0 && fps_ < 1e5))
      throw BadInput("--fps is required: " + file + " does not say its frames a second");
  }

  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    cv::VideoCapture film(file_);
    cv::Mat picture;
    for (int index = 0; !stop && film.grab(); ++index) {
      if (!wanted(index)) continue;
      SourceFrame frame;
      frame.index = index;
      char name[40];
      std::snprintf(name, sizeof name, "frame_%06d.png", index);
      frame.name = name;
      frame.time_s = index / fps_;
      if (film.retrieve(picture)) frame.luma = luma_of(picture);
      if (frame.luma.empty())
        frame.problem = "frame " + frame.name + " of " + file_ + " does not decode";
      if (!consume(frame)) return;
    }
  }
  bool can_run_again() const override { return true; }
  int num_frames() const override { return -1; }  // what the file's header says may be wrong
  std::string kind() const override { return "a film"; }
  std::vector<std::string> files() const override { return {file_}; }

 private:
  std::string file_;
  double fps_;
};

class Camera : public FrameSource {
 public:
  explicit Camera(int number) : number_(number) {
    if (!camera_.open(number)) throw BadInput("cannot open camera " + std::to_string(number));
  }
  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    cv::Mat picture;
    const uint64_t start = now_ns();
    double last = -1;
    for (int index = 0; !stop && camera_.grab(); ++index) {
      SourceFrame frame;
      frame.time_s = static_cast<double>(now_ns() - start) * 1e-9;
      if (!wanted(index) || !(frame.time_s > last)) continue;
      last = frame.time_s;
      frame.index = index;
      frame.name = "frame_" + std::to_string(index) + ".png";
      if (camera_.retrieve(picture)) frame.luma = luma_of(picture);
      if (frame.luma.empty()) frame.problem = "a frame does not decode";
      if (!consume(frame)) return;
    }
  }
  bool can_run_again() const override { return false; }
  int num_frames() const override { return -1; }
  std::string kind() const override { return "camera " + std::to_string(number_); }

 private:
  int number_;
  cv::VideoCapture camera_;
};

}  // namespace

std::unique_ptr<FrameSource> open_film(const std::string& file, double fps) {
  return std::make_unique<Film>(file, fps);
}

std::unique_ptr<FrameSource> open_camera(int number) { return std::make_unique<Camera>(number); }

}  // namespace cli
