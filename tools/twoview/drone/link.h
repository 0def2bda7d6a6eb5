// A session with a drone over the network. It owns the driver's memory and runs the driver for a
// verb.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "drone/options.h"
#include "recording/driver_session.h"
#include "twoview_drivers/ardrone/sockets.h"

namespace cli {

// The connection to a drone on the network.
class Link {
 public:
  // `options` must be initialised by ardrone_session_options_init; this class sets their callbacks
  // and user pointer. Throws BadInput for an unknown host. The constructor sends nothing.
  Link(const DroneAddress& address, ardrone_session_options options, LinkListener listener);
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  ardrone_session* session() { return session_; }
  ardrone_counters counters() const;
  // Runs the session until `done` returns true, `stop` is set, or the time is over (0: no limit).
  // `done` may be empty; it is called after each step. Returns true if `done` returned true.
  bool run(const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds);

 private:
  ardrone_sockets sockets_;
  ardrone_transport transport_;
  LinkListener listener_;
  SessionMemory memory_;
  ardrone_session* session_ = nullptr;
};

}  // namespace cli
