#include "drone/options.h"

#include <CLI/App.hpp>
#include "drone/vehicle.h"

namespace cli {

void add_vehicle(CLI::App& verb, VehicleAddress& vehicle, bool with_camera) {
  verb.add_option("--mavlink", vehicle.address,
                  "a MAVLink vehicle in place of an AR.Drone: udp://HOST:PORT to listen, "
                  "udpout://HOST:PORT to send there")
      ->type_name("ADDRESS");
  verb.add_option("--vehicle-id", vehicle.system, "its system id; 0: the first autopilot heard")
      ->check(CLI::Range(0, 255))
      ->type_name("N")
      ->capture_default_str();
  if (!with_camera) return;
  verb.add_option("--camera-source", vehicle.camera,
                  "its camera: a number, v4l2:/dev/video0, gst:PIPELINE, rtsp://..., or a film")
      ->type_name("NAME")
      ->capture_default_str();
  verb.add_option("--camera-delay", vehicle.camera_delay_ms,
                  "milliseconds from a picture's exposure to its receipt")
      ->check(number_in(0.0, 10000.0))
      ->type_name("MS")
      ->capture_default_str();
}

void add_estimates(CLI::App& verb, EstimateOptions& estimates) {
  CLI::Option* const mavlink = verb.get_option("--mavlink");
  CLI::Option* const odometry = verb.add_flag(
      "--send-odometry", estimates.odometry,
      "send each frame's pose and velocity to the vehicle's filter (ODOMETRY); nothing steers");
  CLI::Option* const position =
      verb.add_flag("--send-vision-position", estimates.vision_position,
                    "send VISION_POSITION_ESTIMATE, beside or in place of ODOMETRY");
  CLI::Option* const weak = verb.add_flag("--send-weak", estimates.weak,
                                          "send weak frames, too, with three times the sigmas");
  CLI::Option* const north =
      verb.add_flag("--send-north", estimates.north,
                    "in axes north, east, down by the vehicle's heading (not for ArduPilot)");
  for (CLI::Option* option : {odometry, position, weak, north}) option->needs(mavlink);
}

}  // namespace cli
