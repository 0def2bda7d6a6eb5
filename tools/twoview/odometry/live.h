// --live: a page on this computer's loopback interface that follows a flight, and with --room shows
// the surface as it grows. Only in a program that is built with libmicrohttpd; without it the
// constructor throws BadInput.
#pragma once

#include <memory>
#include <string>

#include "odometry/flight.h"

namespace cli {

class LivePage {
 public:
  // Serves at 127.0.0.1 from now on, in a thread of its own; port 0: any free one. shows_room: with
  // a coarse surface of what was seen while somebody looked. Throws BadInput where the port cannot
  // be used.
  LivePage(int port, bool shows_room);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  // Such as http://127.0.0.1:8080/.
  std::string address() const;

  // Shows the flight after a frame whose picture is still at hand. While nobody looks at the page
  // it does nothing, and it takes at most 2 % of the CPU time of the calling thread: it copies what
  // another thread, of low priority, makes depth maps, surfaces, JPEG and JSON from.
  void update(const Flight& flight);
  // What is done after the flight, for people; the page shows it in place of the status.
  void tell(const std::string& stage);
  // Shows this surface in place of the one that has grown; as surface_bytes() has it.
  void show(std::string surface, size_t num_keyframes);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
