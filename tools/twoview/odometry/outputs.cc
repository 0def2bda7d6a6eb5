#include "odometry/outputs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "odometry/truth_doubts.h"
#include "report/ply.h"

namespace cli {
namespace {

using Json = nlohmann::ordered_json;

const Pose& pose_of(const FlightFrame& frame, bool live) { return live ? frame.live : frame.pose; }
int32_t segment_of(const FlightFrame& frame, bool live) {
  if (live) return frame.live_segment;
  return frame.origin == PoseOrigin::kNone ? -1 : frame.segment;
}

// The segment with the most frames; the first one on a tie, -1 without any pose.
int32_t longest_segment(const Flight& flight) {
  std::map<int32_t, int> counts;
  for (const FlightFrame& frame : flight.frames())
    if (segment_of(frame, false) >= 0) ++counts[segment_of(frame, false)];
  int32_t best = -1;
  for (const auto& [segment, count] : counts)
    if (best < 0 || count > counts[best]) best = segment;
  return best;
}

LiveStretch longest_stretch(const Flight& flight) {
  std::map<std::pair<int32_t, bool>, int> counts;
  for (const FlightFrame& frame : flight.frames())
    if (frame.live_segment >= 0) ++counts[{frame.live_segment, frame.live_metric}];
  LiveStretch best;
  int most = 0;
  for (const auto& [stretch, count] : counts) {
    if (count <= most) continue;
    most = count;
    best = {stretch.first, stretch.second};
  }
  return best;
}

// The number with the digits that the table of times needs.
std::string milliseconds(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f", value);
  return text;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == text.npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string seconds(double time_s) {
  char text[64];
  std::snprintf(text, sizeof text, "%.9f", time_s);
  return text;
}

// The value below which the share of the sorted values lies: the nearest rank.
double quantile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0;
  const double rank = std::ceil(share * static_cast<double>(sorted.size()));
  return sorted[static_cast<size_t>(std::max(1.0, rank)) - 1];
}

Json times_json(const Flight& flight) {
  std::vector<double> times;
  double sum = 0;
  for (const FlightFrame& frame : flight.frames()) {
    if (frame.unreadable || frame.withheld) continue;
    times.push_back(frame.time_ms);
    sum += frame.time_ms;
  }
  if (times.empty())
    return {{"mean", nullptr}, {"median", nullptr}, {"p99", nullptr}, {"max", nullptr}};
  std::sort(times.begin(), times.end());
  return {{"mean", sum / static_cast<double>(times.size())},
          {"median", quantile(times, 0.5)},
          {"p99", quantile(times, 0.99)},
          {"max", times.back()}};
}

double path_length(const Trajectory& trajectory) {
  double sum = 0;
  for (size_t i = 1; i < trajectory.size(); ++i) {
    Vector3 d = trajectory[i].pose.t;
    for (size_t k = 0; k < 3; ++k) d[k] -= trajectory[i - 1].pose.t[k];
    sum += norm(d);
  }
  return sum;
}

Json truth_json(const FlightResult& result, bool is_metric) {
  if (!result.has_truth) return nullptr;
  const Accuracy& a = result.accuracy;
  const Accuracy& live = result.live_accuracy;
  Json json;
  const Trajectory best = trajectory_of(*result.flight, result.segment);
  json["coverage"] =
      result.num_source_frames > 0
          ? static_cast<double>(best.size()) / static_cast<double>(result.num_source_frames)
          : 0.0;
  json["num_compared"] = a.num_poses;
  const bool known = a.has_errors();
  const auto number = [](bool has, double value) {
    return has && std::isfinite(value) ? Json(value) : Json(nullptr);
  };
  json["path_length"] = number(a.num_poses >= 3, a.path_length);
  json["ate_rmse"] = number(known, a.ate_rmse);
  json["ate_live_rmse"] = number(live.has_errors(), live.ate_rmse);
  json["ate_rmse_percent_of_path"] = number(known, 100 * a.ate_rmse / a.path_length);
  json["ate_metric_rmse"] = number(known && is_metric, a.ate_rigid_rmse);
  json["rpe_rotation_deg"] = number(known, a.rpe_rotation_deg);
  json["rpe_translation_rmse"] = number(known, a.rpe_translation_rmse);
  const double step = a.path_length / std::max(1.0, static_cast<double>(a.num_poses) - 1);
  json["rpe_translation_percent"] = number(known, 100 * a.rpe_translation_rmse / step);
  json["scale_ratio"] = number(known, 1 / a.similarity.scale);
  return json;
}

constexpr double kMostCloudCosine =
    0.9996573250;  // of 1.5 degrees, the least angle that COLMAP keeps

// The largest standard deviation along a coordinate axis would depend on the axes: the square root
// of the trace does not.
float sigma_of(const tv_map_point& point) {
  const double* c = point.covariance;
  return static_cast<float>(std::sqrt(std::max(0.0, c[0] + c[4] + c[8])));
}

std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, " %.17g", value);
  return text;
}

// COLMAP counts pixels from the corner of the first one: its coordinates are larger by 0.5.
std::string colmap_cameras(const tv_camera& c) {
  const bool is_rational = std::any_of(c.k + 4, c.k + 8, [](double k) { return k != 0; });
  const char* model = c.model == TV_CAMERA_PINHOLE          ? "PINHOLE"
                      : c.model == TV_CAMERA_KANNALA_BRANDT ? "OPENCV_FISHEYE"
                      : is_rational                         ? "FULL_OPENCV"
                                                            : "OPENCV";
  const int count = c.model == TV_CAMERA_PINHOLE                        ? 0
                    : c.model == TV_CAMERA_BROWN_CONRADY && is_rational ? 8
                                                                        : 4;
  std::string text =
      "# Camera list with one line of data per camera:\n"
      "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
      "# Number of cameras: 1\n1 ";
  text += model + std::string(" ") + std::to_string(c.width) + " " + std::to_string(c.height);
  for (const double value : {c.fx, c.fy, c.cx + 0.5, c.cy + 0.5}) text += number_text(value);
  for (int k = 0; k < count; ++k) text += number_text(c.k[k]);
  return text + "\n";
}

// Maps a pixel of one camera to the pixel of another camera with the same pose; false where that is
// outside its picture.
bool moved(const tv_camera& from, const tv_camera& to, std::array<double, 2>& pixel) {
  double ray[3];
  return tv_camera_unproject(&from, pixel.data(), ray, nullptr) == TV_OK &&
         tv_camera_project(&to, ray, pixel.data(), nullptr) == TV_OK && pixel[0] >= -0.5 &&
         pixel[1] >= -0.5 && pixel[0] <= to.width - 0.5 && pixel[1] <= to.height - 0.5;
}

// The standard deviation of the longest segment's scale, as its last frame that was tracked in it
// said: the segment that the film ends in may be another one. 0: its unit is not the metre, or the
// sensors have contradicted each other since.
double scale_sigma_of(const FlightResult& result) {
  if (result.flight->state().scale_contradicted != 0) return 0;
  double sigma = 0;
  for (const FlightFrame& frame : result.flight->frames())
    if (frame.live_segment >= 0 && frame.segment == result.segment) sigma = frame.live_scale_sigma;
  return sigma;
}

// The metres of one unit of the map by each sensor, where the two contradict each other; else null.
Json scale_contradiction(const tv_odometry_state& state) {
  if (state.scale_contradicted == 0) return nullptr;
  return {{"height", {{"scale", state.height_scale}, {"sigma", state.height_scale_sigma}}},
          {"velocity", {{"scale", state.velocity_scale}, {"sigma", state.velocity_scale_sigma}}}};
}

}  // namespace

Pose pose_of(const tv_keyframe& keyframe) {
  Pose pose;
  std::copy(keyframe.world_from_cam_R, keyframe.world_from_cam_R + 9, pose.R.begin());
  std::copy(keyframe.world_from_cam_t, keyframe.world_from_cam_t + 3, pose.t.begin());
  return pose;
}

Trajectory trajectory_of(const Flight& flight, int32_t segment) {
  Trajectory trajectory;
  for (const FlightFrame& frame : flight.frames())
    if (segment >= 0 && segment_of(frame, false) == segment)
      trajectory.push_back({frame.time_s, frame.pose});
  return trajectory;
}

Trajectory live_trajectory_of(const Flight& flight, const LiveStretch& stretch) {
  Trajectory trajectory;
  for (const FlightFrame& frame : flight.frames())
    if (stretch.segment >= 0 && frame.live_segment == stretch.segment &&
        frame.live_metric == stretch.is_metric)
      trajectory.push_back({frame.time_s, frame.live});
  return trajectory;
}

namespace {

FrameClock clock_of(const Flight& flight, double film_start_s) {
  FrameClock clock;
  clock.film_start_s = film_start_s;
  for (const FlightFrame& frame : flight.frames()) {
    clock.numbers.push_back(frame.index);
    clock.times_s.push_back(frame.time_s);
    clock.names.push_back(frame.name);
  }
  return clock;
}

}  // namespace

FlightResult result_of(const Flight& flight, const std::optional<TruePoses>& truth,
                       double film_start_s, int num_source_frames) {
  FlightResult result;
  result.flight = &flight;
  result.num_source_frames = num_source_frames;
  result.keyframes = flight.keyframes();
  add_covariances(flight.odometry(), result.keyframes);
  result.points = flight.points();
  result.colours = flight.colours(result.points, result.keyframes);
  result.segment = longest_segment(flight);
  result.live_stretch = longest_stretch(flight);
  if (truth) {
    result.has_truth = true;
    TruePoses fitted = *truth;
    const Trajectory path = trajectory_of(flight, result.segment);
    const FrameClock clock = clock_of(flight, film_start_s);
    result.truth_notes = truth->notes;
    result.truth_note = fit_times(path, fitted, clock);
    for (const std::string& note : {result.truth_note, rotation_words(path, fitted)})
      if (!note.empty()) result.truth_notes.push_back(note);
    for (const std::string& doubt : truth_doubts(path, fitted, clock))
      result.truth_notes.push_back(doubt);
    result.truth = fitted.poses;
    result.accuracy = accuracy_of(path, result.truth);
    result.live_accuracy =
        accuracy_of(live_trajectory_of(flight, result.live_stretch), result.truth);
  }
  result.json = flight_json(result);
  return result;
}

Json flight_json(const FlightResult& result) {
  const Flight& flight = *result.flight;
  const tv_odometry_state& state = flight.state();
  std::map<int32_t, int> counts;
  int num_tracked = 0, num_located = 0, num_ignored = 0;
  for (const FlightFrame& frame : flight.frames()) {
    ++counts[frame.status];
    num_tracked += frame.origin != PoseOrigin::kNone;
    num_located += frame.origin == PoseOrigin::kLocated;
    num_ignored += frame.attitude_ignored;
  }
  const double scale_sigma = scale_sigma_of(result);
  const bool is_metric = scale_sigma > 0;
  Json json;
  json["num_frames"] = flight.frames().size();
  json["num_tracked"] = num_tracked;
  json["num_located"] = num_located;
  json["num_unreadable"] = flight.num_unreadable();
  json["num_repeated"] = flight.num_repeated();
  const std::string eyes = layout_name(flight.eyes().layout());
  json["two_eyes"] = eyes.empty() ? Json(nullptr) : Json(eyes);
  json["combed_share"] = flight.combed_rows().share();
  json["num_keyframes"] = result.keyframes.size();
  json["num_points"] = result.points.size();
  json["num_segments"] = count_segments(result.keyframes);
  json["num_relocalisations"] = state.num_relocations;
  json["num_loops"] = state.num_loops;
  json["num_attitudes_ignored"] = num_ignored;
  json["masked_share"] = flight.masked_share();
  json["still_share"] = masked_share(flight.still_mask());
  json["longest_segment"] = result.segment;
  json["path_length"] = path_length(trajectory_of(flight, result.segment));
  for (int32_t s = 0; s < TV_ODOMETRY_NUM_STATUSES; ++s)
    json["status_counts"][tv_odometry_status_string(static_cast<tv_odometry_status>(s))] =
        counts[s];
  json["scale"] = is_metric ? "metric" : "unit";
  json["scale_sigma"] = is_metric ? Json(scale_sigma) : Json(nullptr);
  json["scale_contradiction"] = scale_contradiction(state);
  if (flight.has_corrected_camera())
    json["principal_point_shift_px"] = state.principal_point_shift_px;
  else
    json["principal_point_shift_px"] = nullptr;
  json["time_ms"] = times_json(flight);
  json["context_bytes"] = flight.context_bytes();
  json["truth"] = truth_json(result, is_metric);
  return json;
}

std::string trajectory_text(const Flight& flight, bool live) {
  std::string text =
      live ? "# timestamp tx ty tz qx qy qz qw, world_from_cam, as known when the frame was "
             "tracked\n"
           : "# timestamp tx ty tz qx qy qz qw, world_from_cam, in the last state of the map\n";
  int32_t segment = -1;
  bool is_metric = false;
  for (const FlightFrame& frame : flight.frames()) {
    const int32_t own = segment_of(frame, live);
    if (own < 0) continue;
    if (own != segment)
      text += "# segment " + std::to_string(own) +
              ": its poses do not compare with those of another segment\n";
    if (live && (own != segment ? frame.live_metric : frame.live_metric != is_metric))
      text += frame.live_metric ? "# the unit is the metre from here on\n"
                                : "# the unit is not the metre from here on\n";
    segment = own;
    is_metric = frame.live_metric;
    text += tum_line(frame.time_s, pose_of(frame, live));
  }
  return text;
}

std::string keyframes_text(const FlightResult& result) {
  std::string text = "# timestamp tx ty tz qx qy qz qw, world_from_cam, of the map's keyframes\n";
  int32_t segment = -1;
  for (const FlightKeyframe& key : result.keyframes) {
    if (key.keyframe.segment != segment)
      text += "# segment " + std::to_string(key.keyframe.segment) +
              ": its poses do not compare with those of another segment\n";
    segment = key.keyframe.segment;
    text += tum_line(key.keyframe.time_s, pose_of(key.keyframe));
  }
  return text;
}

std::string covariances_text(const std::vector<FlightKeyframe>& keyframes) {
  std::string text;
  for (size_t k = 1; k < keyframes.size(); ++k) {
    const tv_keyframe &before = keyframes[k - 1].keyframe, &own = keyframes[k].keyframe;
    if (!keyframes[k].has_covariance || own.segment != before.segment) continue;
    text += seconds(before.time_s) + " " + seconds(own.time_s);
    for (const double value : keyframes[k].covariance) text += number_text(value);
    text += "\n";
  }
  if (text.empty()) return text;
  return "# time0 time1 c00 c01 ... c55: the row-major covariance of cam1_from_cam0 of consecutive "
         "keyframes in (w, v),\n"
         "# with x_true = exp([w]x) x + v for a point x in camera 1; radians and units of the "
         "map\n" +
         text;
}

std::string reasons_text(const FlightFrame& frame) {
  if (frame.unreadable) return "unreadable";
  if (frame.is_repeated) return "repeated";
  std::string text;
  for (uint32_t bit = 1; bit != 0 && bit <= frame.reasons; bit <<= 1) {
    if ((frame.reasons & bit) == 0) continue;
    text += (text.empty() ? "" : " ") + std::string(tv_reason_string(static_cast<tv_reason>(bit)));
  }
  return text;
}

std::string map_reasons_text(const FlightFrame& frame) {
  const char* const words[] = {"unconfirmed", "contradicted",    "one_plane",
                               "jumped",      "unsure_attitude", "velocities_disagree"};
  std::string text;
  for (size_t k = 0; k < std::size(words); ++k)
    if ((frame.map_reasons >> k & 1) != 0)
      text += (text.empty() ? "" : " ") + std::string(words[k]);
  return text;
}

std::string frames_csv(const Flight& flight) {
  std::string text =
      "timestamp,name,status,reasons,segment,num_tracked,is_keyframe,time_ms,relocated,"
      "loop_closed,pose,attitude_ignored,scale,map_reasons\n";
  const char* const origins[] = {"none", "tracked", "located"};
  for (const FlightFrame& frame : flight.frames()) {
    const auto status = static_cast<tv_odometry_status>(frame.status);
    text += seconds(frame.time_s) + "," + csv_field(frame.name) + "," +
            tv_odometry_status_string(status) + "," + reasons_text(frame) + "," +
            std::to_string(frame.live_segment) + "," + std::to_string(frame.num_inliers) + "," +
            (frame.is_keyframe ? "1," : "0,") + milliseconds(frame.time_ms) +
            (frame.relocated ? ",1" : ",0") + (frame.loop_closed ? ",1," : ",0,") +
            origins[static_cast<int>(frame.origin)] + (frame.attitude_ignored ? ",1," : ",0,") +
            (frame.live_segment < 0 ? "none"
             : frame.live_metric    ? "metric"
                                    : "unit") +
            "," + map_reasons_text(frame) + "\n";
  }
  return text;
}

std::vector<size_t> cloud_points(const std::vector<tv_map_point>& points,
                                 const std::vector<FlightKeyframe>& keyframes) {
  std::vector<std::vector<Vector3>> rays(points.size());  // to each point, of length 1
  for (const FlightKeyframe& key : keyframes) {
    for (const tv_map_observation& seen : key.observations) {
      if (seen.idx_point < 0) continue;
      const size_t point = static_cast<size_t>(seen.idx_point);
      Vector3 ray;
      for (size_t k = 0; k < 3; ++k)
        ray[k] = points[point].position[k] - key.keyframe.world_from_cam_t[k];
      const double length = norm(ray);
      for (double& value : ray) value /= length;
      rays[point].push_back(ray);
    }
  }
  std::vector<size_t> chosen;
  for (size_t k = 0; k < points.size(); ++k) {
    double cosine = 1;
    for (const Vector3& one : rays[k])
      for (const Vector3& other : rays[k]) cosine = std::min(cosine, dot(one, other));
    if (cosine <= kMostCloudCosine) chosen.push_back(k);
  }
  return chosen;
}

std::string map_ply(const std::vector<tv_map_point>& points, const std::vector<Rgb>& colours,
                    const std::vector<FlightKeyframe>& keyframes) {
  const std::vector<size_t> chosen = cloud_points(points, keyframes);
  std::string bytes =
      ply_header({"the map's world; points of different segments do not compare"}, chosen.size(),
                 {{PlyType::kFloat, {"x", "y", "z"}},
                  {PlyType::kUchar, {"red", "green", "blue"}},
                  {PlyType::kFloat, {"num_observations", "sigma", "segment"}}});
  for (const size_t k : chosen) {
    const tv_map_point& point = points[k];
    for (const double value : point.position) append_float(bytes, static_cast<float>(value));
    for (const uint8_t value : colours[k]) bytes += static_cast<char>(value);
    append_float(bytes, static_cast<float>(point.num_observations));
    append_float(bytes, sigma_of(point));
    append_float(bytes, static_cast<float>(point.segment));
  }
  return bytes;
}

ColmapModel colmap_model(const FlightResult& result, const ColmapPictures* pictures) {
  const Flight& flight = *result.flight;
  ColmapModel model;
  model.cameras = colmap_cameras(pictures != nullptr ? pictures->camera : flight.camera());
  struct Sighting {
    int32_t image, idx;
  };
  std::map<int32_t, std::vector<Sighting>> tracks;      // by the index of the point
  std::map<int32_t, std::pair<double, int>> residuals;  // their sum and number, by the same
  int num_images = 0;
  std::string images;
  for (const FlightKeyframe& key : result.keyframes) {
    const tv_keyframe& k = key.keyframe;
    if (k.segment != result.segment) continue;
    if (pictures != nullptr && pictures->names.count(k.id) == 0) continue;
    ++num_images;
    const Pose pose = inverse(pose_of(k));
    const std::array<double, 4> q = quaternion_of(pose.R);
    images += std::to_string(k.id + 1);
    for (const double value : {q[3], q[0], q[1], q[2], pose.t[0], pose.t[1], pose.t[2]})
      images += number_text(value);
    images += " 1 " +
              (pictures != nullptr ? pictures->names.at(k.id) : flight.given(k.frame).name) + "\n";
    int32_t idx = 0;
    for (const tv_map_observation& seen : key.observations) {
      if (seen.idx_point < 0) continue;
      std::array<double, 2> place = {static_cast<double>(seen.x), static_cast<double>(seen.y)};
      if (pictures != nullptr && !moved(flight.camera(), pictures->camera, place)) continue;
      const tv_map_point& point = result.points[static_cast<size_t>(seen.idx_point)];
      images += number_text(place[0] + 0.5).substr(idx == 0 ? 1 : 0) + number_text(place[1] + 0.5) +
                " " + std::to_string(point.id + 1);
      tracks[seen.idx_point].push_back({k.id + 1, idx++});
      Vector3 x = applied(pose.R, {point.position[0], point.position[1], point.position[2]});
      for (size_t axis = 0; axis < 3; ++axis) x[axis] += pose.t[axis];
      double pixel[2];
      if (tv_camera_project(&flight.camera(), x.data(), pixel, nullptr) != TV_OK) continue;
      auto& [sum, count] = residuals[seen.idx_point];
      sum += std::hypot(pixel[0] - static_cast<double>(seen.x),
                        pixel[1] - static_cast<double>(seen.y));
      ++count;
    }
    images += "\n";
  }
  model.images =
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
      "#   POINTS2D[] as (X, Y, POINT3D_ID)\n# Number of images: " +
      std::to_string(num_images) + "\n" + images;
  std::string points;
  for (const auto& [idx, track] : tracks) {
    const tv_map_point& point = result.points[static_cast<size_t>(idx)];
    points += std::to_string(point.id + 1);
    for (const double value : point.position) points += number_text(value);
    for (const int value : result.colours[static_cast<size_t>(idx)])
      points += " " + std::to_string(value);
    const auto& [sum, count] = residuals[idx];
    points += number_text(count > 0 ? sum / count : -1.0);
    for (const Sighting& sighting : track)
      points += " " + std::to_string(sighting.image) + " " + std::to_string(sighting.idx);
    points += "\n";
  }
  model.points =
      "# 3D point list with one line of data per point:\n"
      "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
      "# Number of points: " +
      std::to_string(tracks.size()) + "\n" + points;
  return model;
}

}  // namespace cli
