// Films and cameras that OpenCV opens as sources of frames.

#include <cmath>
#include <cstdlib>
#include <opencv2/videoio.hpp>
#include <utility>

#include "base/error.h"
#include "base/silence.h"
#include "files/camera_formats.h"
#include "files/image_file.h"
#include "odometry/frames.h"
#include "pair/session.h"
#include "sources/film.h"

namespace cli {
namespace {

// Whether the camera file is for the size at which a player shows these pictures with square
// pixels. Players keep either the width or the height.
bool is_shown_size(const tv_camera& camera, int width, int height, double pixel_aspect) {
  const auto is_near = [&](double w, double h) {
    return std::abs(camera.width - w) <= 1 && std::abs(camera.height - h) <= 1;
  };
  return pixel_aspect != 1 &&
         (is_near(width * pixel_aspect, height) || is_near(width, height / pixel_aspect));
}

class FilmSource : public FrameSource {
 public:
  FilmSource(const std::string& file, double fps) : file_(file), fps_(fps) {
    const StderrSilence silence;  // FFmpeg prints messages
    try {
      facts_ = Film(file, fps).facts();
    } catch (const BadInput&) {
      const std::string picture = unread_picture_file(file);
      if (picture.empty()) throw;
      throw BadInput(file + " " + picture);
    }
  }

  int turn_deg() const override { return is_turned_ ? 0 : facts_.turn_deg; }
  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    Film film(file_, fps_);
    bool goes_on = true, gap = false;
    while (goes_on && !stop && film.next()) {
      SourceFrame frame;
      frame.index = static_cast<int>(film.index());
      gap = gap || film.began_anew();
      if (!wanted(frame.index)) continue;
      frame.gap = std::exchange(gap, false);
      char name[40];
      std::snprintf(name, sizeof name, "frame_%06d.png", frame.index);
      frame.name = name;
      frame.time_s = film.time_s();
      frame.colour = turned(film.picture());
      frame.luma = luma_of(frame.colour);
      if (frame.luma.empty())
        frame.problem = "frame " + frame.name + " of " + file_ + " does not decode";
      goes_on = consume(frame);
    }
    if (film.index() <= last_index_) return;  // of a second run that ended sooner
    last_index_ = film.index();
    facts_ = film.facts();
    film_notes_ = film.notes();
  }
  bool can_run_again() const override { return true; }
  int num_frames() const override { return -1; }  // what the file's header says may be wrong
  std::string kind() const override { return "a film"; }
  std::vector<std::string> files() const override { return {file_}; }
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = film_notes_;
    if (facts_.turn_deg != 0 || facts_.is_mirrored) notes.push_back(turn_note());
    if (facts_.pixel_aspect != 1) notes.push_back(aspect_note());
    return notes;
  }
  std::optional<FilmFacts> film() const override { return facts_; }
  double pixel_aspect() const override { return facts_.pixel_aspect; }
  void fit(tv_camera& camera) override;

 private:
  std::string turn_note() const;
  std::string aspect_note() const;
  cv::Mat turned(const cv::Mat& pixels) const {
    if (!is_turned_ || pixels.empty()) return pixels;
    Picture picture;
    picture.luma = picture.colour = pixels;
    turn(picture, -facts_.turn_deg / 90);
    return picture.colour;
  }

  std::string file_;
  double fps_;
  FilmFacts facts_;
  int64_t last_index_ = -1;
  std::vector<std::string> film_notes_;
  bool is_turned_ = false;        // the camera is of the pictures as a player turns them
  bool camera_is_shown_ = false;  // the camera is of square pixels
};

// A camera belongs to the pictures as they are stored where it has their size. One of the size at
// which a player shows them belongs to those: a quarter turn is done on the pictures, and a stretch
// is undone on the camera.
void FilmSource::fit(tv_camera& camera) {
  const int width = facts_.width, height = facts_.height;
  const bool can_turn = facts_.turn_deg % 180 != 0;
  if (camera.width == width && camera.height == height) return;
  if (can_turn && camera.width == height && camera.height == width) {
    is_turned_ = true;
  } else if (is_shown_size(camera, width, height, facts_.pixel_aspect)) {
    camera_is_shown_ = true;
    camera = resized(camera, width, height);
  } else if (can_turn && is_shown_size(camera, height, width, 1 / facts_.pixel_aspect)) {
    is_turned_ = camera_is_shown_ = true;
    camera = resized(camera, height, width);
  }
}

std::string FilmSource::turn_note() const {
  if (is_turned_)
    return "the pictures are turned by " + std::to_string(facts_.turn_deg) +
           " degrees clockwise, as a player does: the camera is of that size";
  return stored_words(facts_) + ": so is the map, and the camera must be of stored pictures";
}

std::string FilmSource::aspect_note() const {
  char text[200];
  std::snprintf(text, sizeof text, "the film's pixels are %.4g times as wide as high: %s",
                facts_.pixel_aspect,
                camera_is_shown_
                    ? "the camera, of square pixels, was scaled to them"
                    : "a camera file is taken as of these pixels, --focal-35mm as of square ones");
  return text;
}

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
      if (camera_.retrieve(picture)) {
        frame.luma = luma_of(picture);
        frame.colour = picture;
      }
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
  return std::make_unique<FilmSource>(file, fps);
}

std::unique_ptr<FrameSource> open_camera(int number) { return std::make_unique<Camera>(number); }

}  // namespace cli
