// A C++ wrapper of the AR.Drone driver's session: callbacks as functions, its memory, its decoder,
// and its errors as BadInput. The drone's verbs and the playback of recordings share it.
#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "twoview_drivers/ardrone/session.h"
#include "twoview_drivers/source.h"

namespace cli {

// The functions that a session calls while it runs. An empty function is not called.
struct LinkListener {
  std::function<void(ardrone_event event, const std::string& key)> on_event;
  std::function<void(const uint8_t* bytes, size_t size, const ardrone_navdata& navdata,
                     const tvs_imu& imu)>
      on_navdata;
  // Each sample of the vehicle, whatever its driver is.
  std::function<void(const tvs_imu& imu)> on_imu;
  std::function<void(const ardrone_pave_packet& packet, const tvs_time& time, int gate)> on_packet;
  std::function<void(const tvs_frame& frame)> on_frame;
};

// Sets the callbacks and the user pointer of `options`. The listener must outlive the session.
void set_callbacks(LinkListener& listener, ardrone_session_options& options);

// Creates a session in `memory`, which must outlive it. Throws BadInput if the driver refuses the
// options.
using SessionMemory = std::vector<std::max_align_t>;
ardrone_session* make_session(const ardrone_session_options& options,
                              const ardrone_transport& transport, SessionMemory& memory);

// A decoder from H.264 to luma, which the destructor closes.
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

// The counters and the duration as summary.json has them: frames_received, frames_decoded and so
// on.
nlohmann::ordered_json summary_json(const ardrone_counters& counters, double seconds);

// Throws BadInput with the driver's message unless status is TVS_OK.
void check_driver(tvs_status status, const std::string& what);

}  // namespace cli
