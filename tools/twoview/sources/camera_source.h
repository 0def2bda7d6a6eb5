// Any camera or film that OpenCV opens (V4L2, a file, a stream's address), as a frame source of the
// drivers' interface. A library of its own: OpenCV's videoio brings many others with it, and a
// program that films nothing need not load them.
#pragma once

#include <memory>
#include <string>

#include "twoview_drivers/source.h"

namespace cli {

class CameraSource {
 public:
  // A file gives each picture, whenever it is asked; times are those of its even rate, clock_id 1.
  // A live source films in a thread of its own: the latest picture is kept, older ones are left out
  // and make the next one's gap flag. Its host times are the steady clock's on arrival, and nobody
  // knows how much earlier a picture was taken.
  enum class Kind { kFile, kLive };

  // "0", "1", ...: a camera by its number, live. Else what cv::VideoCapture takes: a file,
  // /dev/video0, rtsp://... Throws BadInput when nothing opens.
  explicit CameraSource(const std::string& name);
  CameraSource(const std::string& name, Kind kind);
  ~CameraSource();
  CameraSource(const CameraSource&) = delete;
  CameraSource& operator=(const CameraSource&) = delete;

  // As source.h says; any number of frames may be held at once, and outlives this object. next and
  // release are called from one thread.
  tvs_frame_source frames();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
