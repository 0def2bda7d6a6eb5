#include "drone/link.h"

#include <algorithm>

#include "error.h"
#include "twoview_drivers/ardrone/replay.h"
#include "twoview_drivers/h264.h"

namespace cli {
namespace {

constexpr int64_t kLongestWaitNs = 20000000;

LinkListener& listener_of(void* user) { return *static_cast<LinkListener*>(user); }

// The session's callbacks are C: they lead to the listener's functions.
void tell_event(void* user, ardrone_event event, const char* key) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_event) listener.on_event(event, key != nullptr ? key : "");
}
void tell_navdata(void* user, const uint8_t* bytes, size_t size, const ardrone_navdata* navdata,
                  const tvs_imu* imu) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_navdata) listener.on_navdata(bytes, size, *navdata, *imu);
}
void tell_packet(void* user, const ardrone_pave_packet* packet, const tvs_time* time, int gate) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_packet) listener.on_packet(*packet, *time, gate);
}
void tell_frame(void* user, const tvs_frame* frame) {
  const LinkListener& listener = listener_of(user);
  if (listener.on_frame) listener.on_frame(*frame);
}

void set_callbacks(LinkListener& listener, ardrone_session_options& options) {
  options.user = &listener;
  options.on_event = tell_event;
  options.on_navdata = tell_navdata;
  options.on_packet = tell_packet;
  options.on_frame = tell_frame;
}

using SessionMemory = std::vector<std::max_align_t>;

ardrone_session* make_session(const ardrone_session_options& options,
                              const ardrone_transport& transport, SessionMemory& memory) {
  size_t bytes = 0;
  check_driver(ardrone_session_size(&options, &bytes), "session");
  memory.resize(bytes / sizeof(std::max_align_t) + 1);
  ardrone_session* session = nullptr;
  check_driver(ardrone_session_init(&session, &options, &transport, memory.data(),
                                    memory.size() * sizeof(std::max_align_t)),
               "session");
  return session;
}

// A recording's files, closed with their owner.
struct Replay {
  explicit Replay(const std::string& folder) {
    const tvs_status status = ardrone_replay_open(&files, folder.c_str(), &transport);
    if (status != TVS_OK)
      throw BadInput("no recording in " + folder +
                     " (navdata.log, video.pave): " + tvs_status_string(status));
  }
  ~Replay() { ardrone_replay_close(&files); }
  Replay(const Replay&) = delete;
  Replay& operator=(const Replay&) = delete;
  ardrone_replay files;
  ardrone_transport transport;
};

}  // namespace

void check_driver(tvs_status status, const std::string& what) {
  if (status != TVS_OK) throw BadInput(what + ": " + tvs_status_string(status));
}

Decoder::Decoder() { check_driver(tvs_h264_open(&decoder_), "cannot decode H.264"); }
Decoder::~Decoder() { tvs_h264_close(&decoder_); }

Link::Link(const DroneAddress& address, ardrone_session_options options, LinkListener listener)
    : listener_(std::move(listener)) {
  check_driver(ardrone_sockets_init(&sockets_, address.host.c_str(), &transport_),
               "no host " + address.host);
  sockets_.port[ARDRONE_CHANNEL_AT] = static_cast<uint16_t>(address.at_port);
  sockets_.port[ARDRONE_CHANNEL_NAVDATA] = static_cast<uint16_t>(address.navdata_port);
  sockets_.port[ARDRONE_CHANNEL_VIDEO] = static_cast<uint16_t>(address.video_port);
  sockets_.port[ARDRONE_CHANNEL_CONTROL] = static_cast<uint16_t>(address.control_port);
  set_callbacks(listener_, options);
  session_ = make_session(options, transport_, memory_);
}

Link::~Link() { ardrone_session_close(session_); }

ardrone_counters Link::counters() const {
  ardrone_counters counters;
  ardrone_session_counters(session_, &counters);
  return counters;
}

ardrone_counters play(const std::string& folder, LinkListener listener,
                      const std::atomic<bool>& stop, double speed) {
  const Decoder decoder;
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.listen_only = 1;
  options.skip_to_latest = 0;
  options.queue_frames = 0;
  options.decoder = decoder.get();
  set_callbacks(listener, options);
  Replay replay(folder);
  SessionMemory memory;
  ardrone_session* session = make_session(options, replay.transport, memory);
  const int64_t start = ardrone_now_ns();
  int64_t now = start;
  ardrone_replay_advance(&replay.files, now);
  ardrone_session_step(session, now);
  while (!stop) {
    const int64_t next = ardrone_replay_next_ns(&replay.files);
    if (next == INT64_MAX) break;
    now = std::max(now, std::min(next, ardrone_session_next_ns(session)));
    if (speed > 0) {
      const int64_t due = start + static_cast<int64_t>(static_cast<double>(now - start) / speed);
      const int64_t wait = due - ardrone_now_ns();
      const timespec pause{wait / 1000000000, wait % 1000000000};
      if (wait > 0) ::nanosleep(&pause, nullptr);
    }
    ardrone_replay_advance(&replay.files, now);
    ardrone_session_step(session, now);
  }
  ardrone_counters counters;
  ardrone_session_counters(session, &counters);
  ardrone_session_close(session);
  return counters;
}

nlohmann::ordered_json summary_json(const ardrone_counters& n, double seconds) {
  return {{"frames_received", n.packets},
          {"frames_decoded", n.frames_decoded},
          {"frames_dropped", n.packets_skipped + n.frames_failed + n.frames_dropped},
          {"gaps", n.gaps},
          {"navdata_received", n.navdata_received},
          {"navdata_rejected", n.navdata_rejected},
          {"reconnects", (n.links > 0 ? n.links - 1 : 0) +
                             (n.video_connections > 0 ? n.video_connections - 1 : 0)},
          {"seconds", seconds}};
}

bool Link::run(const std::function<bool()>& done, const std::atomic<bool>& stop, double seconds) {
  const int64_t start = ardrone_now_ns();
  const int64_t end = seconds > 0 ? start + static_cast<int64_t>(seconds * 1e9) : INT64_MAX;
  while (!stop) {
    const int64_t now = ardrone_now_ns();
    if (now >= end) return false;
    ardrone_session_step(session_, now);
    if (done && done()) return true;
    ardrone_session_wait(session_, std::min(end, now + kLongestWaitNs));
  }
  return false;
}

}  // namespace cli
