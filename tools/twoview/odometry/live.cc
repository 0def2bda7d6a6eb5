#include "odometry/live.h"

#include <arpa/inet.h>
#include <microhttpd.h>
#include <netinet/in.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "base/error.h"
#include "odometry/assets.h"
#include "odometry/outputs.h"
#include "odometry/view.h"
#include "pair/session.h"

namespace cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kPeriodNs = 100000000;    // between two updates
constexpr uint64_t kWatchedNs = 3000000000;  // after a request somebody still looks at the page
constexpr size_t kMaxPoints = 6000, kMaxPath = 3000;
constexpr size_t kTrackLength = 8;  // frames of a track, the newest included
constexpr unsigned kMaxConnections = 16, kTimeoutS = 10;

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

void append(Json& list, const double* v) {
  for (int k = 0; k < 3; ++k) list.push_back(rounded(v[k]));
}

// Where a frame sees the points of the map, by the ids of the points.
using Sightings = std::map<int32_t, std::pair<float, float>>;

// Writes the frame's position in the last state of the map, and its segment. False without a pose.
bool position_of(const Flight& flight, const FlightFrame& frame, double t[3], int32_t* segment) {
  double R[9];
  return frame.reference_id >= 0 &&
         tv_odometry_pose_of(flight.odometry(), frame.reference_id,
                             frame.reference_from_cam.R.data(), frame.reference_from_cam.t.data(),
                             R, t, segment) == TV_OK;
}

// The segment of the newest frame that has a pose in the last state of the map, or -1.
int32_t newest_segment(const Flight& flight) {
  const std::vector<FlightFrame>& frames = flight.frames();
  double t[3];
  int32_t segment = -1;
  for (size_t k = frames.size(); k > 0; --k)
    if (position_of(flight, frames[k - 1], t, &segment)) return segment;
  return -1;
}

}  // namespace

struct LivePage::State {
  MHD_Daemon* daemon = nullptr;
  std::atomic<uint16_t> port{0};
  std::atomic<uint64_t> asked_ns{0};
  // What the page fetches. Hold the mutex while reading or writing it.
  std::mutex mutex;
  std::string data = "{\"status\":\"waiting\"}", picture;
  // Of the thread that tracks.
  uint64_t updated_ns = 0;
  std::deque<Sightings> sightings;  // the newest first

  static MHD_Result answer(void* self, MHD_Connection* connection, const char* url,
                           const char* method, const char* version, const char* upload,
                           size_t* upload_size, void** request);
  MHD_Result respond(MHD_Connection* connection, const std::string& path);
  // Whether the request names this server, and not a name that some page made point to it.
  bool is_own(MHD_Connection* connection) const;

  Json tracks(const Flight& flight, const std::vector<tv_map_point>& points);
};

bool LivePage::State::is_own(MHD_Connection* connection) const {
  const char* host = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Host");
  const std::string suffix = ":" + std::to_string(port.load());
  return host != nullptr && (host == "127.0.0.1" + suffix || host == "localhost" + suffix);
}

MHD_Result LivePage::State::respond(MHD_Connection* connection, const std::string& path) {
  std::string body, type = "text/plain; charset=utf-8";
  unsigned status = MHD_HTTP_OK;
  if (!is_own(connection)) {
    status = MHD_HTTP_FORBIDDEN;
    body = "this page is for 127.0.0.1 alone\n";
  } else if (path == "/") {
    type = "text/html; charset=utf-8";
    body = kLivePage;
  } else if (path == "/data.json" || path == "/picture.jpg") {
    asked_ns = now_ns();
    const std::lock_guard<std::mutex> lock(mutex);
    const bool is_data = path == "/data.json";
    type = is_data ? "application/json" : "image/jpeg";
    body = is_data ? data : picture;
    if (body.empty()) status = MHD_HTTP_NOT_FOUND;
  } else {
    status = MHD_HTTP_NOT_FOUND;
    body = "there is no such page\n";
  }
  MHD_Response* response =
      MHD_create_response_from_buffer(body.size(), body.data(), MHD_RESPMEM_MUST_COPY);
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

LivePage::LivePage(int port) : state_(std::make_unique<State>()) {
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
}

LivePage::~LivePage() {
  if (state_->daemon != nullptr) MHD_stop_daemon(state_->daemon);
}

std::string LivePage::address() const {
  return "http://127.0.0.1:" + std::to_string(state_->port.load()) + "/";
}

Json LivePage::State::tracks(const Flight& flight, const std::vector<tv_map_point>& points) {
  std::vector<tv_map_observation> seen(4096);
  int32_t count = 0;
  Json tracks = Json::array();
  if (tv_odometry_last_frame(flight.odometry(), seen.data(), static_cast<int32_t>(seen.size()),
                             &count) != TV_OK)
    return tracks;
  Sightings own;
  for (int32_t k = 0; k < count; ++k) {
    const tv_map_observation& at = seen[static_cast<size_t>(k)];
    if (at.idx_point >= 0 && static_cast<size_t>(at.idx_point) < points.size())
      own[points[static_cast<size_t>(at.idx_point)].id] = {at.x, at.y};
  }
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

void LivePage::update(const Flight& flight) {
  State& s = *state_;
  const uint64_t now = now_ns();
  const uint64_t asked = s.asked_ns;
  if (flight.odometry() == nullptr || flight.picture().empty() || asked == 0 ||
      now - asked > kWatchedNs || now - s.updated_ns < kPeriodNs)
    return;
  s.updated_ns = now;
  const tv_odometry_state& state = flight.state();
  const std::vector<tv_map_point> points = flight.points();
  Json json;
  json["status"] = tv_odometry_status_string(static_cast<tv_odometry_status>(state.status));
  json["reasons"] = reasons_text(flight.frames().back());
  json["time_s"] = rounded(flight.frames().back().time_s - flight.frames().front().time_s);
  json["time_ms"] = rounded(flight.frames().back().time_ms);
  json["num_frames"] = flight.frames().size();
  json["num_inliers"] = state.num_inliers;
  json["num_keyframes"] = state.num_keyframes;
  json["num_points"] = state.num_points;
  std::set<int32_t> segments;
  for (const tv_map_point& point : points) segments.insert(point.segment);
  json["num_segments"] = segments.size();
  json["unit"] = state.scale_source != TV_SCALE_UNIT ? "m" : "";
  json["width"] = flight.picture().cols;
  json["height"] = flight.picture().rows;
  json["tracks"] = s.tracks(flight, points);
  const int32_t segment = newest_segment(flight);
  Json path = Json::array(), cloud = Json::array(), colour = Json::array();
  const std::vector<FlightFrame>& frames = flight.frames();
  const size_t step = frames.size() / kMaxPath + 1;
  for (size_t k = (frames.size() - 1) % step; k < frames.size(); k += step) {
    double t[3];
    int32_t own = -1;
    if (position_of(flight, frames[k], t, &own) && own == segment) append(path, t);
  }
  const std::vector<FlightKeyframe> keyframes = flight.keyframes();
  const std::vector<Rgb> colours = flight.colours(points, keyframes);
  json["view"] = view_of(flight, keyframes, segment).view_from_world;
  const size_t every = points.size() / kMaxPoints + 1;
  for (size_t k = 0; k < points.size(); k += every) {
    if (points[k].segment != segment) continue;
    append(cloud, points[k].position);
    for (const int value : colours[k]) colour.push_back(value);
  }
  json["path"] = path;
  json["points"] = cloud;
  json["colours"] = colour;
  if (state.has_pose != 0) {
    json["camera"] = Json::array();
    for (const double value : state.world_from_cam_R) json["camera"].push_back(rounded(value));
    append(json["camera"], state.world_from_cam_t);
  }
  std::vector<uint8_t> jpeg;
  cv::imencode(".jpg", flight.picture(), jpeg, {cv::IMWRITE_JPEG_QUALITY, 80});
  std::string data = json.dump();
  const std::lock_guard<std::mutex> lock(s.mutex);
  s.data.swap(data);
  s.picture.assign(jpeg.begin(), jpeg.end());
}

}  // namespace cli
