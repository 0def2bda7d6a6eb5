// The drone's camera: a thread that paints a picture at each frame time and encodes it, so that
// slow pictures never hold up navdata.
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
  FlightState truth;  // at the exposure
  int64_t uptime_ns = 0;
  int width = 0, height = 0;
};

class CameraLoop {
 public:
  CameraLoop(const ServerOptions& options, const room::Room& room);
  ~CameraLoop();

  // What the next picture is to see. Replaces one that was not begun yet.
  void expose(const FlightState& truth, int64_t uptime_ns, bool is_720p);
  // Finished pictures, oldest first.
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
