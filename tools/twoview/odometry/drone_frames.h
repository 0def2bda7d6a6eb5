// An AR.Drone or a MAVLink vehicle as a source of frames with its attitudes, heights and
// velocities: a recording, or the drone itself. Only in a program with the driver.
#pragma once

#include <memory>
#include <string>

#include "drone/options.h"
#include "drone/vehicle.h"
#include "odometry/frames.h"

namespace cli {

// A folder that `drone record` wrote. camera_file: gives the mount of the camera; may be empty.
std::unique_ptr<FrameSource> open_recording(const std::string& folder,
                                            const std::string& camera_file);

// The drone at an address, for `seconds` seconds (0: without limit). Sends it no command but those
// with which every session begins.
std::unique_ptr<FrameSource> open_drone(const DroneAddress& address, double seconds,
                                        const std::string& camera_file);

// A MAVLink vehicle and its camera, for `seconds` seconds (0: without limit).
std::unique_ptr<FrameSource> open_vehicle(const VehicleAddress& vehicle, double seconds,
                                          const std::string& camera_file, bool quiet);

}  // namespace cli
