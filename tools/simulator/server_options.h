// The options of a simulated drone: its ports, camera, sensors and faults. Its server and its
// camera read them.
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

// Renders picture number `index` at a given size, seen from a state. Set it to replace the rendered
// room.
using Painter = std::function<void(const FlightState& state, uint64_t index, int width, int height,
                                   uint8_t* luma)>;

struct ServerOptions {
  std::string host = "127.0.0.1";
  Ports ports;  // port 0: the system chooses a free port; see Server::ports
  Vec3 start{0, 0, 0};
  double yaw_rad = 0;
  uint64_t seed = 1;
  Sensors sensors;
  tv_camera camera{};        // 640 x 360; its lens is also that of 1280 x 720, scaled
  Mat3 body_from_camera{};   // must be set, such as room::kForwardCamera
  double pixel_noise = 1.5;  // standard deviation, grey levels
  int frames_per_second = 30;
  int pave_header_bytes = 68;  // size of the PaVE header: 64 or 68 bytes
  Painter painter;             // draws the pictures; empty: the room is rendered
  bool has_tour = false;       // once a client receives its video, the drone flies simulator/tour.h
  std::string truth_file;  // path of the output with the true states; empty: no file. It has a line
                           // for each picture: frame number, seconds since boot, x y z qx qy qz qw
                           // (world_from_body), vx vy vz (world)
  FaultChances faults;     // probabilities of faults of datagrams in both directions
  double video_garbage = 0;      // probability of random bytes before a video packet
  double cut_video_every_s = 0;  // seconds between resets of the video connection; 0: never
  // Seconds between stalls of the video: it stays connected without data for 3 s; 0: never.
  double stall_video_every_s = 0;
  double reboot_every_s = 0;
  std::optional<uint32_t> first_sequence;  // first sequence number of navdata, to test the wrap
  // The reported firmware version; empty: 2.4.8. With a version, navdata also has options with tags
  // that no known firmware uses (Firmware::set_version).
  std::string firmware;
};

}  // namespace simulator
