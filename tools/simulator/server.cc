#include "simulator/server.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <stdexcept>

#include "encode.h"
#include "simulator/camera_loop.h"
#include "simulator/sockets.h"

namespace simulator {
namespace {

constexpr int64_t kSecond = 1000000000;
constexpr int64_t kStallNs = 3 * kSecond;
constexpr int64_t kRebootNs = kSecond;    // the drone sends nothing for this time after a reboot
constexpr size_t kMostUnsent = 1u << 20;  // most bytes that wait for a slow client

int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// A time that is due every `period_s` seconds, first after one period; never if period_s is 0.
class Repeated {
 public:
  Repeated(double period_s, int64_t from_ns)
      : period_ns_(static_cast<int64_t>(period_s * 1e9)), next_ns_(from_ns + period_ns_) {}
  bool is_due(int64_t now) {
    if (period_ns_ <= 0 || now < next_ns_) return false;
    next_ns_ = now + period_ns_;
    return true;
  }

 private:
  int64_t period_ns_, next_ns_;
};

// A TCP port that serves one client and never blocks.
class Stream {
 public:
  Stream(const std::string& host, uint16_t port) : listener_(listen_tcp(host, port)) {}
  uint16_t port() const { return bound_port(listener_); }
  bool has_client() const { return client_.is_open(); }
  void accept() {
    if (client_.is_open()) return;
    client_ = accept_client(listener_);
    unsent_.clear();
  }
  void append(const uint8_t* bytes, size_t size) {
    unsent_.insert(unsent_.end(), bytes, bytes + size);
  }
  size_t num_unsent() const { return unsent_.size(); }
  void flush() {
    if (!client_.is_open() || has_left()) return;
    while (!unsent_.empty()) {
      const ssize_t sent = send(client_.fd(), unsent_.data(), unsent_.size(), MSG_NOSIGNAL);
      if (sent < 0 && (errno == EAGAIN || errno == EINTR)) return;
      if (sent <= 0) {
        client_.close();
        return;
      }
      unsent_.erase(unsent_.begin(), unsent_.begin() + sent);
    }
  }
  void cut() { client_.reset(); }
  void add_to(std::vector<pollfd>& polled) const {
    polled.push_back({client_.is_open() ? client_.fd() : listener_.fd(), POLLIN, 0});
  }

 private:
  // Returns true if the client has closed its side, which a read of 0 bytes shows. Clients send
  // nothing on these ports.
  bool has_left() {
    uint8_t ignored[256];
    const ssize_t got = recv(client_.fd(), ignored, sizeof ignored, MSG_DONTWAIT);
    if (got > 0 || (got < 0 && (errno == EAGAIN || errno == EINTR))) return false;
    client_.close();
    return true;
  }
  Socket listener_, client_;
  std::vector<uint8_t> unsent_;
};

// Converts world_from_body to a quaternion in the order x y z w.
void quaternion(const Mat3& m, double q[4]) {
  const double trace = m[0] + m[4] + m[8];
  const double squares[4] = {1 + 2 * m[0] - trace, 1 + 2 * m[4] - trace, 1 + 2 * m[8] - trace,
                             1 + trace};
  const size_t largest = static_cast<size_t>(std::max_element(squares, squares + 4) - squares);
  const double s = 0.5 / std::sqrt(squares[largest]);
  const double x = m[7] - m[5], y = m[2] - m[6], z = m[3] - m[1];
  const double xy = m[1] + m[3], xz = m[2] + m[6], yz = m[5] + m[7];
  const double table[4][4] = {{squares[0], xy, xz, x},
                              {xy, squares[1], yz, y},
                              {xz, yz, squares[2], z},
                              {x, y, z, squares[3]}};
  for (size_t k = 0; k < 4; ++k) q[k] = table[largest][k] * s;
}

}  // namespace

struct Server::State {
  explicit State(const ServerOptions& given)
      : options(given),
        at(bind_udp(given.host, given.ports.at)),
        navdata(bind_udp(given.host, given.ports.navdata)),
        video(given.host, given.ports.video),
        control(given.host, given.ports.control),
        recording(given.host, given.ports.recording),
        room(given.seed),
        firmware(room, given.start, given.yaw_rad, given.sensors, now_ns()),
        commands_in(given.faults, given.seed + 11),
        navdata_out(given.faults, given.seed + 12),
        random(given.seed + 13),
        camera(options, room) {
    if (given.first_sequence) firmware.set_sequence(*given.first_sequence);
    if (!given.firmware.empty()) firmware.set_version(given.firmware);
    if (!given.truth_file.empty()) {
      truth_file.reset(std::fopen(given.truth_file.c_str(), "w"));
      if (!truth_file) throw std::runtime_error(given.truth_file + ": " + std::strerror(errno));
    }
  }

  void receive(int64_t now);
  void serve_navdata(int64_t now);
  void serve_control();
  void expose(int64_t now);
  void serve_video(int64_t now);
  void send_frame(const CodedFrame& frame);
  void write_truth(const CodedFrame& frame);
  void make_trouble(int64_t now);
  void wait() const;

  struct CloseFile {
    void operator()(FILE* file) const { std::fclose(file); }
  };
  const ServerOptions options;
  Socket at, navdata;
  Stream video, control, recording;
  const room::Room room;
  Firmware firmware;
  FaultyLink commands_in, navdata_out;
  room::Random random;
  CameraLoop camera;
  std::unique_ptr<FILE, CloseFile> truth_file;
  sockaddr_in listener{};  // the address from which the client started navdata
  int64_t next_exposure_ns = 0, stalled_until_ns = 0, dead_until_ns = 0;
  std::optional<Repeated> cuts, stalls, reboots;
  uint32_t frame_number = 0;
  uint64_t stream_position = 0;
  ServerCounts counts;
  mutable std::mutex truth_mutex;
  FlightState truth;
};

void Server::State::receive(int64_t now) {
  uint8_t bytes[2048];
  sockaddr_in from{};
  socklen_t from_size = sizeof from;
  ssize_t size;
  while ((size = recvfrom(at.fd(), bytes, sizeof bytes, 0, nullptr, nullptr)) >= 0) {
    if (now < dead_until_ns) continue;
    for (const FaultyLink::Bytes& datagram : commands_in.send({bytes, bytes + size})) {
      firmware.receive_commands({reinterpret_cast<const char*>(datagram.data()), datagram.size()},
                                now);
    }
  }
  while ((size = recvfrom(navdata.fd(), bytes, sizeof bytes, 0, reinterpret_cast<sockaddr*>(&from),
                          &from_size)) >= 0) {
    if (now < dead_until_ns || size == 0) continue;
    listener = from;
    firmware.receive_hello(now);
  }
}

void Server::State::serve_navdata(int64_t now) {
  while (std::optional<std::vector<uint8_t>> packet = firmware.next_navdata(now)) {
    for (const FaultyLink::Bytes& datagram : navdata_out.send(std::move(*packet))) {
      sendto(navdata.fd(), datagram.data(), datagram.size(), MSG_DONTWAIT,
             reinterpret_cast<const sockaddr*>(&listener), sizeof listener);
      ++counts.navdata_sent;
    }
  }
}

void Server::State::serve_control() {
  control.accept();
  if (control.has_client()) {
    if (const std::optional<std::string> text = firmware.take_control_text()) {
      control.append(reinterpret_cast<const uint8_t*>(text->data()), text->size());
    }
  }
  control.flush();
}

void Server::State::expose(int64_t now) {
  if (now < next_exposure_ns || !(video.has_client() || recording.has_client())) return;
  const int64_t period = kSecond / options.frames_per_second;
  next_exposure_ns = std::max(next_exposure_ns + period, now - period);
  if (options.has_tour) firmware.begin_tour();
  camera.expose(firmware.truth(), firmware.uptime_ns(now), firmware.wants_720p());
}

void Server::State::serve_video(int64_t now) {
  for (const CodedFrame& frame : camera.take()) send_frame(frame);
  video.accept();
  recording.accept();
  if (now >= stalled_until_ns) video.flush();
  recording.flush();
}

void Server::State::send_frame(const CodedFrame& frame) {
  ardrone_pave_header header{};
  header.version = 2;
  header.codec = ARDRONE_PAVE_H264;
  header.header_size = static_cast<uint16_t>(options.pave_header_bytes);
  header.payload_size = static_cast<uint32_t>(frame.packet.payload.size());
  header.encoded_width = static_cast<uint16_t>((frame.width + 15) / 16 * 16);
  header.encoded_height = static_cast<uint16_t>((frame.height + 15) / 16 * 16);
  header.display_width = static_cast<uint16_t>(frame.width);
  header.display_height = static_cast<uint16_t>(frame.height);
  header.frame_number = ++frame_number;
  header.timestamp_ms = static_cast<uint32_t>(frame.uptime_ns / 1000000);
  header.total_chunks = 1;
  header.frame_type = frame.packet.is_key ? ARDRONE_PAVE_IDR : ARDRONE_PAVE_P;
  header.position_low = static_cast<uint32_t>(stream_position);
  header.position_high = static_cast<uint32_t>(stream_position >> 32);
  header.stream_id = frame.width > 640 ? 2 : 1;
  header.total_slices = 1;
  header.sps_size = frame.packet.sps_bytes;
  header.pps_size = frame.packet.pps_bytes;
  header.advertised_size = header.payload_size;
  header.extra = 2;
  header.angles[0] = static_cast<float>(frame.truth.pitch);
  header.angles[1] = static_cast<float>(frame.truth.roll);
  header.angles[2] = static_cast<float>(frame.truth.yaw);
  stream_position += header.payload_size - header.sps_size - header.pps_size;
  std::vector<uint8_t> bytes(header.header_size + frame.packet.payload.size());
  size_t size = 0;
  if (ardrone_encode_pave(&header, frame.packet.payload.data(), bytes.data(), bytes.size(),
                          &size) != TVS_OK) {
    throw std::runtime_error("a picture does not fit into a PaVE packet");
  }
  write_truth(frame);
  if (recording.has_client()) recording.append(bytes.data(), size);
  if (!video.has_client()) return;
  if (video.num_unsent() > kMostUnsent) {
    ++counts.frames_left_out;
    return;
  }
  if (options.video_garbage > 0 && random.uniform(0, 1) < options.video_garbage) {
    std::vector<uint8_t> garbage(static_cast<size_t>(random.uniform(1, 400)));
    for (uint8_t& byte : garbage) byte = static_cast<uint8_t>(random.next());
    video.append(garbage.data(), garbage.size());
  }
  video.append(bytes.data(), size);
  ++counts.frames_sent;
}

void Server::State::write_truth(const CodedFrame& frame) {
  if (!truth_file) return;
  const FlightState& t = frame.truth;
  double q[4];
  quaternion(world_from_body(t), q);
  std::fprintf(truth_file.get(), "%u %.9f %.6f %.6f %.6f %.9f %.9f %.9f %.9f %.6f %.6f %.6f\n",
               frame_number, static_cast<double>(frame.uptime_ns) * 1e-9, t.position[0],
               t.position[1], t.position[2], q[0], q[1], q[2], q[3], t.velocity[0], t.velocity[1],
               t.velocity[2]);
  std::fflush(truth_file.get());
}

void Server::State::make_trouble(int64_t now) {
  if (cuts->is_due(now) && video.has_client()) {
    video.cut();
    ++counts.video_cuts;
  }
  if (stalls->is_due(now)) {
    stalled_until_ns = now + kStallNs;
    ++counts.video_stalls;
  }
  if (reboots->is_due(now)) {
    firmware.reboot(now);
    video.cut();
    control.cut();
    recording.cut();
    dead_until_ns = now + kRebootNs;
    ++counts.reboots;
  }
}

void Server::State::wait() const {
  std::vector<pollfd> polled = {{at.fd(), POLLIN, 0}, {navdata.fd(), POLLIN, 0}};
  video.add_to(polled);
  control.add_to(polled);
  recording.add_to(polled);
  poll(polled.data(), polled.size(), 2);  // waits at most 2 ms, since navdata is due every 5 ms
}

Server::Server(const ServerOptions& options) : state_(std::make_unique<State>(options)) {}
Server::~Server() = default;

Ports Server::ports() const {
  Ports ports;
  ports.at = bound_port(state_->at);
  ports.navdata = bound_port(state_->navdata);
  ports.video = state_->video.port();
  ports.control = state_->control.port();
  ports.recording = state_->recording.port();
  return ports;
}

void Server::run(const std::atomic<bool>& stop, double seconds) {
  State& s = *state_;
  const int64_t start = now_ns();
  s.next_exposure_ns = start;
  s.cuts.emplace(s.options.cut_video_every_s, start);
  s.stalls.emplace(s.options.stall_video_every_s, start);
  s.reboots.emplace(s.options.reboot_every_s, start);
  while (!stop) {
    const int64_t now = now_ns();
    if (seconds > 0 && now - start >= static_cast<int64_t>(seconds * 1e9)) break;
    s.make_trouble(now);
    s.receive(now);
    s.firmware.advance(now);
    if (now >= s.dead_until_ns) {
      s.serve_navdata(now);
      s.serve_control();
      s.expose(now);
      s.serve_video(now);
    }
    {
      const std::lock_guard<std::mutex> lock(s.truth_mutex);
      s.truth = s.firmware.truth();
      s.counts.commands_obeyed = s.firmware.num_obeyed();
      s.counts.commands_refused = s.firmware.num_refused();
      s.counts.take_offs = s.firmware.num_take_offs();
    }
    s.wait();
  }
}

ServerCounts Server::counts() const {
  const std::lock_guard<std::mutex> lock(state_->truth_mutex);
  return state_->counts;
}

FlightState Server::truth() const {
  const std::lock_guard<std::mutex> lock(state_->truth_mutex);
  return state_->truth;
}

}  // namespace simulator
