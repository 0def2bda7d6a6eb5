// A session with a drone over the network, which owns its memory and is stepped for a verb.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "drone/drone.h"
#include "recording/driver_session.h"
#include "twoview_drivers/ardrone/sockets.h"

namespace cli {

// A drone on the network.
class Link {
 public:
  // `options` start from ardrone_session_options_init; callbacks and user are set here. Throws
  // BadInput for an unknown host. Sends nothing yet.
  Link(const DroneAddress& address, ardrone_session_options options, LinkListener listener);
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  ardrone_session* session() { return session_; }
  ardrone_counters counters() const;
  // Steps until `done` returns true, `stop` is set or the seconds are over (0: no end). `done` may
  // be empty and is called after each step. Returns whether `done` returned true.
  bool run(const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds);

 private:
  ardrone_sockets sockets_;
  ardrone_transport transport_;
  LinkListener listener_;
  SessionMemory memory_;
  ardrone_session* session_ = nullptr;
};

}  // namespace cli
