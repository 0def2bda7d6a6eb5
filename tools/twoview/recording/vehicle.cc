#include "recording/vehicle.h"

#include <time.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/output.h"
#include "recording/vehicle_recording.h"
#include "recording/vehicle_session.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMs = 1000000;
// Of a stamp in microseconds: the number of the link, 0 for the only one.
constexpr uint64_t kLinkBits = 3;

// One packet of a telemetry log with its time.
struct LoggedPacket {
  int64_t time_ns = 0;
  std::vector<uint8_t> bytes;
};

// A telemetry log: for each packet its time, microseconds since 1970 began, 8 bytes big-endian, and
// its bytes. MAVLink's tools keep the number of the link in the two lowest bits of the time.
class PacketLog {
 public:
  explicit PacketLog(const fs::path& path) : file_(path, std::ios::binary) {}

  // Reads the next whole packet. Returns false at the end, which is also where the log is cut or is
  // no log.
  bool next(LoggedPacket& packet) {
    uint8_t head[11];
    if (!read(head, sizeof head)) return false;
    uint64_t time_us = 0;
    for (int k = 0; k < 8; ++k) time_us = time_us << 8 | head[k];
    if (time_us > uint64_t{1} << 51) return false;  // a time after 2041
    time_us &= ~kLinkBits;
    size_t size = 0;
    if (head[8] == 0xfd) {
      size = 12u + head[9] + ((head[10] & 1) != 0 ? 13u : 0u);
    } else if (head[8] == 0xfe) {
      size = 8u + head[9];
    } else {
      return false;
    }
    packet.time_ns = static_cast<int64_t>(time_us) * 1000;
    packet.bytes.assign(head + 8, head + 11);
    packet.bytes.resize(size);
    return size <= 3 || read(packet.bytes.data() + 3, size - 3);
  }

 private:
  bool read(uint8_t* bytes, size_t size) {
    return static_cast<bool>(
        file_.read(reinterpret_cast<char*>(bytes), static_cast<std::streamsize>(size)));
  }
  std::ifstream file_;
};

struct FrameLine {
  int64_t time_ns = 0;
  uint64_t number = 0;
};

// The lines of a recording's frames.txt. A recording that was cut off may end within a line, which
// is left out; any other line that is no frame, or not later than the one before, is an error.
std::vector<FrameLine> read_frame_lines(const fs::path& path) {
  std::ifstream file(path);
  std::vector<FrameLine> lines;
  std::string text;
  for (int number = 1; std::getline(file, text) && !file.eof(); ++number) {
    const auto refuse = [&](const char* what) {
      throw BadInput(path.string() + ": line " + std::to_string(number) + " " + what);
    };
    std::istringstream words(text);
    long long host = 0, device = 0;
    unsigned long long picture = 0;
    int key = 0;
    if (!(words >> host >> device >> picture >> key) || host < 0 || host > INT64_MAX / 4) {
      refuse("is no frame: host time, device time, number, key");
    }
    if (!lines.empty() && host <= lines.back().time_ns) {
      refuse(
          "has a host time that is not later than that of the line before: the clock of the "
          "recording computer was set back");
    }
    lines.push_back({host, picture});
  }
  return lines;
}

// A recording as a transport and as a camera of the driver, both at a time that advances.
struct Playback {
  explicit Playback(const fs::path& given)
      : folder(given), log(given / "vehicle.tlog"), lines(read_frame_lines(given / "frames.txt")) {
    has_packet = log.next(packet);
  }

  int64_t next_ns() const {
    int64_t next = INT64_MAX;
    if (has_packet) next = packet.time_ns;
    if (idx_line < lines.size()) next = std::min(next, lines[idx_line].time_ns);
    return next;
  }

  tvs_status receive(void* bytes, size_t capacity, size_t* size) {
    if (!has_packet || packet.time_ns > now_ns) return TVS_NONE;
    *size = std::min(capacity, packet.bytes.size());
    std::memcpy(bytes, packet.bytes.data(), *size);
    has_packet = log.next(packet);
    return TVS_OK;
  }

  tvs_status next_frame(tvs_frame* frame) {
    while (idx_line < lines.size() && lines[idx_line].time_ns <= now_ns) {
      const FrameLine& line = lines[idx_line++];
      char name[32];
      std::snprintf(name, sizeof name, "%06llu.png", static_cast<unsigned long long>(line.number));
      auto luma = std::make_unique<cv::Mat>(
          cv::imread((folder / "frames" / name).string(), cv::IMREAD_GRAYSCALE));
      if (luma->empty()) continue;  // the number of the next one shows the gap
      const bool is_first = num_frames++ == 0;
      frame->flags = TVS_FRAME_KEY | (line.number != next_number && !is_first ? TVS_FRAME_GAP : 0) |
                     (is_first ? TVS_FRAME_NEW_STREAM : 0);
      next_number = line.number + 1;
      frame->image = {luma->data, luma->cols, luma->rows, static_cast<int64_t>(luma->step)};
      frame->number = line.number;
      frame->time = {};
      frame->time.received_ns = frame->time.host_ns = line.time_ns;
      frame->handle = luma.release();
      return TVS_OK;
    }
    return idx_line < lines.size() ? TVS_NONE : TVS_END;
  }

  fs::path folder;
  PacketLog log;
  LoggedPacket packet;
  bool has_packet = false;
  std::vector<FrameLine> lines;
  size_t idx_line = 0;
  uint64_t next_number = 0, num_frames = 0;
  int64_t now_ns = INT64_MIN;
};

tvm_transport transport_of(Playback& playback) {
  tvm_transport transport{};
  transport.struct_size = sizeof transport;
  transport.user = &playback;
  transport.send = [](void*, const void*, size_t) { return TVS_NONE; };
  transport.receive = [](void* user, void* bytes, size_t capacity, size_t* size) {
    return static_cast<Playback*>(user)->receive(bytes, capacity, size);
  };
  return transport;
}

tvs_frame_source camera_of(Playback& playback) {
  tvs_frame_source camera{};
  camera.struct_size = sizeof camera;
  camera.user = &playback;
  camera.next = [](void* user, tvs_frame* frame) {
    return static_cast<Playback*>(user)->next_frame(frame);
  };
  camera.release = [](void*, tvs_frame* frame) { delete static_cast<cv::Mat*>(frame->handle); };
  return camera;
}

int64_t steady_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<int64_t>(now.tv_sec) * 1000000000 + now.tv_nsec;
}

}  // namespace

bool is_vehicle_recording(const std::string& folder) {
  std::error_code error;
  return fs::exists(fs::path(folder) / "vehicle.tlog", error);
}

nlohmann::ordered_json play_vehicle(const std::string& folder, LinkListener listener,
                                    const std::atomic<bool>& stop, double speed,
                                    double duration_s) {
  Playback playback(folder);
  tvm_session_options options;
  tvm_session_options_init(&options);
  options.listen_only = 1;
  VehicleSession session(options, transport_of(playback), std::move(listener), {});
  session.use_camera(camera_of(playback));
  const int64_t begin = playback.next_ns(), start = steady_ns();
  int64_t now = begin, last = begin;
  if (begin == INT64_MAX) throw BadInput("the recording " + folder + " is empty");
  // After the last entry the session goes on until no frame waits for its attitude.
  while (!stop) {
    int64_t next = playback.next_ns();
    // A frame whose time has come but that was not taken, because earlier ones are not taken yet,
    // is tried again later.
    if (next <= playback.now_ns) next = playback.now_ns + 5 * kMs;
    if (duration_s > 0 && next != INT64_MAX && static_cast<double>(next - begin) > duration_s * 1e9)
      break;
    if (next != INT64_MAX)
      last = now = std::max(now, next);
    else if ((now += 20 * kMs) > last + 400 * kMs)
      break;
    if (speed > 0) {
      const int64_t due =
          start + static_cast<int64_t>(static_cast<double>(now - begin) / speed) - steady_ns();
      const timespec pause{due / 1000000000, due % 1000000000};
      if (due > 0) ::nanosleep(&pause, nullptr);
    }
    playback.now_ns = now;
    session.step(now);
  }
  return session.summary(static_cast<double>(last - begin) * 1e-9);
}

VehicleRecording::VehicleRecording(const fs::path& folder) : folder_(folder) {
  make_folder(folder);
  for (const char* name : {"video.pave", "navdata.log", "vehicle.tlog"})
    if (fs::exists(folder / name)) refuse_second_recording(folder);
  log_ = std::make_unique<GrowingFile>(folder / "vehicle.tlog");
  attitude_ = std::make_unique<GrowingFile>(folder / "attitude.tum");
  frames_ = std::make_unique<GrowingFile>(folder / "frames.txt");
  attitude_->append(kAttitudeHead);
  make_folder(folder / "frames");
}

void VehicleRecording::add_packet(int64_t now_ns, const uint8_t* bytes, size_t size) {
  std::string entry;
  const auto time_us = static_cast<uint64_t>(now_ns / 1000) & ~kLinkBits;
  for (int k = 7; k >= 0; --k) entry += static_cast<char>(time_us >> (8 * k) & 255);
  entry.append(reinterpret_cast<const char*>(bytes), size);
  log_->append(entry);
}

void VehicleRecording::add_sample(const tvs_imu& sample) {
  attitude_->append(attitude_line(sample));
}

void VehicleRecording::add_frame(const tvs_frame& frame) {
  write_frame(folder_ / "frames", frame);
  char line[128];
  std::snprintf(line, sizeof line, "%lld %lld %llu 1\n", static_cast<long long>(frame.time.host_ns),
                static_cast<long long>(frame.time.device_ns),
                static_cast<unsigned long long>(frame.number));
  frames_->append(line);
}

void VehicleRecording::add_summary(const std::string& json) {
  OutputSet files(folder_);
  files.add("summary.json", json);
  files.commit();
}

}  // namespace cli
