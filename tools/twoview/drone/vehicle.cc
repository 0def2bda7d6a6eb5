#include "drone/vehicle.h"

#include <time.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <optional>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "recording/vehicle_recording.h"
#include "recording/vehicle_session.h"
#include "sources/camera_source.h"
#include "twoview_drivers/mavlink/udp.h"
#include "verbs/common.h"

namespace cli {
namespace {

constexpr int64_t kSecond = 1000000000, kLongestWaitNs = 5000000;

int64_t clock_ns(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return static_cast<int64_t>(now.tv_sec) * kSecond + now.tv_nsec;
}

// The socket, which the destructor closes.
struct Udp {
  explicit Udp(const std::string& address) {
    switch (tvm_udp_open(&socket, address.c_str(), &transport)) {
      case TVS_OK: return;
      case TVS_ERR_ARGUMENT:
        throw BadInput("--mavlink " + address +
                       ": not udp://HOST:PORT, udpin://HOST:PORT or udpout://HOST:PORT of a host "
                       "that is known" +
                       (address.compare(0, 5, "/dev/") == 0
                            ? "; a serial line needs a router to UDP, such as mavproxy.py"
                            : ""));
      case TVS_ERR_STATE:
        throw BadInput("--mavlink " + address +
                       ": another program has this port, perhaps a ground station");
      default: throw BadInput("--mavlink " + address + ": cannot listen at this address");
    }
  }
  ~Udp() { tvm_udp_close(&socket); }
  Udp(const Udp&) = delete;
  Udp& operator=(const Udp&) = delete;
  tvm_udp socket{};
  tvm_transport transport{};
};

// A vehicle on the network. Its clock is the monotonic one, shifted once so that it starts at the
// time of day: a recording then has times that ground stations read.
class VehicleLink {
 public:
  VehicleLink(const VehicleAddress& vehicle, const LinkListener& listener,
              const VehicleSession::OnPacket& on_packet)
      : vehicle_(vehicle),
        offset_ns_(clock_ns(CLOCK_REALTIME) - clock_ns(CLOCK_MONOTONIC)),
        udp_(vehicle.address),
        session_(options(), udp_.transport, listener, on_packet) {}

  VehicleSession& session() { return session_; }
  double seconds() const { return static_cast<double>(now_ns() - start_ns_) * 1e-9; }

  // Steps until `done` is true, the camera ends, `stop` is set or the time is over. The camera, if
  // any, is used from the vehicle's first attitude on.
  void run(CameraSource* camera, const std::function<bool()>& done, const std::atomic<bool>& stop,
           double seconds, bool quiet) {
    quiet_ = quiet;
    start_ns_ = now_ns();
    const int64_t end = seconds > 0 ? start_ns_ + static_cast<int64_t>(seconds * 1e9) : INT64_MAX;
    while (!stop && now_ns() < end) {
      if (!session_.step(now_ns())) break;
      if (camera != nullptr && session_.link() == TVM_LINK_UP) {
        session_.use_camera(camera->frames());
        camera = nullptr;
      }
      tell_link();
      if (done && done()) break;
      tvm_udp_wait(&udp_.socket, std::min(kLongestWaitNs, end - now_ns()));
    }
    check_heard();
  }

 private:
  int64_t now_ns() const { return clock_ns(CLOCK_MONOTONIC) + offset_ns_; }

  tvm_session_options options() const {
    tvm_session_options options;
    tvm_session_options_init(&options);
    options.vehicle_system = vehicle_.system;
    if (vehicle_.estimates.given()) options.own_component = TVM_COMPONENT_ODOMETRY;
    options.camera_offset_ns = offset_ns_ - static_cast<int64_t>(vehicle_.camera_delay_ms * 1e6);
    return options;
  }

  void tell_link() {
    const tvm_link link = session_.link();
    const bool is_late = now_ns() - start_ns_ > 3 * kSecond;
    if (link == told_ || (!is_late && told_ == TVM_LINK_UP && link == TVM_LINK_WAITING)) return;
    if (!is_late && link != TVM_LINK_UP && link != TVM_LINK_SILENT) return;
    if (!quiet_ && !(link == TVM_LINK_UP && !has_told_))
      std::fprintf(stderr, "%s", words().c_str());
    has_told_ = has_told_ || link != TVM_LINK_UP;
    told_ = link;
  }

  std::string words() const {
    switch (session_.link()) {
      case TVM_LINK_WAITING:
        return "twoview: waiting for a MAVLink vehicle at " + vehicle_.address + "\n";
      case TVM_LINK_NO_ATTITUDE:
        return "twoview: the vehicle (" + session_.autopilot() + ") sends no ATTITUDE\n";
      case TVM_LINK_SILENT:
        return "twoview: the vehicle (" + session_.autopilot() + ") is silent\n";
      case TVM_LINK_UP: break;
    }
    return "twoview: the vehicle (" + session_.autopilot() + ") is heard\n";
  }

  void check_heard() const {
    tvm_counters n{};
    tvm_session_counters(const_cast<VehicleLink*>(this)->session_.get(), &n);
    if (n.attitudes > 0) return;
    if (n.received > 0)
      throw BadInput("the vehicle at " + vehicle_.address + " (" + session_.autopilot() +
                     ") sent no ATTITUDE");
    if (n.corrupted + n.unknown + n.others > 0)
      throw BadInput("no autopilot" +
                     (vehicle_.system > 0 ? " of system " + std::to_string(vehicle_.system) : "") +
                     " was heard at " + vehicle_.address + "; other packets were");
    throw BadInput("no MAVLink vehicle was heard at " + vehicle_.address);
  }

  VehicleAddress vehicle_;
  int64_t offset_ns_, start_ns_ = 0;
  Udp udp_;
  VehicleSession session_;
  tvm_link told_ = TVM_LINK_UP;
  bool has_told_ = false, quiet_ = false;
};

// A film plays in real time, since the vehicle does.
CameraSource::Kind kind_of(const std::string& name) {
  return CameraSource::kind_of(name) == CameraSource::Kind::kLive ? CameraSource::Kind::kLive
                                                                  : CameraSource::Kind::kPaced;
}

}  // namespace

void fly_vehicle(const VehicleAddress& vehicle, const LinkListener& listener,
                 const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds,
                 bool quiet, tvm_session** session) {
  VehicleLink link(vehicle, listener, {});
  if (session) *session = link.session().get();
  CameraSource camera(vehicle.camera, kind_of(vehicle.camera));
  link.run(&camera, done, stop, seconds, quiet);
}

int record_vehicle(const VehicleAddress& vehicle, const std::string& folder, double seconds,
                   bool json, bool quiet) {
  const bool speaks = !json && !quiet;
  const bool is_terminal = speaks && shows_progress(STDOUT_FILENO);
  std::optional<VehicleRecording> recording;
  LinkListener listener;
  listener.on_imu = [&](const tvs_imu& imu) { recording->add_sample(imu); };
  listener.on_frame = [&](const tvs_frame& frame) { recording->add_frame(frame); };
  VehicleLink link(vehicle, listener, [&](int64_t now_ns, const uint8_t* bytes, size_t size) {
    recording->add_packet(now_ns, bytes, size);
  });
  CameraSource camera(vehicle.camera, kind_of(vehicle.camera));
  recording.emplace(folder);  // makes the folder after the port and the camera have opened
  double next_word = 0;
  const auto progress = [&] {
    if (!is_terminal || link.seconds() < next_word) return false;
    char line[120];
    std::snprintf(line, sizeof line, "\r%6.1f s  %llu frames ", link.seconds(),
                  static_cast<unsigned long long>(link.session().num_frames()));
    print(line);
    next_word = link.seconds() + 0.2;
    return false;
  };
  link.run(&camera, progress, stop_flag_for_signals(), seconds, quiet);
  if (is_terminal) print("\n");
  const nlohmann::ordered_json summary = link.session().summary(link.seconds());
  recording->add_summary(summary.dump(2) + "\n");
  if (json) print(summary.dump(2) + "\n");
  if (speaks) {
    print(summary_line("vehicle", "%s", link.session().autopilot().c_str()) +
          summary_line("recorded", "%llu frames, %llu packets, %llu lost",
                       static_cast<unsigned long long>(link.session().num_frames()),
                       summary["packets_received"].get<unsigned long long>(),
                       summary["packets_lost"].get<unsigned long long>()) +
          summary_line("files", "%s: vehicle.tlog attitude.tum frames.txt frames/ summary.json",
                       folder.c_str()));
  }
  if (link.session().num_frames() == 0)
    throw BadInput("no picture came from the camera '" + vehicle.camera + "'");
  return 0;
}

int info_vehicle(const VehicleAddress& vehicle, double seconds, bool json) {
  int num_samples = 0, num_velocities = 0, num_heights = 0;
  int64_t first_ns = 0, last_ns = 0;
  double height_m = 0;
  LinkListener listener;
  listener.on_imu = [&](const tvs_imu& imu) {
    if (num_samples++ == 0) first_ns = imu.time.received_ns;
    last_ns = imu.time.received_ns;
    num_velocities += (imu.valid & TVS_IMU_VELOCITY_XY) != 0;
    if ((imu.valid & TVS_IMU_ALTITUDE) == 0) return;
    ++num_heights;
    height_m = imu.altitude_m;
  };
  VehicleLink link(vehicle, listener, {});
  // 3 s are enough for the requested rates and for a height.
  link.run(
      nullptr, [&] { return last_ns - first_ns > 3 * kSecond; }, stop_flag_for_signals(), seconds,
      json);
  const double span = static_cast<double>(last_ns - first_ns) * 1e-9;
  const double rate = span > 0 ? (num_samples - 1) / span : 0;
  nlohmann::ordered_json result = link.session().summary(link.seconds());
  if (json) {
    result["attitudes_per_second"] = rate;
    result["has_velocity"] = num_velocities > 0;
    result["height_m"] =
        num_heights > 0 ? nlohmann::ordered_json(height_m) : nlohmann::ordered_json(nullptr);
    print(result.dump(2) + "\n");
    return 0;
  }
  char height[40] = "not sent";
  if (num_heights > 0) std::snprintf(height, sizeof height, "%.2f m", height_m);
  print(summary_line("vehicle", "%s at %s", link.session().autopilot().c_str(),
                     vehicle.address.c_str()) +
        summary_line("attitude", "%.1f a second", rate) +
        summary_line("velocity", "%s", num_velocities > 0 ? "sent" : "not sent") +
        summary_line("height", "%s", height) +
        summary_line("packets", "%llu, %llu lost, %llu corrupted",
                     result["packets_received"].get<unsigned long long>(),
                     result["packets_lost"].get<unsigned long long>(),
                     result["packets_corrupted"].get<unsigned long long>()));
  return 0;
}

}  // namespace cli
