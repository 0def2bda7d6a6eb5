// Where the frames of an odometry come from: a source gives them one after the other, with what is
// known of the camera at each.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/matrix.h"
#include "files/exif.h"
#include "sources/film.h"
#include "twoview/camera.h"
#include "twoview/odometry.h"

namespace cli {

// A frame as its source gives it. The units are those of tv_odometry_frame.
struct SourceFrame {
  int index = 0;  // among all frames of the source, from 0; frames that are left out count
  std::string name;
  double time_s = 0;
  cv::Mat luma;                           // 8-bit; empty where the frame cannot be read
  cv::Mat colour;                         // 8-bit BGR, where the source has colours
  std::string file;                       // which holds just these pixels; empty: none does
  std::string problem;                    // why luma is empty
  ExifFocal exif;                         // of a photograph
  bool gap = false;                       // frames were lost before this one
  std::optional<Matrix3> world_from_cam;  // the vehicle's attitude; the world's z axis points down
  double attitude_sigma_rad = 0;
  std::optional<double> height_m;
  double height_sigma_m = 0;
  std::optional<Vector3> velocity_m_s;  // along the axes of the camera
  double velocity_sigma_m_s = 0;
  // The turn since the frame that the source gave before.
  std::optional<Matrix3> previous_from_cam;
  double turn_sigma_rad = 0;
};

class FrameSource {
 public:
  // Whether the frame with this index is to be decoded.
  using Wanted = std::function<bool(int index)>;
  // Receives a frame; returns false to end the run.
  using Consumer = std::function<bool(const SourceFrame& frame)>;

  virtual ~FrameSource() = default;
  // Gives the wanted frames in their order until the end of the source, until the consumer returns
  // false, or until `stop` is set. Throws BadInput.
  virtual void run(const Wanted& wanted, const Consumer& consume,
                   const std::atomic<bool>& stop) = 0;
  // Whether a second run gives the same frames again.
  virtual bool can_run_again() const = 0;
  // How many frames the source has; -1 where it is not known beforehand.
  virtual int num_frames() const = 0;
  // The kind of the source in words, such as "a set folder".
  virtual std::string kind() const = 0;
  // The camera of a frame's file of this size as the source itself describes it; empty where it
  // does not. Throws BadInput where its description does not fit.
  virtual std::optional<tv_camera> camera(const SourceFrame& frame, int width, int height) const {
    (void)frame, (void)width, (void)height;
    return {};
  }
  // The file of true poses that belongs to the source; empty where there is none.
  virtual std::string truth_file() const { return ""; }
  // The times of all frames, in seconds, where they are known beforehand; truths without times (of
  // KITTI) have a pose for each of these.
  virtual std::vector<double> times() const { return {}; }
  // The names of all frames, where they are known beforehand.
  virtual std::vector<std::string> names() const { return {}; }
  // The focal lengths as for 35 mm film in the EXIF data of the frames that have one.
  virtual std::vector<double> focals_35mm() const { return {}; }
  // The pose of the camera in the frame of the vehicle that the source's truth describes (EuRoC's
  // T_BS), row-major 3 x 4; empty: the truth describes the camera.
  virtual std::optional<std::array<double, 12>> body_from_camera() const { return {}; }
  // What the user must know of the source, as lines without an end. After run() what became known
  // while the frames were read is among them.
  virtual std::vector<std::string> notes() const { return {}; }
  // What a film's container says; empty for other sources.
  virtual std::optional<FilmFacts> film() const { return {}; }
  // By how much a viewer turns the frames clockwise: 0, 90, 180 or 270 degrees. After run() for
  // photographs.
  virtual int turn_deg() const { return 0; }
  // The width of a pixel over its height.
  virtual double pixel_aspect() const { return 1; }
  // Fits a given camera and the pictures to each other where they are known to differ: a film that
  // a player turns or stretches.
  virtual void fit(tv_camera& camera) { (void)camera; }
  // Whether `found` is to be called after each frame.
  virtual bool wants_found() const { return false; }
  // Says what was found of the frame that was given last. previous: R and t, world_from_cam, of the
  // frame before it in the map as it is now, where it had a pose of the same segment.
  virtual void found(const tv_odometry_state& state,
                     const std::optional<std::array<double, 12>>& previous) {
    (void)state, (void)previous;
  }
  // The files that the source reads, which no output may replace.
  virtual std::vector<std::string> files() const { return {}; }
};

// The folders of images: a set folder (frames.txt), TUM RGB-D (rgb.txt), EuRoC (mav0/cam0), KITTI
// (image_0, times.txt), or any images in the order of their names at `fps` frames a second (0: not
// given). with_imu: the imu.txt of a set folder is read where there is one. is_sequence: false
// where the order of the pictures does not count, so that they may be of several sequences. Throws
// BadInput with one line for what is missing or wrong.
std::unique_ptr<FrameSource> open_image_folder(const std::string& folder, double fps, bool with_imu,
                                               bool is_sequence = true);

// A film of any format that OpenCV reads. fps 0: the film's own times.
std::unique_ptr<FrameSource> open_film(const std::string& file, double fps);

// The camera with this number on this computer.
std::unique_ptr<FrameSource> open_camera(int number);

// A camera or stream by a name of CameraSource (sources/camera_source.h). A frame that comes while
// the one before it is tracked is left out, and the next one has its gap set.
// Only in a program with the drivers.
std::unique_ptr<FrameSource> open_camera(const std::string& name);

}  // namespace cli
