// A MAVLink vehicle (PX4, ArduPilot) and a camera of its own in place of an AR.Drone: the options
// --mavlink and --camera-source, and what the verbs do with them. In a program without MAVLink's
// driver vehicle_none.cc stands in, and each of these functions throws BadInput that says so.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "base/cli_fwd.h"
#include "drone/estimates.h"
#include "recording/driver_session.h"

namespace cli {

struct VehicleAddress {
  std::string address;         // udp://HOST:PORT; empty: not given
  std::string camera = "0";    // a name of CameraSource
  double camera_delay_ms = 0;  // from the exposure to the receipt of a picture
  int system = 0;              // the vehicle's system id; 0: the first autopilot heard
  EstimateOptions estimates;   // which estimates of the path it is sent

  bool given() const { return !address.empty(); }
};

// Adds --mavlink and --vehicle-id, and with_camera also --camera-source and --camera-delay.
void add_vehicle(CLI::App& verb, VehicleAddress& vehicle, bool with_camera);
// Adds --send-odometry and the options of what is sent; for a verb with --mavlink.
void add_estimates(CLI::App& verb, EstimateOptions& estimates);

// Hands the samples and the frames of a vehicle to the listener's on_imu and on_frame, until `done`
// returns true, `stop` is set, the camera ends or the time is over (0: no limit). A frame comes
// after the sample that follows it. Prints a line on stderr while no vehicle is heard and when it
// falls silent, unless `quiet`. session: null, or receives the session while this function runs.
// Throws BadInput where the port or the camera does not open, and at the end where no vehicle was
// heard.
void fly_vehicle(const VehicleAddress& vehicle, const LinkListener& listener,
                 const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds,
                 bool quiet, tvm_session** session = nullptr);

// `drone record` and `drone info` of a vehicle; they return the exit status.
int record_vehicle(const VehicleAddress& vehicle, const std::string& folder, double seconds,
                   bool json, bool quiet);
int info_vehicle(const VehicleAddress& vehicle, double seconds, bool json);

}  // namespace cli
