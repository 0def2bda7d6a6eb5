// A simulated drone on this computer's loopback interface: all its ports, its flight, its camera,
// and simulated network faults.
#pragma once

#include <atomic>
#include <memory>

#include "simulator/server_options.h"

namespace simulator {

// Counts of the server's events, which a test compares with those of a driver.
struct ServerCounts {
  int64_t commands_obeyed = 0, commands_refused = 0, take_offs = 0, navdata_sent = 0,
          frames_sent = 0, frames_left_out = 0, video_cuts = 0, video_stalls = 0, reboots = 0;
};

class Server {
 public:
  // Binds every port. Throws std::runtime_error if a port cannot be bound.
  explicit Server(const ServerOptions& options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  Ports ports() const;
  // Serves until `stop` is true or the time is over (0: without a limit).
  void run(const std::atomic<bool>& stop, double seconds);
  ServerCounts counts() const;
  // The true state of the drone. It may be called from any thread.
  FlightState truth() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace simulator
