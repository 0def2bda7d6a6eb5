// A camera, video file or stream that OpenCV opens (V4L2, a file, an address), as a frame source of
// the drivers' interface. It is a separate library, because OpenCV's videoio depends on many
// others, which a program without a camera should not load.
#pragma once

#include <memory>
#include <string>

#include "twoview_drivers/source.h"

namespace cli {

class CameraSource {
 public:
  // A file delivers every picture at the container's time (sources/film.h), with clock_id 1, and as
  // it is stored.
  // A live source reads pictures in a thread of its own and keeps only the latest; skipped pictures
  // set the gap flag of the next one. Its host times are those of the steady clock on arrival; the
  // unknown delay since the exposure is not included.
  // A paced source is a file that plays as a camera would: from the first call of `next` on, each
  // picture comes at its time, which is its host time on the steady clock.
  enum class Kind { kFile, kLive, kPaced };

  // `name` is "0", "1", ... for a live camera by its number; "v4l2:/dev/video0" for a camera by its
  // device; "gst:PIPELINE" for a GStreamer pipeline that ends with appsink, where OpenCV has
  // GStreamer; else any name that cv::VideoCapture accepts. It is live if it begins with /dev/,
  // v4l2: or gst:, or contains "://", and otherwise a file. Throws BadInput if it cannot be
  // opened.
  explicit CameraSource(const std::string& name);
  CameraSource(const std::string& name, Kind kind);
  // What a name's kind is, by the rule above: kLive or kFile.
  static Kind kind_of(const std::string& name);
  ~CameraSource();
  CameraSource(const CameraSource&) = delete;
  CameraSource& operator=(const CameraSource&) = delete;

  // The interface that source.h describes. Any number of frames may be held at once, and they may
  // outlive this object. Call next and release from one thread only.
  tvs_frame_source frames();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
