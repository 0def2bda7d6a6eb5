// twoview drone record: stores the drone's navdata and live video packets, unchanged.

#include <unistd.h>
#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include <memory>
#include <optional>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "drone/drone.h"
#include "drone/link.h"
#include "drone/vehicle.h"
#include "recording/recording.h"

namespace cli {
namespace {

struct Arguments {
  DroneAddress address;
  double duration = 0;
  std::string output;
  bool frames = false, json = false, quiet = false;
  VehicleAddress vehicle;
};

std::string progress(const ardrone_counters& n, double seconds) {
  char line[160];
  std::snprintf(line, sizeof line, "\r%6.1f s  %llu navdata, %llu frames, %llu gaps, %llu reboots ",
                seconds, static_cast<unsigned long long>(n.navdata_received),
                static_cast<unsigned long long>(n.packets), static_cast<unsigned long long>(n.gaps),
                static_cast<unsigned long long>(n.reboots));
  return line;
}

int record(const Arguments& a) {
  if (a.vehicle.given()) return record_vehicle(a.vehicle, a.output, a.duration, a.json, a.quiet);
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.skip_to_latest = 0;
  options.queue_frames = 0;
  const Decoder decoder;
  options.decoder = decoder.get();
  std::optional<Recording> recording;
  LinkListener listener;
  // An exception must not pass through the driver's C code, so its message is stored.
  std::string failure;
  const auto keeping = [&failure](const auto& write) {
    if (!failure.empty()) return;
    try {
      write();
    } catch (const std::exception& e) {
      failure = e.what();
    }
  };
  listener.on_navdata = [&](const uint8_t* bytes, size_t size, const ardrone_navdata&,
                            const tvs_imu& imu) {
    keeping([&] { recording->add_navdata(bytes, size, imu); });
  };
  listener.on_packet = [&](const ardrone_pave_packet& packet, const tvs_time& time, int) {
    keeping([&] { recording->add_packet(packet, time); });
  };
  listener.on_frame = [&](const tvs_frame& frame) {
    keeping([&] { recording->add_frame(frame); });
  };
  const bool speaks = !a.json && !a.quiet;
  const bool is_terminal = speaks && shows_progress(STDOUT_FILENO);
  const int64_t start = ardrone_now_ns();
  const auto seconds = [start] { return static_cast<double>(ardrone_now_ns() - start) * 1e-9; };
  double next_word = 0;
  Link link(a.address, options, listener);
  recording.emplace(a.output, a.frames);  // makes the folder after Link has checked the host
  link.run(
      [&] {
        if (is_terminal && seconds() >= next_word) {
          print(progress(link.counters(), seconds()));
          next_word = seconds() + 0.2;
        }
        return !failure.empty();
      },
      stop_flag_for_signals(), a.duration);
  if (is_terminal) print("\n");
  const ardrone_counters counters = link.counters();
  const std::string summary = summary_json(counters, seconds()).dump(2) + "\n";
  if (!failure.empty()) throw BadInput(failure);
  const bool is_drone =
      counters.navdata_received > counters.navdata_rejected || counters.packets > 0;
  if (!is_drone && counters.navdata_rejected == 0 && counters.bytes_skipped == 0) {
    recording->discard();
    throw BadInput("nothing came from " + a.address.host +
                   ": is the drone on, and this computer in its network?");
  }
  recording->add_summary(summary);
  if (a.json) print(summary);
  if (speaks) {
    print("recorded     " + std::to_string(counters.navdata_received) + " navdata, " +
          std::to_string(counters.packets) + " frames, " + std::to_string(counters.gaps) +
          " gaps\nfiles        " + a.output +
          ": video.pave navdata.log attitude.tum frames.txt "
          "summary.json" +
          (a.frames ? " frames/" : "") + "\n");
  }
  if (!is_drone) throw BadInput("what came from " + a.address.host + " is not an AR.Drone's");
  return 0;
}

}  // namespace

void add_drone_record(CLI::App& drone, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = drone.add_subcommand("record", "everything that the drone sends, to a folder");
  add_address(*verb, a->address, ARDRONE_DEFAULT_HOST);
  add_vehicle(*verb, a->vehicle, true);
  add_duration(*verb, a->duration);
  verb->add_option("-o,--output", a->output, "folder for the recording; made where it is missing")
      ->required()
      ->type_name("DIR");
  verb->add_flag("--frames", a->frames, "also write the decoded pictures, frames/NUMBER.png");
  verb->add_flag("--json", a->json, "print the summary alone, as JSON");
  verb->add_flag("--quiet", a->quiet, "print nothing on stdout");
  verb->final_callback([a, &run] { run = [a] { return record(*a); }; });
}

}  // namespace cli
