// --live: a page on this computer's loopback interface that follows a flight. Only in a program
// that is built with libmicrohttpd; without it the constructor throws BadInput.
#pragma once

#include <memory>
#include <string>

#include "odometry/flight.h"

namespace cli {

class LivePage {
 public:
  // Serves at 127.0.0.1 from now on, in a thread of its own; port 0: any free one. Throws BadInput
  // where the port cannot be used.
  explicit LivePage(int port);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  // Such as http://127.0.0.1:8080/.
  std::string address() const;

  // Shows the flight after a frame whose picture is still at hand. While nobody looks at the page
  // it does nothing, and at most ten times a second it does something.
  void update(const Flight& flight);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
