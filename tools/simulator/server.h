// A drone on this computer's loopback: all its ports, its flight, its camera, and the faults of a
// bad day.
#pragma once

#include <atomic>
#include <memory>

#include "simulator/server_options.h"

namespace simulator {

// What happened, for the one who tests a driver.
struct ServerCounts {
  int64_t commands_obeyed = 0, commands_refused = 0, take_offs = 0, navdata_sent = 0,
          frames_sent = 0, frames_left_out = 0, video_cuts = 0, video_stalls = 0, reboots = 0;
};

class Server {
 public:
  // Binds every port. Throws std::runtime_error.
  explicit Server(const ServerOptions& options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  Ports ports() const;
  // Serves until `stop` is true or the seconds are over (0: no end).
  void run(const std::atomic<bool>& stop, double seconds);
  ServerCounts counts() const;
  // Where the drone is; from any thread.
  FlightState truth() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace simulator
