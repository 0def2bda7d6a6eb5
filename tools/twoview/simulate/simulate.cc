// twoview drone simulate: runs a simulated AR.Drone 2.0 on this computer's loopback interface, for
// tests of drivers.

#include "simulate/simulate.h"

#include <CLI/App.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "base/output.h"
#include "drone/options.h"
#include "files/camera_file.h"
#include "files/camera_formats.h"
#include "files/image_file.h"
#include "simulator/server.h"

namespace cli {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;

struct Arguments {
  DroneAddress address;
  int recording_port = 5553;
  double duration = 0;
  std::string camera, written_camera, truth, surfaces;
  bool scales_camera = false;
  bool has_tour = false;
  std::vector<std::string> images;
  std::vector<double> start = {0, 0};
  double yaw_deg = 0;
  uint64_t seed = 1;
  int frames_per_second = 30, pave_header = 68;
  double pixel_noise = 1.5;
  simulator::Sensors sensors;
  simulator::FaultChances faults;
  double garbage = 0, cut_every = 0, stall_every = 0, reboot_every = 0;
  int64_t first_sequence = -1;
  std::string firmware;
  bool json = false, quiet = false;
};

constexpr int kWidth = 640, kHeight = 360;  // pixels of the drone's camera

// Approximately the lens of an AR.Drone 2.0: the mean of five published calibrations.
tv_camera usual_camera() {
  return {TV_CAMERA_BROWN_CONRADY, kWidth, kHeight, 0, 568, 567, 320, 180, {-0.52, 0.27, 0, 0, 0}};
}

// Shows the images forwards and backwards alternately, so that the film has no jump.
simulator::Painter film_of(const std::vector<std::string>& names) {
  auto images = std::make_shared<std::vector<cv::Mat>>();
  for (const std::string& name : names) images->push_back(load_picture(name).luma);
  return [images](const simulator::FlightState&, uint64_t index, int width, int height,
                  uint8_t* luma) {
    const uint64_t last = images->size() - 1, lap = last > 0 ? index % (2 * last) : 0;
    cv::Mat frame(height, width, CV_8U, luma);
    cv::resize((*images)[lap <= last ? lap : 2 * last - lap], frame, frame.size(), 0, 0,
               cv::INTER_AREA);
  };
}

simulator::ServerOptions server_options(const Arguments& a) {
  simulator::ServerOptions o;
  o.host = a.address.host;
  o.ports.at = static_cast<uint16_t>(a.address.at_port);
  o.ports.navdata = static_cast<uint16_t>(a.address.navdata_port);
  o.ports.video = static_cast<uint16_t>(a.address.video_port);
  o.ports.control = static_cast<uint16_t>(a.address.control_port);
  o.ports.recording = static_cast<uint16_t>(a.recording_port);
  o.start = {a.start[0], a.start[1], 0};
  o.yaw_rad = a.yaw_deg / kDegrees;
  o.seed = a.seed;
  o.sensors = a.sensors;
  o.sensors.seed = a.seed;
  o.camera = a.camera.empty() ? usual_camera()
                              : fitted(load_camera(a.camera), a.camera, kWidth, kHeight,
                                       "of the drone", a.scales_camera);
  o.body_from_camera = room::kForwardCamera;
  o.pixel_noise = a.pixel_noise;
  o.frames_per_second = a.frames_per_second;
  o.pave_header_bytes = a.pave_header;
  if (!a.images.empty()) o.painter = film_of(a.images);
  o.truth_file = a.truth;
  o.has_tour = a.has_tour;
  o.faults = a.faults;
  o.video_garbage = a.garbage;
  o.cut_video_every_s = a.cut_every;
  o.stall_video_every_s = a.stall_every;
  o.reboot_every_s = a.reboot_every;
  o.firmware = a.firmware;
  if (a.first_sequence >= 0) o.first_sequence = static_cast<uint32_t>(a.first_sequence);
  return o;
}

std::string ports_line(const std::string& host, const simulator::Ports& ports) {
  return "drone        " + host + ", commands " + std::to_string(ports.at) + ", navdata " +
         std::to_string(ports.navdata) + ", video " + std::to_string(ports.video) + ", control " +
         std::to_string(ports.control) + ", recording " + std::to_string(ports.recording) + "\n";
}

// The room in the form of a rendered flight's surfaces.json (docs/formats.md).
std::string surfaces_text(const room::Room& room) {
  nlohmann::ordered_json boxes = nlohmann::ordered_json::array();
  for (const auto& [low, high] : room.surfaces()) {
    room::Vec3 centre, half;
    for (size_t k = 0; k < 3; ++k) {
      centre[k] = (low[k] + high[k]) / 2;
      half[k] = (high[k] - low[k]) / 2;
    }
    boxes.push_back(
        {{"centre", centre}, {"half", half}, {"yaw_rad", 0.0}, {"is_room", boxes.empty()}});
  }
  return nlohmann::ordered_json{{"boxes", boxes}}.dump(1) + "\n";
}

void write_one(const std::filesystem::path& path, const std::string& text) {
  OutputSet file(path.parent_path());
  file.add(path.filename().string(), text);
  file.commit();
}

nlohmann::ordered_json counts_json(const simulator::ServerCounts& n) {
  return {{"commands_obeyed", n.commands_obeyed},
          {"commands_refused", n.commands_refused},
          {"take_offs", n.take_offs},
          {"navdata_sent", n.navdata_sent},
          {"frames_sent", n.frames_sent},
          {"frames_left_out", n.frames_left_out},
          {"video_cuts", n.video_cuts},
          {"video_stalls", n.video_stalls},
          {"reboots", n.reboots}};
}

int simulate(const Arguments& a) {
  const room::Room room(a.seed);
  if (!room.is_free({a.start[0], a.start[1], -0.3}, 0.299))
    throw BadInput("--start is inside a wall or a piece of furniture");
  const simulator::ServerOptions options = server_options(a);
  if (!a.surfaces.empty()) write_one(a.surfaces, surfaces_text(room));
  if (!a.written_camera.empty()) write_one(a.written_camera, camera_yaml(options.camera));
  simulator::Server server(options);
  const bool speaks = !a.json && !a.quiet;
  if (speaks) print(ports_line(a.address.host, server.ports()));
  server.run(stop_flag_for_signals(), a.duration);
  const nlohmann::ordered_json counts = counts_json(server.counts());
  if (a.json) print(counts.dump(2) + "\n");
  if (speaks) {
    std::string line;
    for (const auto& [name, value] : counts.items()) {
      line += (line.empty() ? "" : ", ") + name + " " + value.dump();
    }
    for (char& c : line) {
      if (c == '_') c = ' ';
    }
    print("done         " + line + "\n");
  }
  return 0;
}

void add_faults(CLI::App& verb, Arguments& a) {
  const auto chance = [&](const char* name, double& value, const char* help) {
    verb.add_option(name, value, help)
        ->check(number_in(0.0, 1.0))
        ->type_name("[0, 1]")
        ->group("Faults")
        ->capture_default_str();
  };
  chance("--lose", a.faults.lose, "chance that a datagram is lost");
  chance("--duplicate", a.faults.duplicate, "that it comes twice");
  chance("--reorder", a.faults.reorder, "that the next overtakes it");
  chance("--truncate", a.faults.truncate, "that its end is missing");
  chance("--corrupt", a.faults.corrupt, "that a bit is flipped");
  chance("--garbage", a.garbage, "that random bytes come before a video packet");
  const auto period = [&](const char* name, double& value, const char* help) {
    verb.add_option(name, value, help)
        ->check(number_in(0.0, 1e6))
        ->type_name("S")
        ->group("Faults")
        ->capture_default_str();
  };
  period("--cut-video-every", a.cut_every,
         "seconds between resets of the video connection; 0: none");
  period("--stall-video-every", a.stall_every, "seconds between silences of 3 s on an open one");
  period("--reboot-every", a.reboot_every, "seconds between reboots, each silent for 1 s");
  verb.add_option("--first-sequence", a.first_sequence, "navdata's first number, to see it wrap")
      ->check(CLI::Range(int64_t{0}, int64_t{UINT32_MAX}))
      ->type_name("N")
      ->group("Faults");
  verb.add_option("--firmware", a.firmware,
                  "a version that nobody knows, with navdata options to match")
      ->type_name("VERSION")
      ->group("Faults");
}

void add_world(CLI::App& verb, Arguments& a) {
  verb.add_option("--camera", a.camera, "lens of the 640 x 360 camera, OpenCV or ROS YAML")
      ->type_name("FILE");
  verb.add_flag("--scale-camera", a.scales_camera,
                "the lens is of another size of the same picture: scale it");
  verb.add_option("--write-camera", a.written_camera,
                  "write that lens, for --camera of the verbs that read a recording")
      ->type_name("FILE");
  verb.add_option("--images", a.images, "film these instead of the rendered room")
      ->type_name("IMAGE");
  verb.add_option("--truth", a.truth,
                  "write a line a picture: number, seconds, x y z, qx qy qz qw, vx vy vz")
      ->type_name("FILE");
  verb.add_option("--surfaces", a.surfaces, "write the room's walls and furniture as JSON")
      ->type_name("FILE");
  verb.add_flag("--tour", a.has_tour,
                "once its video is received, fly through the whole room and land: along the "
                "walls, round a pillar and back; commands that fly are ignored");
  verb.add_option("--start", a.start, "x and y in the room, metres; x in [-2, 7], y in [-3.5, 3.5]")
      ->delimiter(',')
      ->expected(2)
      ->check(number_in(-10, 10))
      ->type_name("X,Y");
  verb.add_option("--yaw-deg", a.yaw_deg, "heading at start, clockwise from above")
      ->check(number_in(-360.0, 360.0))
      ->type_name("DEG")
      ->capture_default_str();
  verb.add_option("--seed", a.seed, "of textures and noise")->type_name("N")->capture_default_str();
  verb.add_option("--fps", a.frames_per_second, "pictures a second")
      ->check(CLI::Range(1, 60))
      ->type_name("N")
      ->capture_default_str();
  verb.add_option("--pave-header", a.pave_header, "64 as of 2012, or 68")
      ->check(CLI::IsMember({64, 68}))
      ->type_name("64|68")
      ->capture_default_str();
  verb.add_option("--pixel-noise", a.pixel_noise, "of the camera, grey levels")
      ->check(number_in(0.0, 40.0))
      ->type_name("SIGMA")
      ->capture_default_str();
  verb.add_option("--altitude-factor", a.sensors.altitude_factor, "reported altitude over truth")
      ->check(number_in(0.5, 2.0))
      ->type_name("FACTOR")
      ->capture_default_str();
  verb.add_option("--velocity-factor", a.sensors.velocity_factor, "reported velocity over truth")
      ->check(number_in(0.5, 2.0))
      ->type_name("FACTOR")
      ->capture_default_str();
}

}  // namespace

void add_drone_simulate(CLI::App& drone, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = drone.add_subcommand("simulate", "be an AR.Drone 2.0 in a rendered room");
  add_address(*verb, a->address, "127.0.0.1");
  verb->add_option("--recording-port", a->recording_port, "recording stream, TCP")
      ->check(CLI::Range(0, 65535))
      ->type_name("PORT")
      ->capture_default_str();
  add_duration(*verb, a->duration);
  add_world(*verb, *a);
  add_faults(*verb, *a);
  verb->add_flag("--json", a->json, "print the counts at the end, as JSON");
  verb->add_flag("--quiet", a->quiet, "print nothing on stdout");
  verb->final_callback([a, &run] { run = [a] { return simulate(*a); }; });
}

}  // namespace cli
