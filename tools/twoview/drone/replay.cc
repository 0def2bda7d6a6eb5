// twoview drone replay: plays a recording through the same driver as a live drone's data.

#include <CLI/App.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/error.h"
#include "base/output.h"
#include "drone/drone.h"
#include "drone/options.h"
#include "recording/playback.h"
#include "recording/recording.h"
#include "recording/vehicle.h"

namespace cli {
namespace {

struct Arguments {
  std::string recording, frames;
  double speed = 0, duration = 0;
  bool json = false, quiet = false;
};

int replay(const Arguments& a) {
  LinkListener listener;
  int64_t first_ns = INT64_MAX, last_ns = 0;
  listener.on_imu = [&](const tvs_imu& imu) {
    first_ns = std::min(first_ns, imu.time.received_ns);
    last_ns = std::max(last_ns, imu.time.received_ns);
  };
  listener.on_packet = [&](const ardrone_pave_packet&, const tvs_time& time, int) {
    first_ns = std::min(first_ns, time.received_ns);
    last_ns = std::max(last_ns, time.received_ns);
  };
  // An exception must not pass through the driver's C code, so its message is stored.
  std::string failure;
  if (!a.frames.empty()) {
    listener.on_frame = [&](const tvs_frame& frame) {
      if (!failure.empty()) return;
      try {
        write_frame(a.frames, frame);
      } catch (const std::exception& e) {
        failure = e.what();
      }
    };
    make_folder(a.frames);
  }
  if (is_vehicle_recording(a.recording)) {
    const nlohmann::ordered_json summary =
        play_vehicle(a.recording, listener, stop_flag_for_signals(), a.speed, a.duration);
    if (!failure.empty()) throw BadInput(failure);
    if (a.json) print(summary.dump(2) + "\n");
    if (!a.json && !a.quiet)
      print(summary_line("recording", "%.1f s of %s: %llu attitudes, %llu frames, %llu gaps",
                         summary["seconds"].get<double>(),
                         summary["vehicle"].get<std::string>().c_str(),
                         summary["attitudes"].get<unsigned long long>(),
                         summary["frames_decoded"].get<unsigned long long>(),
                         summary["gaps"].get<unsigned long long>()));
    return 0;
  }
  const ardrone_counters counters =
      play(a.recording, listener, stop_flag_for_signals(), a.speed, a.duration);
  if (!failure.empty()) throw BadInput(failure);
  const double seconds = last_ns > first_ns ? static_cast<double>(last_ns - first_ns) * 1e-9 : 0.0;
  const nlohmann::ordered_json summary = summary_json(counters, seconds);
  if (a.json) print(summary.dump(2) + "\n");
  if (!a.json && !a.quiet) {
    char line[240];
    std::snprintf(line, sizeof line,
                  "recording    %.1f s: %llu navdata, %llu frames, %llu decoded, %llu gaps\n",
                  seconds, static_cast<unsigned long long>(counters.navdata_received),
                  static_cast<unsigned long long>(counters.packets),
                  static_cast<unsigned long long>(counters.frames_decoded),
                  static_cast<unsigned long long>(counters.gaps));
    print(line);
  }
  return 0;
}

}  // namespace

void add_drone_replay(CLI::App& drone, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = drone.add_subcommand("replay", "play a recording through the driver again");
  verb->add_option("DIR", a->recording, "folder of drone record")->required()->type_name("DIR");
  verb->add_option("--frames", a->frames, "write the decoded pictures to this folder")
      ->type_name("DIR");
  verb->add_option("--speed", a->speed, "times as fast as it was; 0: as fast as it can")
      ->check(number_in(0.0, 1000.0))
      ->type_name("FACTOR")
      ->capture_default_str();
  verb->add_option("--duration", a->duration, "play the recording's first seconds only; 0: all")
      ->check(number_in(0.0, 1e7))
      ->type_name("S")
      ->capture_default_str();
  verb->add_flag("--json", a->json, "print the summary alone, as JSON");
  verb->add_flag("--quiet", a->quiet, "print nothing on stdout");
  verb->final_callback([a, &run] { run = [a] { return replay(*a); }; });
}

}  // namespace cli
