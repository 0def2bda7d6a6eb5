// The AR.Drone driver's session in C++: its callbacks as functions, its memory, its decoder, and
// its refusals as BadInput. The verbs that talk to a drone and the playing of recordings share it.
#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "twoview_drivers/ardrone/session.h"
#include "twoview_drivers/source.h"

namespace cli {

// What a session reports as it is stepped. A function that is empty is not called.
struct LinkListener {
  std::function<void(ardrone_event event, const std::string& key)> on_event;
  std::function<void(const uint8_t* bytes, size_t size, const ardrone_navdata& navdata,
                     const tvs_imu& imu)>
      on_navdata;
  std::function<void(const ardrone_pave_packet& packet, const tvs_time& time, int gate)> on_packet;
  std::function<void(const tvs_frame& frame)> on_frame;
};

// Sets the callbacks and the user pointer of `options`; the listener must outlive the session.
void set_callbacks(LinkListener& listener, ardrone_session_options& options);

// A session in `memory`, which must outlive it. Throws BadInput when the driver refuses.
using SessionMemory = std::vector<std::max_align_t>;
ardrone_session* make_session(const ardrone_session_options& options,
                              const ardrone_transport& transport, SessionMemory& memory);

// A decoder of H.264 to luma; closed with its owner.
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

// frames_received, frames_decoded and so on: the keys of summary.json.
nlohmann::ordered_json summary_json(const ardrone_counters& counters, double seconds);

// Throws BadInput with the driver's own words unless status is TVS_OK.
void check_driver(tvs_status status, const std::string& what);

}  // namespace cli
