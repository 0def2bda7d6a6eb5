#include "recording/playback.h"

#include <time.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "recording/vehicle.h"
#include "twoview_drivers/ardrone/replay.h"
#include "twoview_drivers/ardrone/sockets.h"

namespace cli {
namespace {

// The open files of a recording, which the destructor closes.
struct Replay {
  explicit Replay(const std::string& folder) {
    if (ardrone_replay_open(&files, folder.c_str(), &transport) != TVS_OK)
      throw BadInput("no recording in " + folder + ": neither navdata.log, video.pave nor " +
                     "vehicle.tlog is there");
  }
  ~Replay() { ardrone_replay_close(&files); }
  Replay(const Replay&) = delete;
  Replay& operator=(const Replay&) = delete;
  ardrone_replay files;
  ardrone_transport transport;
};

}  // namespace

ardrone_counters play(const std::string& folder, LinkListener listener,
                      const std::atomic<bool>& stop, double speed, double duration_s) {
  if (is_vehicle_recording(folder)) {
    play_vehicle(folder, std::move(listener), stop, speed, duration_s);
    return {};
  }
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
  // The session's clock is the recorded host's, so that each playing gives the same times: the
  // measurements of one playing belong to the pictures of another.
  const int64_t start = ardrone_replay_host_ns(&replay.files, 0);
  const int64_t began = ardrone_now_ns();
  int64_t now = start;
  ardrone_replay_advance(&replay.files, now);
  ardrone_session_step(session, now);
  while (!stop) {
    const int64_t next = ardrone_replay_next_ns(&replay.files);
    if (next == INT64_MAX) break;
    now = std::max(now, std::min(next, ardrone_session_next_ns(session)));
    if (duration_s > 0 && static_cast<double>(now - start) > duration_s * 1e9) break;
    if (speed > 0) {
      const int64_t due = began + static_cast<int64_t>(static_cast<double>(now - start) / speed);
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

}  // namespace cli
