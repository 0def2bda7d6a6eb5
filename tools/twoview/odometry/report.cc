#include "odometry/report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "odometry/assets.h"
#include "odometry/camera_check.h"
#include "odometry/film_lens.h"
#include "odometry/view.h"
#include "pair/result.h"
#include "report/assets.h"
#include "report/html.h"
#include "report/ply.h"

namespace cli {
namespace {

using Json = nlohmann::ordered_json;
constexpr size_t kMaxCloudPoints = 12000;  // more are slow to draw
constexpr size_t kMaxPictures = 60;
constexpr int kTrackLength = 8;  // keyframes of a track, the newest included

double rounded(double value, double unit) { return std::round(value / unit) * unit; }

// The number to six digits, for the page's data.
double six_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return std::atof(text);
}

// The map as the page shows it: x right, y down, z ahead.
class View {
 public:
  explicit View(const FlightResult& result)
      : view_(view_of(*result.flight, result.keyframes, result.segment)) {}
  Vector3 operator()(const Vector3& v) const { return applied(view_.view_from_world, v); }
  Json axes() const {
    return view_.is_measured ? Json{"y", "z", "x"} : Json{"right", "down", "ahead"};
  }
  Json numbers(const Vector3& v) const {
    const Vector3 seen = (*this)(v);
    return {six_digits(seen[0]), six_digits(seen[1]), six_digits(seen[2])};
  }
  bool is_measured() const { return view_.is_measured; }

 private:
  MapView view_;
};

void append(Json& list, const Json& numbers) {
  for (const Json& number : numbers) list.push_back(number);
}

// The path, broken where frames of the segment have no pose.
Json paths_json(const FlightResult& result, const View& view) {
  Json paths = Json::array();
  Json points = Json::array();
  const auto end = [&] {
    if (points.size() > 3) paths.push_back({{"points", points}, {"colour", "#ffd75e"}});
    points = Json::array();
  };
  for (const FlightFrame& frame : result.flight->frames()) {
    if (frame.origin != PoseOrigin::kNone && frame.segment == result.segment) {
      append(points, view.numbers(frame.pose.t));
    } else {
      end();
    }
  }
  end();
  const Accuracy& a = result.accuracy;
  if (!a.has_errors()) return paths;
  // The truth in the map's frame: the inverse of the similarity.
  for (const Association& pair : a.pairs) {
    Vector3 d = result.truth[pair.idx_truth].pose.t;
    for (size_t k = 0; k < 3; ++k) d[k] = (d[k] - a.similarity.t[k]) / a.similarity.scale;
    append(points, view.numbers(applied(transposed(a.similarity.R), d)));
  }
  paths.push_back({{"points", points}, {"colour", "#58d68d"}});
  return paths;
}

// The length of the path's box along its largest side.
double extent_of(const FlightResult& result) {
  double extent = 0;
  const Trajectory path = trajectory_of(*result.flight, result.segment);
  for (size_t axis = 0; axis < 3; ++axis) {
    double low = INFINITY, high = -INFINITY;
    for (const TimedPose& at : path) {
      low = std::min(low, at.pose.t[axis]);
      high = std::max(high, at.pose.t[axis]);
    }
    extent = std::max(extent, high - low);
  }
  return std::isfinite(extent) ? extent : 0;
}

Json cameras_json(const FlightResult& result, const View& view) {
  const tv_camera& camera = result.flight->camera();
  const double size = 0.035 * extent_of(result);
  Json cameras = Json::array();
  for (const FlightKeyframe& key : result.keyframes) {
    if (key.keyframe.segment != result.segment) continue;
    const Pose pose = pose_of(key.keyframe);
    Json corners = Json::array();
    for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      const Vector3 corner = {size * (x * camera.width - camera.cx) / camera.fx,
                              size * (y * camera.height - camera.cy) / camera.fy, size};
      Vector3 at = applied(pose.R, corner);
      for (size_t k = 0; k < 3; ++k) at[k] += pose.t[k];
      corners.push_back(view.numbers(at));
    }
    cameras.push_back({{"id", key.keyframe.id},
                       {"centre", view.numbers(pose.t)},
                       {"corners", corners},
                       {"colour", "#8fa3b8"}});
  }
  return cameras;
}

Json cloud_json(const FlightResult& result) {
  const View view(result);
  std::vector<size_t> chosen;
  for (const size_t k : cloud_points(result.points, result.keyframes))
    if (result.points[k].segment == result.segment) chosen.push_back(k);
  std::string points, colours;
  const size_t step = chosen.size() / kMaxCloudPoints + 1;
  for (size_t i = 0; i < chosen.size(); i += step) {
    const tv_map_point& point = result.points[chosen[i]];
    const Vector3 at = view({point.position[0], point.position[1], point.position[2]});
    for (const double value : at) append_float(points, static_cast<float>(value));
    for (const uint8_t value : result.colours[chosen[i]]) colours += static_cast<char>(value);
  }
  return {{"points", base64(points)},
          {"colours", base64(colours)},
          {"cameras", cameras_json(result, view)},
          {"paths", paths_json(result, view)},
          {"axes", view.axes()}};
}

Json frames_json(const FlightResult& result) {
  Json time, status, inliers, ms, reasons, key = Json::array(), error;
  const std::vector<FlightFrame>& frames = result.flight->frames();
  for (size_t i = 0; i < frames.size(); ++i) {
    const FlightFrame& frame = frames[i];
    time.push_back(rounded(frame.time_s - frames[0].time_s, 1e-3));
    status.push_back(frame.status);
    inliers.push_back(frame.num_inliers);
    ms.push_back(frame.unreadable || frame.withheld ? Json(nullptr)
                                                    : Json(rounded(frame.time_ms, 1e-3)));
    reasons.push_back(reasons_text(frame));
    if (frame.is_keyframe) key.push_back(i);
    error.push_back(nullptr);
  }
  Json json = {{"time", time}, {"status", status},   {"inliers", inliers},
               {"ms", ms},     {"reasons", reasons}, {"key", key}};
  if (!result.accuracy.has_errors()) return json;
  std::map<double, size_t> index;
  for (size_t i = 0; i < frames.size(); ++i) index[frames[i].time_s] = i;
  const Trajectory path = trajectory_of(*result.flight, result.segment);
  for (size_t i = 0; i < result.accuracy.pairs.size(); ++i)
    error[index[path[result.accuracy.pairs[i].idx_estimate].time_s]] =
        six_digits(result.accuracy.errors[i]);
  json["error"] = error;
  return json;
}

// For each point that keyframe `k` sees, its pixels in it and in the keyframes before it, newest
// first, in pixels of the small picture.
Json tracks_json(const FlightResult& result,
                 const std::vector<std::map<int32_t, const tv_map_observation*>>& seen, size_t k,
                 double scale) {
  Json tracks = Json::array();
  for (const auto& [point, observation] : seen[k]) {
    Json track = Json::array();
    for (size_t back = 0; back < kTrackLength && back <= k; ++back) {
      const auto found = seen[k - back].find(point);
      if (found == seen[k - back].end()) break;
      if (result.keyframes[k - back].keyframe.segment != result.keyframes[k].keyframe.segment)
        break;
      track.push_back(rounded(scale * static_cast<double>(found->second->x), 0.25));
      track.push_back(rounded(scale * static_cast<double>(found->second->y), 0.25));
    }
    tracks.push_back(track);
  }
  return tracks;
}

Json keyframes_json(const FlightResult& result) {
  const Flight& flight = *result.flight;
  std::vector<std::map<int32_t, const tv_map_observation*>> seen(result.keyframes.size());
  for (size_t k = 0; k < seen.size(); ++k)
    for (const tv_map_observation& observation : result.keyframes[k].observations)
      if (observation.idx_point >= 0) seen[k][observation.idx_point] = &observation;
  Json keyframes = Json::array();
  const size_t step = seen.size() / kMaxPictures + 1;
  for (size_t k = 0; k < seen.size(); k += step) {
    const tv_keyframe& key = result.keyframes[k].keyframe;
    const Thumbnail* picture = flight.thumbnail(key.frame);
    if (picture == nullptr) continue;
    const FlightFrame& frame = flight.given(key.frame);
    const double scale = static_cast<double>(picture->width) / flight.camera().width;
    keyframes.push_back({{"id", key.id},
                         {"frame", flight.index_given(key.frame)},
                         {"name", frame.name},
                         {"time", rounded(frame.time_s - flight.frames()[0].time_s, 1e-3)},
                         {"width", picture->width},
                         {"height", picture->height},
                         {"image", base64(picture->jpeg)},
                         {"tracks", tracks_json(result, seen, k, scale)}});
  }
  return keyframes;
}

std::string number_card(const Json& value, const char* format, const std::string& unit,
                        const std::string& what) {
  return value.is_number() ? card(formatted(format, value.get<double>()), unit, what) : "";
}

std::string cards(const FlightResult& result) {
  const Json& j = result.json;
  const bool is_metric = j["scale"] == "metric";
  std::string text = card(std::to_string(j["num_tracked"].get<int>()),
                          "of " + std::to_string(j["num_frames"].get<int>()), "frames with a pose");
  text += card(std::to_string(j["num_keyframes"].get<int>()), "", "keyframes");
  text += card(std::to_string(j["num_points"].get<int>()), "", "points in the map");
  const int segments = j["num_segments"].get<int>();
  text += card(std::to_string(segments), "", segments == 1 ? "segment" : "segments");
  text += card(std::to_string(j["num_relocalisations"].get<int>()), "", "times found again");
  text += card(std::to_string(j["num_loops"].get<int>()), "", "loops closed");
  text += number_card(j["path_length"], "%.4g", is_metric ? "m" : "",
                      is_metric ? "length of the path" : "length of the path, in first baselines");
  if (const Json& shift = j["principal_point_shift_px"]; shift.is_array()) {
    const double x = shift[0].get<double>(), y = shift[1].get<double>();
    text += card(formatted("%.1f", std::hypot(x, y)), "px",
                 "by which the principal point was moved: " + formatted("%.1f", x) + ", " +
                     formatted("%.1f", y));
  }
  if (const Json& focal = j["focal_length"]; focal.is_object())
    text += card(formatted("%.1f", focal["focal_35mm"].get<double>()), "mm",
                 "focal length (35 mm equivalent), estimated from the film to " +
                     formatted("%.1f", focal["sigma_percent"].get<double>()) + " %");
  if (is_metric)
    text += number_card(j["scale_sigma"], "%.2g", "", "1 sigma of the scale, relative");
  text += number_card(j["time_ms"]["mean"], "%.2f", "ms", "CPU time a frame, mean");
  text += number_card(j["time_ms"]["max"], "%.2f", "ms", "CPU time a frame, largest");
  const Json& truth = j["truth"];
  if (!truth.is_object()) return text;
  text += number_card(truth["ate_rmse"], "%.4g", "", "position error, rms after a similarity");
  text += number_card(truth["ate_rmse_percent_of_path"], "%.2f", "%", "of the true path");
  if (truth["coverage"].is_number())
    text += card(formatted("%.1f", 100 * truth["coverage"].get<double>()), "%",
                 "of the frames in the longest segment");
  text += number_card(truth["rpe_rotation_deg"], "%.3f", "deg", "rotation error a frame, rms");
  return text;
}

std::string cloud_section(const FlightResult& result) {
  if (result.points.empty()) return "";
  const bool is_metric = result.json["scale"] == "metric";
  const std::string truth =
      result.accuracy.has_errors() ? ", the truth green, brought to the map by a similarity" : "";
  const std::string others = result.json["num_segments"].get<int>() > 1
                                 ? " Only the longest segment is shown: segments do not compare."
                                 : "";
  const std::string up = View(result).is_measured()
                             ? " Up is up by the measured attitudes."
                             : " Up is estimated from how the camera was held, for this page "
                               "alone: the files have the "
                               "map's own axes, those of its first keyframe.";
  return "<section>\n<h2>Path and map</h2>\n<div class=\"stage\"><canvas id=\"cloud\"></canvas>\n"
         "<div class=\"buttons\"><button id=\"view-front\">front</button>"
         "<button id=\"view-side\">side</button><button id=\"view-top\">top</button></div></div>\n"
         "<p class=\"hint screen\">Drag to turn, wheel or pinch to zoom, shift and drag to move, "
         "double "
         "click to start again. The path is yellow" +
         truth + "; the keyframe that is shown below is orange. Lengths are in " +
         (is_metric ? "metres" : "distances of the first two keyframes") + "." + others + up +
         "</p>\n</section>\n";
}

std::string keyframes_section(const Json& keyframes) {
  if (keyframes.empty()) return "";
  return "<section class=\"viewer\">\n<h2>Keyframes</h2>\n<canvas id=\"keyframe\"></canvas>\n"
         "<div class=\"controls\"><button id=\"keyframe-back\">&larr;</button>"
         "<input type=\"range\" id=\"keyframe-slider\" min=\"0\" step=\"1\" "
         "aria-label=\"keyframe\"><button id=\"keyframe-on\">&rarr;</button></div>\n"
         "<p class=\"hint\" id=\"keyframe-words\"></p>\n"
         "<p class=\"hint\">Each point of the map that the keyframe sees, with its way through the "
         "keyframes before: blue was seen first here, red in eight of them.</p>\n</section>\n";
}

struct Headline {
  const char *style, *word;
  std::string words;
};

Headline headline(const FlightResult& result) {
  const Json& j = result.json;
  const int frames = j["num_frames"].get<int>(), posed = j["num_tracked"].get<int>();
  const int lost = j["status_counts"]["lost"].get<int>();
  const int segments = j["num_segments"].get<int>();
  const std::string share =
      std::to_string(posed) + " of " + std::to_string(frames) + " frames have a pose";
  if (posed == 0) return {"poor", "no map", "No two frames of this source determine a map."};
  if (!result.flight->ended_tracked())
    return {"poor", "ended lost", share + "; the last frame has none."};
  if (const Json& focal = j["focal_length"]; focal.is_object() && focal["uncertain"].get<bool>())
    return {"poor", "doubtful",
            std::string("The focal length is doubtful, and so is the shape of the path: ") +
                kDoubtfulFocalAdvice + ". " + share + "."};
  if (const Json& check = j["camera_check"]; check.is_object() && check["contradicted"].get<bool>())
    return {
        "poor", "doubtful",
        std::string("The pictures contradict the camera, and the shape of the path is wrong with "
                    "it: ") +
            kContradictedCameraAdvice + ". " + share + "."};
  if (segments > 1)
    return {"fair", "in pieces", share + ", in " + std::to_string(segments) + " segments."};
  if (lost > 0)
    return {"fair", "with losses", share + "; " + std::to_string(lost) + " frames were lost."};
  return {"good", "tracked", share + ", in one segment."};
}

// The data as a script element; "</" is written so that it does not end the element.
std::string data_element(const char* id, const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string safe;
  for (size_t i = 0; i < text.size(); ++i) {
    safe += text[i];
    if (text[i] == '<' && i + 1 < text.size() && text[i + 1] == '/') safe += '\\';
  }
  return std::string("<script type=\"application/json\" id=\"") + id + "\">" + safe + "</script>\n";
}

}  // namespace

std::string flight_report(const FlightResult& result, const std::string& name,
                          const std::string& room_html, const std::string& room_script) {
  Json data;
  for (int32_t s = 0; s < TV_ODOMETRY_NUM_STATUSES; ++s)
    data["statuses"].push_back(tv_odometry_status_string(static_cast<tv_odometry_status>(s)));
  data["frames"] = frames_json(result);
  data["keyframes"] = keyframes_json(result);
  data["truth_unit"] = "units of the truth";
  std::string script;
  if (!result.points.empty())
    script += data_element("cloud-data", cloud_json(result)) + "<script>\n" + kReportScript +
              "</script>\n";
  script += room_script + data_element("flight-data", data) + "<script>\n" + kFlightScript +
            "</script>\n";
  const Headline head = headline(result);
  return filled(kFlightPage, {{"title", escaped(name) + ": twoview odometry"},
                              {"style", std::string(kReportStyle) + kFlightStyle},
                              {"heading", escaped(name)},
                              {"verdict_class", head.style},
                              {"verdict", head.word},
                              {"verdict_words", escaped(head.words)},
                              {"notes", bullets("notes", result.json["notes"])},
                              {"cards", cards(result)},
                              {"cloud", cloud_section(result)},
                              {"room", room_html},
                              {"keyframes", keyframes_section(data["keyframes"])},
                              {"json", escaped(json_text(result.json))},
                              {"version", tv_version_string()},
                              {"script", script},
                              {"print", kPrintScript}});
}

}  // namespace cli
