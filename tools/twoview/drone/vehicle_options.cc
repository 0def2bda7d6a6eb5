#include "drone/drone.h"
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

}  // namespace cli
