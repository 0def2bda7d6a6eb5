// The drone's camera: a thread that renders and encodes each requested picture, so that a slow
// picture never delays the navdata.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "simulator/film.h"
#include "simulator/server_options.h"

namespace simulator {

struct CodedFrame {
  FilmPacket packet;
  FlightState truth;  // the drone's state when the picture was exposed
  int64_t uptime_ns = 0;
  int width = 0, height = 0;
};

class CameraLoop {
 public:
  CameraLoop(const ServerOptions& options, const room::Room& room);
  ~CameraLoop();

  // Requests the next picture, seen from `truth`. It replaces a requested picture that the thread
  // has not started.
  void expose(const FlightState& truth, int64_t uptime_ns, bool is_720p);
  // Returns the encoded pictures, oldest first, and removes them from the queue.
  std::deque<CodedFrame> take();

 private:
  void work();
  CodedFrame make(const CodedFrame& wanted);

  const ServerOptions& options_;
  const room::Room& room_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stop_ = false, has_wish_ = false;
  CodedFrame wish_;
  std::deque<CodedFrame> done_;
  std::unique_ptr<Film> film_;
  std::unique_ptr<room::Eye> eye_;
  std::vector<uint8_t> luma_;
  uint64_t num_made_ = 0;
  std::thread thread_;
};

}  // namespace simulator
