#include "drone/link.h"

#include <algorithm>
#include <utility>

namespace cli {
namespace {

constexpr int64_t kLongestWaitNs = 20000000;

}  // namespace

Link::Link(const DroneAddress& address, ardrone_session_options options, LinkListener listener)
    : listener_(std::move(listener)) {
  check_driver(ardrone_sockets_init(&sockets_, address.host.c_str(), &transport_),
               "no host " + address.host);
  sockets_.port[ARDRONE_CHANNEL_AT] = static_cast<uint16_t>(address.at_port);
  sockets_.port[ARDRONE_CHANNEL_NAVDATA] = static_cast<uint16_t>(address.navdata_port);
  sockets_.port[ARDRONE_CHANNEL_VIDEO] = static_cast<uint16_t>(address.video_port);
  sockets_.port[ARDRONE_CHANNEL_CONTROL] = static_cast<uint16_t>(address.control_port);
  set_callbacks(listener_, options);
  session_ = make_session(options, transport_, memory_);
}

Link::~Link() { ardrone_session_close(session_); }

ardrone_counters Link::counters() const {
  ardrone_counters counters;
  ardrone_session_counters(session_, &counters);
  return counters;
}

bool Link::run(const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds) {
  const int64_t start = ardrone_now_ns();
  const int64_t end = seconds > 0 ? start + static_cast<int64_t>(seconds * 1e9) : INT64_MAX;
  while (!stop) {
    const int64_t now = ardrone_now_ns();
    if (now >= end) return false;
    ardrone_session_step(session_, now);
    if (done && done()) return true;
    ardrone_session_wait(session_, std::min(end, now + kLongestWaitNs));
  }
  return false;
}

}  // namespace cli
