// What a simulated drone is made of and where it listens: the options that its server and its
// camera read.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "simulator/faults.h"
#include "simulator/firmware.h"
#include "twoview/camera.h"

namespace simulator {

struct Ports {
  uint16_t at = 5556, navdata = 5554, video = 5555, control = 5559, recording = 5553;
};

// Paints picture `index` of a size, seen from a state; what the room does by itself.
using Painter = std::function<void(const FlightState& state, uint64_t index, int width, int height,
                                   uint8_t* luma)>;

struct ServerOptions {
  std::string host = "127.0.0.1";
  Ports ports;  // 0: a free one, see Server::ports
  Vec3 start{0, 0, 0};
  double yaw_rad = 0;
  uint64_t seed = 1;
  Sensors sensors;
  tv_camera camera{};        // 640 x 360; its lens is also that of 1280 x 720, scaled
  Mat3 body_from_camera{};   // room::kForwardCamera unless set
  double pixel_noise = 1.5;  // grey levels
  int frames_per_second = 30;
  int pave_header_bytes = 68;    // 64 or 68
  Painter painter;               // empty: the room
  std::string truth_file;        // empty: none. A line a picture: frame number, seconds since boot,
                                 // x y z qx qy qz qw (world_from_body), vx vy vz (world)
  FaultChances faults;           // of datagrams, both ways
  double video_garbage = 0;      // chance of random bytes before a video packet
  double cut_video_every_s = 0;  // 0: never; a reset of the connection
  double stall_video_every_s = 0;  // open, and silent for 3 s
  double reboot_every_s = 0;
  std::optional<uint32_t> first_sequence;  // of navdata, to see the wrap
  std::string firmware;  // empty: 2.4.8; else a version that nobody knows, see Firmware
};

}  // namespace simulator
