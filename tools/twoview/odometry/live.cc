#include "odometry/live.h"

#include <arpa/inet.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <set>
#include <thread>
#ifdef __linux__
#include <sys/resource.h>
#endif

#include "base/error.h"
#include "odometry/assets.h"
#include "odometry/outputs.h"
#include "odometry/view.h"
#include "pair/session.h"
#include "report/assets.h"
#ifdef TWOVIEW_HAS_ROOM
#include "odometry/live_room.h"
#endif

namespace cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kPeriodNs = 100000000;    // between two updates
constexpr uint64_t kWatchedNs = 3000000000;  // after a request somebody still looks at the page
constexpr size_t kMaxPoints = 6000, kMaxPath = 3000;
constexpr size_t kTrackLength = 8;  // frames of a track, the newest included
constexpr unsigned kMaxConnections = 16, kTimeoutS = 10;
constexpr double kShare = 0.02;   // of the tracking thread's CPU time, the most that update() takes
constexpr int kMostColoured = 8;  // keyframes whose colours are looked up in one update
constexpr auto kSurfacePeriod = std::chrono::milliseconds(300);  // between two surfaces

// CPU time of this thread, in milliseconds.
double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// At this priority the thread gets 3.4 % of a core that both threads want.
void lower_priority_of_this_thread() {
#ifdef __linux__
  setpriority(PRIO_PROCESS, 0, 15);
#endif
}

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

void append(Json& list, const double* v) {
  for (int k = 0; k < 3; ++k) list.push_back(rounded(v[k]));
}

// Where a frame sees the points of the map, by the ids of the points.
using Sightings = std::map<int32_t, std::pair<float, float>>;

// The segment of the newest frame that has a pose in the last state of the map, or -1.
int32_t newest_segment(const Flight& flight) {
  const std::vector<FlightFrame>& frames = flight.frames();
  for (size_t k = frames.size(); k > 0; --k)
    if (const int32_t segment = flight.pose_now(frames[k - 1].known).second; segment >= 0)
      return segment;
  return -1;
}

// What one update copies.
struct Snapshot {
  tv_odometry_state state{};
  std::string reasons;
  double time_s = 0, time_ms = 0;
  size_t num_frames = 0;
  cv::Mat picture;
  std::vector<tv_map_observation> seen;  // by the last frame
  std::vector<tv_map_point> points;
  std::map<int32_t, Rgb> colours;  // that are new, by the ids of points
  int32_t segment = -1;
  std::vector<Vector3> path;
  Matrix3 view{};
};

}  // namespace

struct LivePage::State {
  MHD_Daemon* daemon = nullptr;
  std::atomic<uint16_t> port{0};
  std::atomic<uint64_t> asked_ns{0};
  std::thread worker;

  // Used by both threads. Hold the mutex while reading or writing it.
  std::mutex mutex;
  std::condition_variable wakes;
  bool stops = false;
  std::optional<Snapshot> copied;                        // to be written
  std::string data = "\"status\":\"waiting\"", picture;  // what the page fetches
  std::string stage;
  std::shared_ptr<const std::string> surface;
  uint64_t surface_version = 0;
  size_t surface_keyframes = 0;
  bool has_final_surface = false;
#ifdef TWOVIEW_HAS_ROOM
  std::optional<LiveRoom::Job> job;  // to be fused
#endif

  // Used by the thread that tracks only.
  uint64_t updated_ns = 0;
  double watched_since_ms = -1, spent_ms = 0;  // of its CPU time
  std::set<int32_t> coloured;                  // ids of keyframes
  size_t viewed_keyframes = 0;
  int32_t viewed_segment = -1;
  Matrix3 view{};
#ifdef TWOVIEW_HAS_ROOM
  std::optional<LiveRoom> room;
#endif

  // Used by the thread that writes only.
  std::deque<Sightings> sightings;  // the newest first
  std::map<int32_t, Rgb> colours;   // by the ids of points

  static MHD_Result answer(void* self, MHD_Connection* connection, const char* url,
                           const char* method, const char* version, const char* upload,
                           size_t* upload_size, void** request);
  MHD_Result respond(MHD_Connection* connection, const std::string& path);
  // Whether the request was sent to this server by its own address, and not by a foreign name that
  // a page made resolve to it.
  bool is_own(MHD_Connection* connection) const;
  std::string data_text();  // with the mutex held

  void copy(const Flight& flight);
  Snapshot snapshot_of(const Flight& flight);
  void work();
  Json tracks(const Snapshot& snapshot);
  std::string text_of(const Snapshot& snapshot);
};

bool LivePage::State::is_own(MHD_Connection* connection) const {
  const char* host = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Host");
  const std::string suffix = ":" + std::to_string(port.load());
  return host != nullptr && (host == "127.0.0.1" + suffix || host == "localhost" + suffix);
}

// The flight's data change less often than the surface and the stage.
std::string LivePage::State::data_text() {
  Json json;
  json["stage"] = stage;
  json["surface"] = nullptr;
  if (surface)
    json["surface"] = {{"version", surface_version}, {"num_keyframes", surface_keyframes}};
  std::string text = json.dump();
  text.back() = ',';
  return text + data + "}";
}

MHD_Result LivePage::State::respond(MHD_Connection* connection, const std::string& path) {
  std::shared_ptr<const std::string> shared;
  std::string body, type = "text/plain; charset=utf-8";
  unsigned status = MHD_HTTP_OK;
  if (!is_own(connection)) {
    status = MHD_HTTP_FORBIDDEN;
    body = "this page is for 127.0.0.1 alone\n";
  } else if (path == "/") {
    type = "text/html; charset=utf-8";
    body = kLivePage;
  } else if (path == "/surface.js") {
    type = "text/javascript; charset=utf-8";
    body = kSurfaceScript;
  } else if (path == "/data.json" || path == "/picture.jpg") {
    asked_ns = now_ns();
    const std::lock_guard<std::mutex> lock(mutex);
    const bool is_data = path == "/data.json";
    type = is_data ? "application/json" : "image/jpeg";
    body = is_data ? data_text() : picture;
    if (body.empty()) status = MHD_HTTP_NOT_FOUND;
  } else if (path == "/surface.bin") {
    type = "application/octet-stream";
    const std::lock_guard<std::mutex> lock(mutex);
    shared = surface;
    if (!shared) status = MHD_HTTP_NOT_FOUND;
  } else {
    status = MHD_HTTP_NOT_FOUND;
    body = "there is no such page\n";
  }
  const std::string& bytes = shared ? *shared : body;
  MHD_Response* response = MHD_create_response_from_buffer(
      bytes.size(), const_cast<char*>(bytes.data()), MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  MHD_add_response_header(response, "Content-Type", type.c_str());
  MHD_add_response_header(response, "Cache-Control", "no-store");
  MHD_add_response_header(response, "X-Content-Type-Options", "nosniff");
  const MHD_Result result = MHD_queue_response(connection, status, response);
  MHD_destroy_response(response);
  return result;
}

// No exception may pass through the server's C code.
MHD_Result LivePage::State::answer(void* self, MHD_Connection* connection, const char* url,
                                   const char* method, const char*, const char*, size_t*, void**) {
  try {
    if (std::strcmp(method, "GET") != 0) return MHD_NO;
    return static_cast<State*>(self)->respond(connection, url);
  } catch (...) {
    return MHD_NO;
  }
}

LivePage::LivePage(int port, bool shows_room) : state_(std::make_unique<State>()) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  errno = 0;
  state_->daemon = MHD_start_daemon(
      MHD_USE_INTERNAL_POLLING_THREAD, 0, nullptr, nullptr, &State::answer, state_.get(),
      MHD_OPTION_SOCK_ADDR, reinterpret_cast<sockaddr*>(&address), MHD_OPTION_CONNECTION_LIMIT,
      kMaxConnections, MHD_OPTION_CONNECTION_TIMEOUT, kTimeoutS, MHD_OPTION_END);
  if (state_->daemon == nullptr)
    throw BadInput("--live: cannot serve at 127.0.0.1, port " + std::to_string(port) + ": " +
                   (errno != 0 ? std::strerror(errno) : "unknown error"));
  const MHD_DaemonInfo* info = MHD_get_daemon_info(state_->daemon, MHD_DAEMON_INFO_BIND_PORT);
  state_->port = info != nullptr ? info->port : static_cast<uint16_t>(port);
#ifdef TWOVIEW_HAS_ROOM
  if (shows_room) state_->room.emplace();
#else
  (void)shows_room;
#endif
  state_->worker = std::thread([this] { state_->work(); });
}

LivePage::~LivePage() {
  {
    const std::lock_guard<std::mutex> lock(state_->mutex);
    state_->stops = true;
  }
  state_->wakes.notify_all();
  if (state_->worker.joinable()) state_->worker.join();
  if (state_->daemon != nullptr) MHD_stop_daemon(state_->daemon);
}

std::string LivePage::address() const {
  return "http://127.0.0.1:" + std::to_string(state_->port.load()) + "/";
}

void LivePage::tell(const std::string& stage) {
  const std::lock_guard<std::mutex> lock(state_->mutex);
  state_->stage = stage;
}

void LivePage::show(std::string surface, size_t num_keyframes) {
  const std::lock_guard<std::mutex> lock(state_->mutex);
  state_->has_final_surface = true;
  state_->surface = std::make_shared<const std::string>(std::move(surface));
  state_->surface_keyframes = num_keyframes;
  ++state_->surface_version;
}

// -- the thread that tracks ---------------------------------------------------------------------

void LivePage::update(const Flight& flight) {
  State& s = *state_;
  const uint64_t now = now_ns(), asked = s.asked_ns;
  if (asked == 0 || now - asked > kWatchedNs) {
    s.watched_since_ms = -1;
#ifdef TWOVIEW_HAS_ROOM
    if (s.room) s.room->forget_pictures();
#endif
    return;
  }
  if (flight.odometry() == nullptr || flight.picture().empty()) return;
  const double began_ms = cpu_ms();
  if (s.watched_since_ms < 0) {
    s.watched_since_ms = began_ms;
    s.spent_ms = 0;
  }
  if (s.spent_ms > kShare * (began_ms - s.watched_since_ms)) return;
  s.copy(flight);
  s.spent_ms += cpu_ms() - began_ms;
}

// Copies for the writing thread what that has room for. The writing thread holds the mutex briefly,
// but may be interrupted for long while it does; so the tracking thread never waits for the mutex.
void LivePage::State::copy(const Flight& flight) {
#ifdef TWOVIEW_HAS_ROOM
  if (room && room->keep(flight)) {
    std::unique_lock<std::mutex> lock(mutex, std::try_to_lock);
    if (lock.owns_lock() && !job) {
      job = room->next(flight);
      if (job) wakes.notify_one();
    }
  }
#endif
  const uint64_t now = now_ns();
  if (now - updated_ns < kPeriodNs) return;
  updated_ns = now;
  Snapshot made = snapshot_of(flight);
  const std::unique_lock<std::mutex> lock(mutex, std::try_to_lock);
  if (!lock.owns_lock()) return;
  // Colours are copied once, so those of a snapshot that was not written go on.
  if (copied) made.colours.merge(copied->colours);
  copied = std::move(made);
  wakes.notify_one();
}

Snapshot LivePage::State::snapshot_of(const Flight& flight) {
  Snapshot made;
  const std::vector<FlightFrame>& frames = flight.frames();
  made.state = flight.state();
  made.reasons = reasons_text(frames.back());
  made.time_s = frames.back().time_s - frames.front().time_s;
  made.time_ms = frames.back().time_ms;
  made.num_frames = frames.size();
  made.picture = flight.picture().clone();
  made.seen.resize(4096);
  int32_t count = 0;
  if (tv_odometry_last_frame(flight.odometry(), made.seen.data(),
                             static_cast<int32_t>(made.seen.size()), &count) != TV_OK)
    count = 0;
  made.seen.resize(static_cast<size_t>(count));
  made.points = flight.points();
  const std::vector<FlightKeyframe> keyframes = flight.keyframe_poses();
  int num_coloured = 0;
  for (size_t k = keyframes.size(); k > 0 && num_coloured < kMostColoured; --k) {
    if (!coloured.insert(keyframes[k - 1].keyframe.id).second) continue;
    ++num_coloured;
    for (const auto& [seen, rgb] : flight.coloured(static_cast<int32_t>(k - 1)))
      made.colours.emplace(made.points[static_cast<size_t>(seen.idx_point)].id, rgb);
  }
  made.segment = newest_segment(flight);
  // Which way is up changes little with each keyframe more.
  if (made.segment != viewed_segment ||
      keyframes.size() > viewed_keyframes + viewed_keyframes / 8) {
    viewed_segment = made.segment;
    viewed_keyframes = keyframes.size();
    view = view_of(flight, keyframes, made.segment).view_from_world;
  }
  made.view = view;
  const size_t step = frames.size() / kMaxPath + 1;
  for (size_t k = (frames.size() - 1) % step; k < frames.size(); k += step) {
    const auto [pose, own] = flight.pose_now(frames[k].known);
    if (own >= 0 && own == made.segment) made.path.push_back(pose.t);
  }
  return made;
}

// -- the thread that writes ---------------------------------------------------------------------

void LivePage::State::work() {
  lower_priority_of_this_thread();
  std::unique_lock<std::mutex> lock(mutex);
#ifdef TWOVIEW_HAS_ROOM
  RoomPreview preview;
  bool is_unsettled = false, has_grown = false, is_whole = true;
  auto written = std::chrono::steady_clock::now();
  const auto has_work = [&] { return stops || copied || job || is_unsettled; };
#else
  const auto has_work = [&] { return stops || copied; };
#endif
  while (!stops) {
    if (std::optional<Snapshot> taken; copied) {
      taken.swap(copied);
      lock.unlock();
      std::string text = text_of(*taken);
      std::vector<uint8_t> jpeg;
      cv::imencode(".jpg", taken->picture, jpeg, {cv::IMWRITE_JPEG_QUALITY, 80});
      lock.lock();
      data.swap(text);
      picture.assign(jpeg.begin(), jpeg.end());
    }
#ifdef TWOVIEW_HAS_ROOM
    if (std::optional<LiveRoom::Job> taken; job || is_unsettled) {
      taken.swap(job);
      lock.unlock();
      try {
        if (taken && is_whole) preview.add(taken->key, taken->places);
        is_unsettled = is_whole && preview.settle();
        has_grown = is_whole;
      } catch (const std::exception&) {
        is_whole = is_unsettled = false;  // the flight goes on, and what there is stays
      }
      lock.lock();
    }
    const auto now = std::chrono::steady_clock::now();
    if (has_grown && now - written > kSurfacePeriod) {
      lock.unlock();
      std::string bytes;
      try {
        bytes = preview.surface();
      } catch (const std::exception&) {
        is_whole = is_unsettled = false;
      }
      has_grown = false;
      written = now;
      lock.lock();
      if (!bytes.empty() && !has_final_surface) {
        surface = std::make_shared<const std::string>(std::move(bytes));
        surface_keyframes = preview.num_keyframes();
        ++surface_version;
      }
    }
    if (has_grown) {
      wakes.wait_for(lock, kSurfacePeriod, has_work);
      continue;
    }
#endif
    wakes.wait(lock, has_work);
  }
}

Json LivePage::State::tracks(const Snapshot& snapshot) {
  Json tracks = Json::array();
  Sightings own;
  for (const tv_map_observation& at : snapshot.seen)
    if (at.idx_point >= 0 && static_cast<size_t>(at.idx_point) < snapshot.points.size())
      own[snapshot.points[static_cast<size_t>(at.idx_point)].id] = {at.x, at.y};
  sightings.push_front(own);
  if (sightings.size() > kTrackLength) sightings.pop_back();
  for (const auto& [id, pixel] : own) {
    Json track = Json::array();
    for (const Sightings& before : sightings) {
      const auto found = before.find(id);
      if (found == before.end()) break;
      track.push_back(std::round(found->second.first * 4) / 4);
      track.push_back(std::round(found->second.second * 4) / 4);
    }
    tracks.push_back(track);
  }
  return tracks;
}

// The members of the page's data, without braces.
std::string LivePage::State::text_of(const Snapshot& snapshot) {
  const tv_odometry_state& state = snapshot.state;
  const std::vector<tv_map_point>& points = snapshot.points;
  for (const auto& [id, rgb] : snapshot.colours) colours[id] = rgb;
  Json json;
  json["status"] = tv_odometry_status_string(static_cast<tv_odometry_status>(state.status));
  json["reasons"] = snapshot.reasons;
  json["time_s"] = rounded(snapshot.time_s);
  json["time_ms"] = rounded(snapshot.time_ms);
  json["num_frames"] = snapshot.num_frames;
  json["num_inliers"] = state.num_inliers;
  json["num_keyframes"] = state.num_keyframes;
  json["num_points"] = state.num_points;
  std::set<int32_t> segments;
  for (const tv_map_point& point : points) segments.insert(point.segment);
  json["num_segments"] = segments.size();
  json["unit"] = state.scale_source != TV_SCALE_UNIT ? "m" : "";
  json["width"] = snapshot.picture.cols;
  json["height"] = snapshot.picture.rows;
  json["tracks"] = tracks(snapshot);
  Json path = Json::array(), cloud = Json::array(), colour = Json::array();
  for (const Vector3& t : snapshot.path) append(path, t.data());
  json["view"] = snapshot.view;
  const std::vector<Rgb> greys = greys_of(points);
  const size_t every = points.size() / kMaxPoints + 1;
  for (size_t k = 0; k < points.size(); k += every) {
    if (points[k].segment != snapshot.segment) continue;
    append(cloud, points[k].position);
    const auto found = colours.find(points[k].id);
    for (const int value : found != colours.end() ? found->second : greys[k])
      colour.push_back(value);
  }
  json["path"] = path;
  json["points"] = cloud;
  json["colours"] = colour;
  if (state.has_pose != 0) {
    json["camera"] = Json::array();
    for (const double value : state.world_from_cam_R) json["camera"].push_back(rounded(value));
    append(json["camera"], state.world_from_cam_t);
  }
  const std::string text = json.dump();
  return text.substr(1, text.size() - 2);
}

}  // namespace cli
