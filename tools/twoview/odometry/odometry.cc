// twoview odometry SOURCE -o OUT: the frames of one camera to its path and a map.

#include "odometry/odometry_verb.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "base/median.h"
#include "base/output.h"
#include "base/terminal.h"
#include "files/camera_file.h"
#include "files/camera_formats.h"
#include "files/image_file.h"
#include "odometry/camera_check.h"
#include "odometry/colmap_folder.h"
#include "odometry/film_lens.h"
#include "odometry/flight.h"
#include "odometry/live.h"
#include "odometry/outputs.h"
#include "odometry/path_order.h"
#include "odometry/report.h"
#include "odometry/stored_source.h"
#include "pair/options.h"
#include "pair/result.h"
#include "pair/session.h"
#include "verbs/common.h"
#ifdef TWOVIEW_HAS_ROOM
#include "odometry/kept_pictures.h"
#include "odometry/room_options.h"
#include "room_model/page.h"
#include "room_model/preview.h"
#include "room_model/room_files.h"
#endif
#ifdef TWOVIEW_HAS_DRONE
#include "odometry/drone_frames.h"
#endif
#ifdef TWOVIEW_HAS_CAMERA_SOURCE
#include "sources/camera_source.h"
#endif

namespace cli {
namespace {

namespace fs = std::filesystem;

const char* const kCameraFile = "corrected_camera.yaml";
const char* const kStillFile = "still_mask.png";
const char* const kEstimatedFile = "estimated_camera.yaml";
const std::vector<std::string> kFiles = {"trajectory.txt", "live.txt",        "keyframes.txt",
                                         kCameraFile,      "covariances.txt", kStillFile,
                                         "frames.csv",     "cloud.ply",       "map.twm",
                                         "report.html",    "result.json",     kEstimatedFile};
// The names of all files that the verb writes, with those of the room.
std::vector<std::string> own_files() {
  std::vector<std::string> names = kFiles;
#ifdef TWOVIEW_HAS_ROOM
  names.insert(names.end(), kRoomFiles.begin(), kRoomFiles.end());
#endif
  return names;
}
const std::vector<std::string> kAlwaysFiles = {"frames.csv", "live.txt", "result.json"};

struct Arguments {
  Common common;
  std::string source, camera, truth;
  double fps = 0, duration = 0;
  bool ignores_imu = false;
  bool keeps_camera = false;
  bool leaves_pictures = false;
  bool is_live = false;
  bool has_resize = false;  // --resize is given, if only as 0
  int32_t live_port = 0;
  FlightOptions flight;
#ifdef TWOVIEW_HAS_ROOM
  bool makes_room = false;
  RoomSettings room;
  RoomTruthOptions room_truth;
#endif
#ifdef TWOVIEW_HAS_DRONE
  DroneAddress drone;  // without a host: none
  VehicleAddress vehicle;
#endif
};

bool is_number(const std::string& text) {
  return !text.empty() && text.size() < 4 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_auto(const Arguments& a) { return a.flight.focal_35mm == kAutoFocal; }

// Throws BadInput where no camera is given and the source has none, because of `why`.
void require_camera(const Arguments& a, const char* why) {
  if (a.camera.empty() && a.flight.focal_35mm == 0)
    throw BadInput(std::string("--camera is required, or --focal-35mm: ") + why);
}

// For a source that can be read once only: its focal length cannot be estimated beforehand.
void require_camera_of_live(const Arguments& a, const char* why) {
  require_camera(a, why);
  if (is_auto(a))
    throw BadInput(
        "--focal-35mm auto reads its source several times, which a live one does not allow: record "
        "a film first, and give the estimated_camera.yaml of its odometry as --camera");
}

std::unique_ptr<FrameSource> open_source(const Arguments& a) {
#ifdef TWOVIEW_HAS_DRONE
  if (!a.drone.host.empty()) {
    if (!a.source.empty()) throw BadInput("give SOURCE or --drone, not both");
    require_camera_of_live(a, "the drone does not describe its camera");
    return open_drone(a.drone, a.duration, a.camera);
  }
  if (a.vehicle.given()) {
    if (!a.source.empty()) throw BadInput("give SOURCE or --mavlink, not both");
    require_camera_of_live(a, "MAVLink does not describe the camera");
    if ((a.vehicle.estimates.weak || a.vehicle.estimates.north) && !a.vehicle.estimates.given())
      throw BadInput("--send-weak and --send-north need --send-odometry or --send-vision-position");
    return open_vehicle(a.vehicle, a.duration, a.camera, a.common.quiet);
  }
#endif
  if (a.source.empty()) throw BadInput("SOURCE is required (see twoview odometry --help)");
#ifdef TWOVIEW_HAS_CAMERA_SOURCE
  if (CameraSource::kind_of(a.source) == CameraSource::Kind::kLive && !is_number(a.source)) {
    require_camera_of_live(a, "a camera does not describe its lens");
    if (a.fps > 0) throw BadInput("--fps: the frames of a camera have times");
    return open_camera(a.source);
  }
#endif
#ifdef TWOVIEW_HAS_DRONE
  if (is_recording_folder(a.source) && !(a.fps > 0))
    require_camera(a, "a recording of a drone does not describe its camera");
#endif
  if (auto source = open_stored_source(a.source, a.fps, !a.ignores_imu, a.camera)) return source;
  if (is_number(a.source)) {
    require_camera_of_live(a, "a camera does not describe its lens");
    if (a.fps > 0) throw BadInput("--fps: the frames of a camera have times");
    return open_camera(std::stoi(a.source));
  }
  throw BadInput("cannot read " + a.source + ": it is neither a folder, a film nor a camera");
}

// COLMAP ends a name of images.txt at its first blank (pycolmap 4.2.1, 2026-11-29).
void note_blanks(const FlightResult& result, Common& common) {
  for (const FlightKeyframe& key : result.keyframes) {
    const std::string& name = result.flight->given(key.keyframe.frame).name;
    if (name.find_first_of(" \t") == std::string::npos) continue;
    common.note("'" + name +
                "' has a blank, at which COLMAP ends a name of colmap/images.txt: rename the "
                "pictures, or take colmap/sparse/, whose names have none");
    return;
  }
}

// The words of the progress line while the flight lasts.
class FlightProgress {
 public:
  FlightProgress(const Flight& flight, int num_frames, bool wanted)
      : flight_(flight), num_frames_(num_frames), line_(wanted), start_ns_(now_ns()) {}

  void show() {
    const double now = static_cast<double>(now_ns() - start_ns_) * 1e-9;
    if (now < next_) return;
    next_ = now + 0.2;
    const size_t count = flight_.frames().size();
    const tv_odometry_state& state = flight_.state();
    char line[200], of[32] = "";
    if (num_frames_ >= 0) std::snprintf(of, sizeof of, " of %d", num_frames_);
    std::snprintf(line, sizeof line,
                  "%zu%s frames, %.1f frames a second, %s, %d keyframes, %d points", count, of,
                  now > 0 ? static_cast<double>(count) / now : 0.0,
                  tv_odometry_status_string(static_cast<tv_odometry_status>(state.status)),
                  state.num_keyframes, state.num_points);
    line_.tell(line);
  }

 private:
  const Flight& flight_;
  int num_frames_;
  Progress line_;
  uint64_t start_ns_;
  double next_ = 0;
};

// How many of the source's frames the run is to track; -1 where it is not known.
int num_wanted(const FrameSource& source, const FlightOptions& options) {
  const int all = source.num_frames();
  if (all < 0) return options.max_frames > 0 ? options.max_frames : -1;
  const int some = (all + options.every - 1) / options.every;
  return options.max_frames > 0 ? std::min(some, options.max_frames) : some;
}

// Notes that large frames are tracked at full size, although `reconstruct` would make them smaller.
void advise_on_size(Arguments& a, const tv_camera& camera) {
  if (a.has_resize || std::max(camera.width, camera.height) <= kLargeSide) return;
  a.common.note("frames above " + std::to_string(kLargeSide) +
                " pixels a side are used as they are: " + std::to_string(camera.width) + "x" +
                std::to_string(camera.height) + "; --resize " + std::to_string(kUsualSide) +
                " is advised");
}

nlohmann::ordered_json options_of(const Arguments& a, const std::string& truth_file) {
  const tv_odometry_options& o = a.flight.odometry;
  const auto text_or_null = [](const std::string& text) {
    return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
  };
  nlohmann::ordered_json json = {{"max_keypoints", o.max_keypoints},
                                 {"max_keyframes", o.max_keyframes},
                                 {"max_points", o.max_points},
                                 {"window", o.window},
                                 {"keep_camera", o.refine == TV_REFINE_NOTHING},
                                 {"max_frames", a.flight.max_frames},
                                 {"every", a.flight.every},
                                 {"fps", a.fps}};
  json["resize"] = a.flight.resize;
  json["no_pictures"] = a.leaves_pictures;
  json["mask"] = mask_json(a.flight.masks);
  json["no_imu"] = a.ignores_imu;
  json["kernels"] = tv_kernels_string(static_cast<tv_kernels>(o.kernels));
  json["camera"] = text_or_null(a.camera);
  json["focal_35mm"] = nullptr;
  if (is_auto(a)) json["focal_35mm"] = "auto";
  if (a.flight.focal_35mm > 0) json["focal_35mm"] = a.flight.focal_35mm;
  json["truth"] = text_or_null(truth_file);
#ifdef TWOVIEW_HAS_ROOM
  json["room"] = nullptr;
  if (a.makes_room) json["room"] = room_options_json(a.room, a.room_truth);
#endif
  return json;
}

nlohmann::ordered_json film_json(const std::optional<FilmFacts>& film) {
  if (!film) return nullptr;
  return {{"times", times_name(film->times)},
          {"rate_hz", film->rate_hz},
          {"variable_rate", film->is_variable},
          {"clock_start_s", film->clock_start_s},
          {"num_left_out", film->num_left_out},
          {"num_other_size", film->num_other_size},
          {"num_begun_anew", film->num_begun_anew},
          {"size", {film->width, film->height}},
          {"rotation_deg", film->turn_deg},
          {"mirrored", film->is_mirrored},
          {"pixel_aspect", film->pixel_aspect},
          {"interlaced", film->is_interlaced},
          {"joined", film->is_joined},
          {"num_damaged", film->num_damaged},
          {"num_decoder_errors", film->num_decoder_errors}};
}

// The camera that was estimated, as a file for the next flight. One that is doubtful is not
// written: as a file it would pass for a calibration.
std::string estimated_camera_text(const FilmLens& lens) {
  char text[64];
  const double sigma = std::max(lens.sigma, kPlainFile.focal);
  std::snprintf(text, sizeof text, "focal_sigma: %.3g\ncenter_sigma: %.3g\n", sigma, kFilm.center);
  return camera_yaml(lens.camera()) + text;
}

// The room of a flight as files, words and a part of the page; empty where none is made.
struct FlightRoom {
  std::string html, script, summary;  // parts of the page, and lines of the summary
#ifdef TWOVIEW_HAS_ROOM
  RoomScene scene;
  std::optional<RoomModel> model;
#endif
};

#ifdef TWOVIEW_HAS_ROOM
// What goes wrong with the room is noted, and the flight's results are written all the same. kept:
// the pictures of a live source, or null. live: the page that shows the room, or null.
FlightRoom room_of(Arguments& a, FrameSource& source, KeptPictures* kept, FlightResult& result,
                   const TrueRoom& true_room, const std::atomic<bool>& stop, LivePage* live) {
  FlightRoom room;
  result.json["room"] = nullptr;
  if (!a.makes_room) return room;
  // Ctrl-C in flight ends the flight, and the room is of what was flown; another one ends this.
  clear_stop_flag();
  room.scene = room_scene(result);
  if (room.scene.views.empty()) {
    a.common.note("no room: no frame has a pose");
    return room;
  }
  if (kept != nullptr)
    for (RoomView& view : room.scene.views) view.has_picture = kept->has(view.index);
  try {
    RoomBuilder builder(room.scene, a.room);
    const Flight& flight = *result.flight;
    read_pictures_with_progress(kept != nullptr ? *kept : source, flight.masks(),
                                flight.still_mask(), builder, stop, !a.common.quiet,
                                [live](const std::string& words) {
                                  if (live != nullptr) live->tell(words);
                                });
    if (live != nullptr) live->tell("room: the surface");
    room.model = finish_with_progress(builder, !a.common.quiet);
    if (live != nullptr) {
      const RoomMesh& mesh = room.model->page_mesh;
      live->show(surface_bytes(mesh.vertices, mesh.triangles),
                 static_cast<size_t>(room.model->keyframes_used));
      live->tell("writing the files");
    }
    room.scene = builder.scene();
  } catch (const BadInput& e) {
    a.common.note(std::string("no room: ") + e.what());
    return room;
  }
  if (true_room.is_given()) {
    const auto surface = [&] {
      return true_room.surface(room.scene, {false, result.truth, result.truth_note, {}});
    };
    add_truth(surface, room.scene, *room.model, !a.common.quiet, a.common);
  }
  for (const std::string& note : room_notes(*room.model, stop)) a.common.note(note);
  if (const int count = result.json["num_segments"].get<int>(); count > 1)
    a.common.note("the room is of the longest of " + std::to_string(count) +
                  " segments, whose units and places do not compare");
  result.json["room"] = room_json(room.scene, *room.model);
  const RoomSection section = room_section(room.scene, *room.model);
  room.html = section.html;
  room.script = section.script;
  room.summary = room_summary(room.scene, *room.model);
  return room;
}
#endif

void make_files(const FlightResult& result, const std::optional<FilmLens>& lens,
                const std::string& name, const FlightRoom& room, OutputSet& files) {
  const Flight& flight = *result.flight;
  if (lens && !lens->is_uncertain && !files.is_input(kEstimatedFile))
    files.add(kEstimatedFile, estimated_camera_text(*lens));
  files.add("result.json", json_text(result.json));
  files.add("frames.csv", frames_csv(flight));
  files.add("trajectory.txt", trajectory_text(flight, false));
  files.add("live.txt", trajectory_text(flight, true));
  files.add("report.html", flight_report(result, name, room.html, room.script));
#ifdef TWOVIEW_HAS_ROOM
  if (room.model) add_room_files(room.scene, *room.model, files);
#endif
  if (flight.has_corrected_camera() && !files.is_input(kCameraFile))
    files.add(kCameraFile, camera_yaml(flight.corrected_file_camera()));
  if (!flight.still_mask().empty() && !files.is_input(kStillFile))
    files.add(kStillFile, png_bytes(flight.still_mask()));
  if (result.keyframes.empty()) return;
  files.add("keyframes.txt", keyframes_text(result));
  const std::string covariances = covariances_text(result.keyframes);
  if (!covariances.empty()) files.add("covariances.txt", covariances);
  files.add("cloud.ply", map_ply(result.points, result.colours, result.keyframes));
  files.add("map.twm", flight.map_bytes());
}

std::string truth_line(const nlohmann::ordered_json& truth) {
  if (!truth["ate_rmse"].is_number())
    return summary_line("truth", "%s",
                        truth["num_compared"].get<int>() < 3
                            ? "fewer than three of its poses have a time of the path"
                            : "the true path has no length, so there is nothing to compare with");
  std::string text = summary_line(
      "truth", "position off by %.4g (rms after the best similarity), %.2f %% of the path of %.4g",
      truth["ate_rmse"].get<double>(), truth["ate_rmse_percent_of_path"].get<double>(),
      truth["path_length"].get<double>());
  return text + summary_line("coverage", "%.1f %% of the frames, in the longest segment",
                             100 * truth["coverage"].get<double>());
}

// Where most of what stands still lies, such as " at the lower edge"; empty where it lies all over.
std::string place_of(const cv::Mat& mask) {
  const int rows = mask.rows / 4, columns = mask.cols / 4;
  const auto left_out = [](const cv::Mat& part) {
    return static_cast<double>(part.total()) - cv::countNonZero(part);
  };
  const std::pair<const char*, cv::Mat> edges[] = {
      {"lower", mask.rowRange(mask.rows - rows, mask.rows)},
      {"upper", mask.rowRange(0, rows)},
      {"left", mask.colRange(0, columns)},
      {"right", mask.colRange(mask.cols - columns, mask.cols)}};
  const double all = left_out(mask);
  for (const auto& [name, part] : edges)
    if (left_out(part) > 0.8 * all) return std::string(" at the ") + name + " edge";
  return "";
}

std::string still_note(const FlightResult& result) {
  char share[32];
  std::snprintf(share, sizeof share, "%.1f", 100 * result.json["still_share"].get<double>());
  return std::string("parts of the picture stand still while the scene moves (") + share +
         " % of it" + place_of(result.flight->still_mask()) + "): left out, " + kStillFile +
         " shows where";
}

std::string summary(const FlightResult& result, const std::optional<FilmLens>& lens,
                    const CameraEvidence& on_camera, const FrameSource& source,
                    const OutputSet& files, const std::string& colmap, const std::string& notes,
                    const std::string& room) {
  const nlohmann::ordered_json& j = result.json;
  std::string text =
      summary_line("source", "%s, %d frames", source.kind().c_str(), j["num_frames"].get<int>());
  text += notes;
  if (lens) {
    text += summary_line("camera", "%s, estimated from the film", lens->words().c_str());
    if (lens->is_uncertain) {
      text +=
          summary_line("doubtful", "%s", "the focal length is doubtful: do not fly by this path");
      text += summary_line("advice", "%s", kDoubtfulFocalAdvice);
    }
  }
  if (j["two_eyes"].is_string())
    text += summary_line("doubtful", "%s", "the pictures are of two eyes: do not fly by this path");
  if (on_camera.contradicts()) {
    text += summary_line("doubtful", "%s: do not fly by this path",
                         contradiction_words(on_camera).c_str());
    text += summary_line("advice", "%s", kContradictedCameraAdvice);
  }
  std::string counts;
  for (const auto& [name, count] : j["status_counts"].items())
    if (count.get<int>() > 0)
      counts += (counts.empty() ? "" : ", ") + std::to_string(count.get<int>()) + " " + name;
  text += summary_line("tracking", "%s", counts.c_str());
  text += summary_line("path", "%d frames with a pose, %d of them found in the map afterwards",
                       j["num_tracked"].get<int>(), j["num_located"].get<int>());
  if (const double share = j["masked_share"].get<double>(); share > 0)
    text += summary_line("mask", "leaves %.1f %% of the picture out", 100 * share);
  if (const int ignored = j["num_attitudes_ignored"].get<int>(); ignored > 0)
    text += summary_line("attitude", "of %d frames contradicts the map and was left out", ignored);
  const int segments = j["num_segments"].get<int>();
  text += summary_line("map", "%d keyframes, %d points in %d segment%s; %d found again, %d loops",
                       j["num_keyframes"].get<int>(), j["num_points"].get<int>(), segments,
                       segments == 1 ? "" : "s", j["num_relocalisations"].get<int>(),
                       j["num_loops"].get<int>());
  if (const auto& shift = j["principal_point_shift_px"]; shift.is_array())
    text += summary_line("camera",
                         "many keyframes agree that its principal point is off: moved by "
                         "(%.1f, %.1f) px",
                         shift[0].get<double>(), shift[1].get<double>());
  const bool is_metric = j["scale"] == "metric";
  const double length = j["path_length"].get<double>();
  if (is_metric)
    text += summary_line("length", "%.3f m, scale to %.1f %%", length,
                         100 * j["scale_sigma"].get<double>());
  else
    text += summary_line("length", "%.3f times the distance of the first two keyframes", length);
  if (const auto& both = j["scale_contradiction"]; both.is_object()) {
    const auto& h = both["height"];
    const auto& v = both["velocity"];
    text += summary_line("metre",
                         "none: heights and velocities contradict each other: a unit of the map is "
                         "%.4g m (sigma %.2g) by heights, %.4g m (%.2g) by velocities",
                         h["scale"].get<double>(), h["sigma"].get<double>(),
                         v["scale"].get<double>(), v["sigma"].get<double>());
  }
  if (j["truth"].is_object()) text += truth_line(j["truth"]);
  if (j["time_ms"]["mean"].is_number())
    text += summary_line(
        "work", "%.2f ms a frame (mean), %.2f ms (max) with %s kernels in %.1f MiB",
        j["time_ms"]["mean"].get<double>(), j["time_ms"]["max"].get<double>(),
        j["kernels"].get<std::string>().c_str(), j["context_bytes"].get<double>() / (1 << 20));
  text += room;
  std::string names;
  for (const std::string& name : files.names()) names += " " + name;
  return text +
         summary_line("files", "%s:%s%s", files.folder().c_str(), names.c_str(), colmap.c_str());
}

std::string colmap_words(const ColmapFolder& colmap) {
  const std::string pictures = colmap.pictures_words();
  return " colmap/" + (pictures.empty() ? "" : " (" + pictures + ")");
}

// Throws BadInput where the source is the folder of pictures that this run would write.
void refuse_own_pictures(const std::string& source, const fs::path& folder) {
  std::error_code ignored;
  if (fs::equivalent(source, folder / "colmap" / "images", ignored))
    throw BadInput(source +
                   " is read by this run, which writes its pictures there; give another -o");
}

// The focal length that EXIF data give most pictures of a source, of which the first one's is
// given; notes say it. Throws BadInput where there is none.
double focal_by_exif(const FrameSource& source, double of_first, Common& common) {
  constexpr double kRounding_mm = 1;  // EXIF gives whole millimetres
  std::vector<double> focals = source.focals_35mm();
  if (focals.empty()) focals.push_back(of_first);
  const double usual = median_of(focals);
  double other = 0;
  const auto differs = [&](double focal) {
    if (std::abs(focal - usual) <= kRounding_mm) return false;
    other = focal;
    return true;
  };
  const auto num_others = static_cast<size_t>(std::count_if(focals.begin(), focals.end(), differs));
  char text[240];
  if (num_others > 0) {
    std::snprintf(text, sizeof text,
                  "%zu of %zu pictures have another focal length in EXIF data than %.4g mm, such "
                  "as %.4g mm",
                  num_others, focals.size(), usual, other);
    if (2 * num_others >= focals.size())
      throw BadInput(std::string(text) + ": give those of one camera and zoom, or --focal-35mm");
    common.note(text + std::string(", and are used as of the same: take out those of another "
                                   "camera or zoom"));
  }
  std::snprintf(text, sizeof text,
                "focal length %.4g mm (35 mm equivalent) from EXIF; --camera is better", usual);
  common.note(text);
  return usual;
}

// The lens of a film of which neither the command line nor the source says a camera; empty where
// one is known. Photographs' EXIF data say the focal length: it is put into the options.
std::optional<FilmLens> lens_of_film(Arguments& a, FrameSource& source,
                                     const std::atomic<bool>& stop, FlightOptions* options) {
  if (!is_auto(a)) {
    if (!a.camera.empty() || options->focal_35mm > 0 || !source.can_run_again()) return {};
    SourceFrame first;
    source.run([](int) { return true; },  // the first that can be read
               [&first](const SourceFrame& frame) {
                 first = frame;
                 return frame.luma.empty();
               },
               stop);
    if (first.luma.empty()) return {};  // which the flight refuses
    if (source.camera(first, first.luma.cols, first.luma.rows)) return {};
    if (first.exif.focal_35mm > 0) {
      options->focal_35mm = focal_by_exif(source, first.exif.focal_35mm, a.common);
      return {};
    }
  }
  options->focal_35mm = 0;
  a.common.note(
      "no camera is given: the focal length is estimated from the film, which takes up to four "
      "times as long");
  const Progress line(!a.common.quiet);
  const FilmLens lens = estimate_film_lens(source, *options, stop,
                                           [&line](const std::string& words) { line.tell(words); });
  options->camera = lens.camera();
  return lens;
}

int exit_status(const Flight& flight, const FlightResult& result) {
  if (result.live_stretch.segment < 0) {
    std::fprintf(stderr, "twoview: nothing could be tracked: no two frames determine a map\n");
    return kExitNoPose;
  }
  if (flight.ended_tracked()) return kExitPose;
  std::fprintf(stderr, "twoview: the source ended lost: its last frame has no pose\n");
  return kExitNoPose;
}

int odometry(Arguments& a) {
  Common& common = a.common;
  common.options.kernels = a.flight.odometry.kernels;
  a.flight.camera_file = a.camera;
  a.flight.odometry.refine = a.keeps_camera ? TV_REFINE_NOTHING : TV_REFINE_PRINCIPAL_POINT;
  if (a.flight.focal_35mm != 0 && !a.camera.empty())
    throw BadInput("--focal-35mm is for films and photographs without a camera file");
  if (a.flight.scales_camera && a.camera.empty())
    throw BadInput(
        "--scale-camera is for --camera: for a camera that the source has itself, give its file "
        "there, such as the folder's cameras.yaml");
  const std::unique_ptr<FrameSource> source = open_source(a);
  const std::string truth_file = a.truth.empty() ? source->truth_file() : a.truth;
#ifdef TWOVIEW_HAS_ROOM
  const TrueRoom true_room(a.room_truth);
  if (!a.room_truth.mesh.empty() && truth_file.empty()) throw BadInput(kMeshNeedsPath);
#endif
  std::optional<TruePoses> truth;
  if (!truth_file.empty())
    truth = load_trajectory(truth_file, source->times(), source->body_from_camera());
  Session session(common.options);  // says which kernels are used
  session.context(64, 64);
  const std::atomic<bool>& stop = stop_flag_for_signals();
  OutputSet files(common.output);
  for (const std::string& name : source->files()) files.keep(name);
  files.keep(camera_path(a.camera));
  files.keep(truth_file);
#ifdef TWOVIEW_HAS_ROOM
  for (const std::string& name : true_room.files()) files.keep(name);
#endif
  std::vector<std::string> names = own_files();
  for (const std::string& name : ColmapFolder::file_names()) names.push_back("colmap/" + name);
  files.require_own({"odometry", names, kAlwaysFiles, {}});
  refuse_own_pictures(a.source, files.folder());
  const int wanted = num_wanted(*source, a.flight);
  FlightOptions options = a.flight;
  const std::optional<FilmLens> lens = lens_of_film(a, *source, stop, &options);
  Flight flight(*source, options);
#ifdef TWOVIEW_HAS_ROOM
  std::optional<KeptPictures> kept;
  if (a.makes_room && !source->can_run_again()) kept.emplace(files.folder(), source->kind());
#endif
  std::optional<LivePage> live;
  if (a.is_live || a.live_port > 0) {
#ifdef TWOVIEW_HAS_ROOM
    live.emplace(a.live_port, a.makes_room);
#else
    live.emplace(a.live_port, false);
#endif
    const std::string line = summary_line("live", "%s", live->address().c_str());
    if (common.speaks())
      print(line);
    else
      std::fputs(line.c_str(), stderr);
  }
  {
    FlightProgress progress(flight, wanted, !common.quiet);
    flight.track(stop, [&](const SourceFrame& frame) {
      advise_on_size(a, flight.file_camera());
      progress.show();
      if (live) live->update(flight);
#ifdef TWOVIEW_HAS_ROOM
      if (kept) kept->keep(frame, flight);
#else
      (void)frame;
#endif
    });
  }
  if (flight.frames().empty()) throw BadInput("no frame came from " + source->kind());
  if (flight.num_unreadable() == static_cast<int>(flight.frames().size()))
    throw BadInput("no frame of " + source->kind() +
                   " could be used, the first: " + flight.first_problem());
  if (live) live->tell("finishing the map");
  {
    const Stopwatch watch(!common.quiet, "looking in the finished map for frames without a pose");
    flight.finish(stop);
  }
  CameraEvidence on_camera;
  if (!lens && !stop) {
    const Stopwatch watch(!common.quiet, "comparing the map with the camera");
    on_camera = check_camera(flight);
  }
  for (const std::string& note : flight.notes()) common.note(note);
  for (const std::string& mask : flight.mask_files()) files.keep(mask);
  for (const std::string& note : source->notes()) common.note(note);
  if (const int count = flight.num_unreadable(); count > 0)
    common.note(std::to_string(count) + (count == 1 ? " frame" : " frames") +
                " could not be used, the first: " + flight.first_problem());
  if (const std::string note = flight.repeated_note(); !note.empty()) common.note(note);
  for (const std::string& note : {flight.eyes().words(), flight.combed_rows().words()})
    if (!note.empty()) common.note(note);
  const std::optional<FilmFacts> film = source->film();
  FlightResult result = result_of(flight, truth, film ? film->clock_start_s : 0,
                                  wanted < 0 ? static_cast<int>(flight.frames().size()) : wanted);
  if (const std::string note = path_order_words(flight.frames(), result.points, result.segment);
      !note.empty())
    common.note(note);
  for (const std::string& note : result.truth_notes) common.note(note);
  if (const std::string note = mask_note(flight.masks(), flight.masked_share(), "all frames");
      !note.empty())
    common.note(note);
  if (!flight.still_mask().empty()) common.note(still_note(result));
  bool was_stopped = stop;
#ifdef TWOVIEW_HAS_ROOM
  const FlightRoom room = room_of(a, *source, kept ? &*kept : nullptr, result, true_room, stop,
                                  live ? &*live : nullptr);
  if (kept)
    for (const std::string& note : kept->notes()) common.note(note);
  std::optional<DepthFolder> depth;
  if (room.model) depth.emplace(files.folder(), *room.model);
#else
  const FlightRoom room;
#endif
  was_stopped = was_stopped || stop;
  const bool has_map = !result.keyframes.empty();
  FrameSource* pictures = source.get();  // from which they can be read again
#ifdef TWOVIEW_HAS_ROOM
  if (kept) pictures = &*kept;
#endif
  ColmapFolder colmap(files.folder() / "colmap", {camera_path(a.camera), truth_file}, has_map);
  if (has_map) colmap.add_model(result);
  if (has_map) note_blanks(result, common);
  if (has_map && !a.leaves_pictures) {
    const Stopwatch watch(!common.quiet, "writing the pictures of the keyframes");
    for (const std::string& note : colmap.add_pictures(result, *pictures, stop)) common.note(note);
  }
  result.json["colmap_pictures"] = colmap.pictures_json();
  result.json["focal_length"] = lens ? lens->json() : nlohmann::ordered_json(nullptr);
  result.json["camera_check"] = camera_check_json(on_camera);
  result.json["film"] = film_json(film);
  result.json["notes"] = common.notes;
  result.json["interrupted"] = was_stopped || stop;
  result.json["source"] = a.source.empty() ? source->kind() : a.source;
  result.json["options"] = options_of(a, truth_file);
  result.json["seed"] = a.flight.odometry.seed;
  result.json["version"] = tv_version_string();
  result.json["kernels"] = session.kernels();
  const std::string name = fs::absolute(fs::path(a.source) / "x").parent_path().filename().string();
  make_files(result, lens, a.source.empty() ? source->kind() : name, room, files);
  if (common.json) print(json_text(result.json));
  const std::string notes = common.note_lines();
  if (common.speaks())
    print(summary(result, lens, on_camera, *source, files, has_map ? colmap_words(colmap) : "",
                  notes, room.summary));
  files.commit();
  files.remove_others(own_files());
#ifdef TWOVIEW_HAS_ROOM
  if (depth) depth->commit();
#endif
  colmap.commit();
  return exit_status(flight, result);
}

}  // namespace

void add_odometry(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  tv_odometry_options& o = a->flight.odometry;
  tv_odometry_options_init(&o);
  CLI::App* verb =
      program.add_subcommand("odometry", "the frames of one camera to its path and a map");
  verb->add_option(
          "SOURCE", a->source,
          "folder with frames.txt, of TUM RGB-D, EuRoC or KITTI, or of images with --fps; "
          "a film; a camera: its number, v4l2:/dev/video0, gst:PIPELINE or rtsp://...; a recording "
          "of a drone")
      ->type_name("SOURCE");
  verb->add_option("--camera", a->camera,
                   "camera file; without: what the source says of it, or an estimate from the film")
      ->type_name("FILE");
  add_scale_camera(*verb, a->flight.scales_camera);
  add_focal_35mm(*verb, a->flight.focal_35mm, true);
  verb->add_option("--truth", a->truth, "true poses of TUM, EuRoC or KITTI to compare with")
      ->type_name("FILE");
  add_number(*verb, "fps", &a->fps, 0.001, 10000,
             "frames a second, of images without times and of films")
      ->default_str("");
  verb->add_flag("--no-imu", a->ignores_imu,
                 "leave the attitudes, heights and velocities of a set folder's imu.txt out");
  verb->add_flag("--live", a->is_live, "serve a page at 127.0.0.1 that follows the flight");
  add_number(*verb, "live-port", &a->live_port, 1, 65535,
             "the page's port; without: a free one, printed")
      ->default_str("");
  constexpr int kMany = 1 << 30;
  add_number(*verb, "max-frames", &a->flight.max_frames, 0, kMany, "end after so many; 0: all");
  add_number(*verb, "every", &a->flight.every, 1, kMany, "track every K-th frame only");
  add_number(*verb, "max-keypoints", &o.max_keypoints, 100, 4096, "most keypoints of a frame");
  add_number(*verb, "max-keyframes", &o.max_keyframes, 8, 2000, "most keyframes of the map");
  add_number(*verb, "max-points", &o.max_points, 500, 200000, "most points of the map");
  add_number(*verb, "window", &o.window, 3, 20, "keyframes that are adjusted together");
  verb->add_flag(
      "--keep-camera", a->keeps_camera,
      "keep the principal point, also where many keyframes agree that it lies elsewhere");
  verb->add_flag("--no-pictures", a->leaves_pictures,
                 "leave the keyframes' pictures out of colmap/, with the models of these");
  add_number(*verb, "seed", &o.seed, 0, kLargestSeed, "of the samplers");
  CLI::Option* resize = add_number(*verb, "resize", &a->flight.resize, 0, kMaxSide,
                                   "scale frames down to this longer side, pixels; 0: as they are");
  add_mask(*verb, a->flight.masks);
  add_kernels(*verb, o.kernels);
#ifdef TWOVIEW_HAS_ROOM
  CLI::Option* room = verb->add_flag("--room", a->makes_room,
                                     "make the surface of the room as well, as twoview room does; "
                                     "of a live source, whose pictures are kept on the disk of the "
                                     "results for it, too");
  for (CLI::Option* option : add_room_options(*verb, a->room, a->room_truth)) option->needs(room);
#endif
#ifdef TWOVIEW_HAS_DRONE
  verb->add_option("--drone", a->drone.host, "in place of SOURCE: the address of an AR.Drone")
      ->type_name("HOST");
  add_ports(*verb, a->drone);
  add_vehicle(*verb, a->vehicle, true);
  add_estimates(*verb, a->vehicle.estimates);
  add_duration(*verb, a->duration);
#endif
  add_common(*verb, a->common, 0, "folder for the results");
  verb->final_callback([a, resize, &run] {
    a->has_resize = resize->count() > 0;
    run = [a] { return odometry(*a); };
  });
}

}  // namespace cli
