#include "recording/vehicle_session.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"

namespace cli {

template <class F>
void VehicleSession::guard(const F& call) {
  if (failure_) return;
  try {
    call();
  } catch (...) {
    failure_ = std::current_exception();
  }
}

VehicleSession::VehicleSession(tvm_session_options options, const tvm_transport& transport,
                               LinkListener listener, OnPacket on_packet)
    : listener_(std::move(listener)), on_packet_(std::move(on_packet)) {
  options.user = this;
  options.on_packet = [](void* user, int64_t now_ns, const uint8_t* bytes, size_t size) {
    VehicleSession& self = *static_cast<VehicleSession*>(user);
    if (self.on_packet_) self.guard([&] { self.on_packet_(now_ns, bytes, size); });
  };
  options.on_imu = [](void* user, const tvs_imu* sample) {
    VehicleSession& self = *static_cast<VehicleSession*>(user);
    if (self.listener_.on_imu) self.guard([&] { self.listener_.on_imu(*sample); });
  };
  memory_.resize(tvm_session_size() / sizeof(std::max_align_t) + 1);
  check_driver(tvm_session_init(&session_, &options, &transport, memory_.data(),
                                memory_.size() * sizeof(std::max_align_t)),
               "the session with the vehicle");
}

void VehicleSession::use_camera(const tvs_frame_source& camera) {
  check_driver(tvm_session_frames(session_, &camera, &frames_), "the camera");
  has_camera_ = true;
}

bool VehicleSession::step(int64_t now_ns) {
  tvm_session_step(session_, now_ns);  // a socket that fails for a while is no end of the flight
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  while (has_camera_ && !has_ended_) {
    tvs_frame frame{};
    frame.struct_size = sizeof frame;
    const tvs_status status = frames_.next(frames_.user, &frame);
    if (status == TVS_NONE) break;
    has_ended_ = status != TVS_OK;
    if (has_ended_) break;
    if (num_frames_ > 0 && (frame.flags & TVS_FRAME_GAP) != 0) {
      ++num_gaps_;
      if (frame.number > next_number_) num_dropped_ += frame.number - next_number_;
    }
    next_number_ = frame.number + 1;
    ++num_frames_;
    if (listener_.on_frame) guard([&] { listener_.on_frame(frame); });
    frames_.release(frames_.user, &frame);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }
  return !has_ended_;
}

std::string VehicleSession::autopilot() const {
  int system = 0;
  switch (tvm_session_autopilot(session_, &system)) {
    case TVM_AUTOPILOT_UNKNOWN: return "none";
    case TVM_AUTOPILOT_ARDUPILOT: return "ArduPilot, system " + std::to_string(system);
    case TVM_AUTOPILOT_PX4: return "PX4, system " + std::to_string(system);
    case TVM_AUTOPILOT_OTHER: break;
  }
  return "another autopilot, system " + std::to_string(system);
}

nlohmann::ordered_json VehicleSession::summary(double seconds) const {
  tvm_counters n{};
  tvm_session_counters(session_, &n);
  return {{"vehicle", autopilot()},
          {"frames_received", num_frames_ + num_dropped_},
          {"frames_decoded", num_frames_},
          {"frames_dropped", num_dropped_},
          {"gaps", num_gaps_},
          {"packets_received", n.received},
          {"packets_lost", n.lost},
          {"packets_repeated", n.repeated},
          {"packets_late", n.late},
          {"packets_corrupted", n.corrupted},
          {"packets_unknown", n.unknown},
          {"packets_of_others", n.others},
          {"attitudes", n.attitudes},
          {"timesyncs", n.timesyncs},
          {"silences", n.silences},
          {"reboots", n.reboots},
          {"readings_invalid", tvm_session_num_invalid(session_)},
          {"seconds", seconds}};
}

}  // namespace cli
