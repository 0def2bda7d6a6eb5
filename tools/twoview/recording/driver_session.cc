#include "recording/driver_session.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "twoview_drivers/h264.h"

namespace cli {
namespace {

LinkListener& listener_of(void* user) { return *static_cast<LinkListener*>(user); }

// The driver's callbacks are C functions; these forward to the listener.
void tell_event(void* user, ardrone_event event, const char* key) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_event) listener.on_event(event, key != nullptr ? key : "");
}
void tell_navdata(void* user, const uint8_t* bytes, size_t size, const ardrone_navdata* navdata,
                  const tvs_imu* imu) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_navdata) listener.on_navdata(bytes, size, *navdata, *imu);
  if (listener.on_imu) listener.on_imu(*imu);
}
void tell_packet(void* user, const ardrone_pave_packet* packet, const tvs_time* time, int gate) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_packet) listener.on_packet(*packet, *time, gate);
}
void tell_frame(void* user, const tvs_frame* frame) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_frame) listener.on_frame(*frame);
}

}  // namespace

void check_driver(tvs_status status, const std::string& what) {
  if (status != TVS_OK) throw BadInput(what + ": " + tvs_status_string(status));
}

Decoder::Decoder() { check_driver(tvs_h264_open(&decoder_), "cannot decode H.264"); }
Decoder::~Decoder() { tvs_h264_close(&decoder_); }

void set_callbacks(LinkListener& listener, ardrone_session_options& options) {
  options.user = &listener;
  options.on_event = tell_event;
  options.on_navdata = tell_navdata;
  options.on_packet = tell_packet;
  options.on_frame = tell_frame;
}

ardrone_session* make_session(const ardrone_session_options& options,
                              const ardrone_transport& transport, SessionMemory& memory) {
  size_t bytes = 0;
  check_driver(ardrone_session_size(&options, &bytes), "session");
  memory.resize(bytes / sizeof(std::max_align_t) + 1);
  ardrone_session* session = nullptr;
  check_driver(ardrone_session_init(&session, &options, &transport, memory.data(),
                                    memory.size() * sizeof(std::max_align_t)),
               "session");
  return session;
}

nlohmann::ordered_json summary_json(const ardrone_counters& n, double seconds) {
  return {{"frames_received", n.packets},
          {"frames_decoded", n.frames_decoded},
          {"frames_dropped", n.packets_skipped + n.frames_failed + n.frames_dropped},
          {"gaps", n.gaps},
          {"navdata_received", n.navdata_received},
          {"navdata_rejected", n.navdata_rejected},
          {"reconnects", (n.links > 0 ? n.links - 1 : 0) +
                             (n.video_connections > 0 ? n.video_connections - 1 : 0)},
          {"seconds", seconds}};
}

}  // namespace cli
