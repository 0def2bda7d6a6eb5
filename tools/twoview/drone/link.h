// A session with a drone over the network, owned and stepped for a verb.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drone/drone.h"
#include "twoview_drivers/ardrone/session.h"
#include "twoview_drivers/ardrone/sockets.h"

namespace cli {

// What a verb wants to hear; each may be empty.
struct LinkListener {
  std::function<void(ardrone_event event, const std::string& key)> on_event;
  std::function<void(const uint8_t* bytes, size_t size, const ardrone_navdata& navdata,
                     const tvs_imu& imu)>
      on_navdata;
  std::function<void(const ardrone_pave_packet& packet, const tvs_time& time, int gate)> on_packet;
  std::function<void(const tvs_frame& frame)> on_frame;
};

// H.264 to luma; closed with its owner.
class Decoder {
 public:
  Decoder();
  ~Decoder();
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  const tvs_decoder* get() const { return &decoder_; }

 private:
  tvs_decoder decoder_{};
};

// A drone on the network.
class Link {
 public:
  // `options` as ardrone_session_options_init leaves them, changed as the verb likes; callbacks and
  // user are set here. Throws BadInput for an unknown host. Sends nothing yet.
  Link(const DroneAddress& address, ardrone_session_options options, LinkListener listener);
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  ardrone_session* session() { return session_; }
  ardrone_counters counters() const;
  // Steps until `done` says so, `stop` is set or the seconds are over (0: no end); `done` may be
  // empty and is asked after each step. Returns whether `done` said so.
  bool run(const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds);

 private:
  ardrone_sockets sockets_;
  ardrone_transport transport_;
  LinkListener listener_;
  std::vector<std::max_align_t> memory_;
  ardrone_session* session_ = nullptr;
};

// Plays a recording's folder through a session, as fast as it can or `speed` times as fast as it
// was, until its end or `stop`. Throws BadInput where there is no recording.
ardrone_counters play(const std::string& folder, LinkListener listener,
                      const std::atomic<bool>& stop, double speed);

// frames_received, frames_decoded and so on: summary.json's keys.
nlohmann::ordered_json summary_json(const ardrone_counters& counters, double seconds);

// Throws BadInput with the driver's own words unless status is TVS_OK.
void check_driver(tvs_status status, const std::string& what);

}  // namespace cli
