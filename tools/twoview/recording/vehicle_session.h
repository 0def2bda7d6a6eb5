// A C++ wrapper of MAVLink's driver: its memory, its callbacks as functions, its frames and its
// counters. Live vehicles and the playback of recordings share it. Only in a program with that
// driver.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "recording/driver_session.h"
#include "twoview_drivers/mavlink/session.h"

namespace cli {

class VehicleSession {
 public:
  using OnPacket = std::function<void(int64_t now_ns, const uint8_t* bytes, size_t size)>;

  // `options` must be initialised by tvm_session_options_init; this class sets their callbacks and
  // user pointer. on_packet may be empty. Throws BadInput if the driver refuses the options.
  VehicleSession(tvm_session_options options, const tvm_transport& transport, LinkListener listener,
                 OnPacket on_packet);
  VehicleSession(const VehicleSession&) = delete;
  VehicleSession& operator=(const VehicleSession&) = delete;

  tvm_session* get() { return session_; }
  void use_camera(const tvs_frame_source& camera);
  // Runs the session at now_ns and hands the frames that are ready to the listener. Returns false
  // after the camera's last frame.
  bool step(int64_t now_ns);

  tvm_link link() const { return tvm_session_link(session_); }
  // The autopilot in words, such as "PX4, system 1".
  std::string autopilot() const;
  uint64_t num_frames() const { return num_frames_; }
  nlohmann::ordered_json summary(double seconds) const;

 private:
  // An exception must not pass through the driver's C code: it is stored, and step throws it.
  template <class F>
  void guard(const F& call);

  LinkListener listener_;
  OnPacket on_packet_;
  SessionMemory memory_;
  tvm_session* session_ = nullptr;
  std::exception_ptr failure_;
  tvs_frame_source frames_{};
  bool has_camera_ = false, has_ended_ = false;
  uint64_t num_frames_ = 0, num_gaps_ = 0, num_dropped_ = 0, next_number_ = 0;
};

}  // namespace cli
