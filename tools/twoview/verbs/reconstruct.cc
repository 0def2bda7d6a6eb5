// twoview reconstruct A B, or --recording DIR: from two views to a pose, a cloud, pictures and a
// report.

#include <CLI/App.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "files/camera_formats.h"
#ifdef TWOVIEW_HAS_DENSE
#include "pair/dense_cloud.h"
#endif
#include "pair/own_matches.h"
#include "pair/pose_readings.h"
#include "pair/reconstruct_pair.h"
#include "pair/simple_lens.h"
#include "pair/truth.h"
#include "pictures/canvas.h"
#include "pictures/pictures.h"
#include "recording/recording_input.h"
#include "report/report.h"
#include "report/tables.h"
#include "verbs/camera_options.h"
#include "verbs/python_verbs.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

const std::vector<std::string> kFiles = {"result.json",  "cloud.ply", "matches.png",
                                         "epipolar.png", "views.png", "report.html"};

struct Arguments {
  Common common;
  std::string image[2], truth, rerun;
  CameraOptions cameras;
  RecordingOptions recording;
  OwnMatchOptions own;
  int32_t dense = 0;  // most dense points; 0: no dense cloud
};

// Throws BadInput unless either two images, or a recording with its --camera, is given.
void check_inputs(const Arguments& a) {
  if (!a.recording.given()) {
    for (int i = 0; i < 2; ++i)
      if (a.image[i].empty())
        throw BadInput(std::string(i == 0 ? "A" : "B") +
                       " is required (see twoview reconstruct --help)");
    if (!a.recording.frames.empty() || !a.recording.body_from_camera.empty() ||
        !a.recording.camera_in_body.empty())
      throw BadInput("--frames, --body-from-camera and --camera-in-body go with --recording");
    return;
  }
  if (!a.image[0].empty()) throw BadInput("give A and B or --recording, not both");
  if (a.own.given()) throw BadInput("--matches are of A and B, and not of a --recording");
  if (a.cameras.focal_35mm == kAutoFocal)
    throw BadInput(
        "--focal-35mm auto: a recording is twoview odometry's, which estimates it from the flight");
  if (a.cameras.both.empty() && !(a.cameras.focal_35mm > 0))
    throw BadInput("--recording needs --camera, or --focal-35mm");
}

bool can_do_without_cameras(int32_t method) {
  return method == TV_SOLVER_EIGHT_POINT || method == TV_SOLVER_SEVEN_POINT;
}

// Where the solver needs cameras and none are known: those from which the focal length is
// estimated. Throws BadInput for two pictures of different sizes, which have two focal lengths, and
// where EXIF data have the focal length of one picture alone.
void estimate_unknown_cameras(Arguments& a, const Picture pictures[2], ImageCameras* cameras) {
  const bool is_wanted = (*cameras)[0].source == ImageCamera::kEstimated;
  const bool needs_cameras = !can_do_without_cameras(a.common.options.estimate.method);
  if (!is_wanted && ((*cameras)[0].source != ImageCamera::kNone || !needs_cameras)) return;
  const Picture& without = pictures[pictures[0].exif.focal_35mm > 0 ? 1 : 0];
  const std::string why = without.name + " " + without.exif.gap;
  if (is_wanted && !needs_cameras)
    throw BadInput("--focal-35mm auto estimates the focal length with the pose, which --method " +
                   method_name(a.common.options.estimate.method) + " does not find");
  const bool have_one_size = pictures[0].file_width == pictures[1].file_width &&
                             pictures[0].file_height == pictures[1].file_height;
  const bool one_is_known = pictures[0].exif.focal_35mm > 0 || pictures[1].exif.focal_35mm > 0;
  if (!have_one_size || (!is_wanted && one_is_known))
    throw BadInput((is_wanted ? "--focal-35mm auto needs two pictures of one size"
                              : "no camera is known: " + why) +
                   "; give --focal-35mm, or --camera, which twoview calibrate makes");
  for (size_t i = 0; i < 2; ++i) (*cameras)[i] = camera_to_estimate(facts_of(pictures[i]));
  a.common.note((is_wanted ? std::string() : "no camera is known (" + why + "): ") +
                "the focal length is estimated from this pair and is doubtful; --focal-35mm or "
                "--camera is better");
}

// Adds the keys of result.json about the estimated focal length.
void add_estimated_focal_length(const Outcome& outcome, nlohmann::ordered_json& json) {
  const tv_two_view& v = outcome.two_view;
  const tv_camera& start = outcome.camera[0];
  const bool is_known = has_full_pose(v) && v.focal_sigma > 0;
  const double pixels = start.fx * (is_known && v.focal_scale > 0 ? v.focal_scale : 1);
  const double sigma = is_known ? v.focal_sigma : kPriorLogFocal;
  nlohmann::ordered_json& focal = json["focal_length"];
  if (focal.is_null()) focal = {{"scale", 1.0}, {"sigma", sigma}};
  focal["focal_35mm"] = focal_35mm_of(pixels, start.width, start.height);
  focal["pixels"] = pixels * outcome.picture[0].file_width / start.width;
  focal["sigma_percent"] = 100 * sigma;
  focal["uncertain"] = sigma > kMostFocalSigma;
  focal["k1"] = focal["k2"] = focal["k3"] = nullptr;
  focal["source"] = "estimated";
}

// Notes that the pictures are not used as a viewer shows them: a camera that is held upright stores
// its pictures lying on their side.
void note_turns(const Picture pictures[2], Common& common) {
  const int turn = pictures[0].turn_deg, other = pictures[1].turn_deg;
  if (turn != other)
    common.note(pictures[0].name + " and " + pictures[1].name +
                " were taken with the camera held differently (EXIF): hold it the same way");
  else if (turn != 0)
    common.note(stored_words(turn) + " (EXIF): so is the cloud");
}

// Turns a picture as a viewer does where the camera that is given for it is of that size, and not
// of the stored picture's.
void turn_to_cameras(const Arguments& a, Picture pictures[2], Common& common) {
  const std::array<std::string, 2> files = a.cameras.files();
  for (size_t i = 0; i < 2; ++i) {
    Picture& picture = pictures[i];
    std::error_code ignored;
    if (files[i].empty() || picture.turn_deg % 180 == 0) continue;
    if (!std::filesystem::is_regular_file(camera_path(files[i]), ignored)) continue;  // a pipe
    const tv_camera camera = load_camera(files[i], picture.name);
    if (camera.width != picture.luma.rows || camera.height != picture.luma.cols) continue;
    if (camera.width == camera.height) continue;
    turn(picture, -picture.turn_deg / 90);
    picture.turn_deg = 0;
    common.note("the pictures are turned as a viewer does (EXIF): the camera is of that size");
  }
}

// The cameras of two images. A method that can do without cameras takes those that are given, and
// EXIF data are only named.
ImageCameras choose_cameras(Arguments& a, const Picture pictures[2]) {
  ImageCameras cameras = a.cameras.cameras_of(facts_of(pictures[0]), facts_of(pictures[1]));
  const int32_t method = a.common.options.estimate.method;
  estimate_unknown_cameras(a, pictures, &cameras);
  if (cameras[0].source == ImageCamera::kNone)
    a.common.note("no camera, so no pose: give --camera or --focal-35mm");
  if (cameras[0].source != ImageCamera::kExif) return cameras;
  if (!can_do_without_cameras(method)) {
    a.common.note(exif_note(cameras));
    return cameras;
  }
  char text[120];
  std::snprintf(text, sizeof text,
                "no camera, so no pose: EXIF has a focal length, --focal-35mm %.4g would use it",
                cameras[0].focal_35mm);
  a.common.note(text);
  return {};
}

// Loads the pictures and the cameras, scales both as --resize says, and sets the calibration's
// sigmas.
ImageCameras load_inputs(Arguments& a, RecordingInput* recording, Session& session,
                         Outcome& outcome) {
  ImageCameras cameras;
  if (recording) {
    const ImageFacts frame{"", recording->width(), recording->height(), {}};
    cameras = a.cameras.cameras_of(frame, frame);
    // Before load, which estimates pairs of frames to choose one.
    a.common.options.set_calibrations(cameras[0].sigmas, cameras[1].sigmas);
    const Progress progress(!a.common.quiet);
    recording->load(cameras[0].camera, session, a.common.options, progress, outcome);
  } else {
    for (int i = 0; i < 2; ++i) outcome.picture[i] = load_picture(a.image[i]);
    turn_to_cameras(a, outcome.picture, a.common);
    note_turns(outcome.picture, a.common);
    cameras = choose_cameras(a, outcome.picture);
    a.common.options.set_calibrations(cameras[0].sigmas, cameras[1].sigmas);
  }
  for (const ImageCamera& camera : cameras)
    for (const std::string& line : camera.notes) a.common.note(line);
  outcome.has_cameras = cameras[0].source != ImageCamera::kNone;
  outcome.has_camera_files = cameras[0].source == ImageCamera::kFile;
  outcome.estimates_focal_length = cameras[0].source == ImageCamera::kEstimated;
  for (size_t i = 0; i < 2; ++i) {
    Picture& picture = outcome.picture[i];
    add_picture_mask(picture.name, picture, a.common);
    bring_to_size(picture, a.common);
    if (outcome.has_cameras)
      outcome.camera[i] = resized(cameras[i].camera, picture.luma.cols, picture.luma.rows);
  }
  return cameras;
}

nlohmann::ordered_json options_of(const Arguments& a) {
  nlohmann::ordered_json json = options_json(a.common.options, kAllOptions | kEffort | kGravity);
  const std::array<std::string, 2> files = a.cameras.files();
  for (size_t i = 0; i < 2; ++i) {
    const std::string key = "camera" + std::to_string(i);
    json[key] =
        files[i].empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(files[i]);
  }
  const double focal = a.cameras.focal_35mm;
  json["dense"] = a.dense;
  a.own.add_json(json);
  json["focal_35mm"] = nullptr;
  if (focal == kAutoFocal) json["focal_35mm"] = "auto";
  if (focal > 0) json["focal_35mm"] = focal;
  return json;
}

void note_still_matches(const tv_two_view& v, Common& common) {
  if (v.num_still == 0) return;
  common.note(std::to_string(v.num_still) + " of " + std::to_string(v.num_matches) +
              " matches stand still while the rest of the picture moves (on-screen text, a frame, "
              "a watermark): left out");
}

// Notes a truth that fits an "ok" pose only as another program may have meant it.
void note_reading(const Truth& truth, const tv_two_view& v, Common& common) {
  if (!has_full_pose(v) || v.verdict != TV_VERDICT_OK) return;
  const std::string words = reading_words(rotation_of(v), translation_of(v), truth.R, truth.t);
  if (!words.empty()) common.note(words);
}

// Makes the output files that the result permits, in the order of the report.
void make_files(const Outcome& outcome, OutputSet& files) {
  const std::vector<CloudPoint> cloud = cloud_of(outcome);
  const tv_reconstruction& r = outcome.reconstruction;
  const bool has_cloud = !cloud.empty() && has_full_pose(outcome.two_view);
  const bool has_lines = has_epipolar_geometry(outcome) && outcome.two_view.num_inliers > 0;
  std::vector<Figure> figures;
  files.add("result.json", json_text(outcome.json));
  if (has_cloud) {
    figures.push_back({"The cloud from the front and from the side",
                       outcome.scale ? "Each point in its colour in image 0."
                                     : "Each point in its colour in image 0. One baseline is the "
                                       "distance between the cameras.",
                       views_picture(outcome, cloud), false});
    files.add("cloud.ply",
              cloud_ply(cloud, outcome.scale ? "metres" : "the distance of the cameras",
                        outcome.dense.has_value()));
    files.add("views.png", png_bytes(figures.back().picture));
  }
  figures.push_back({"Matches",
                     "Lines join the two images of a point; their colour tells how far it moved. "
                     "What the geometry rejected is faint and red.",
                     matches_picture(outcome.picture[0], outcome.picture[1], r.keypoints[0],
                                     r.keypoints[1], r.matches, r.num_matches, r.inlier_mask),
                     true});
  files.add("matches.png", png_bytes(figures.back().picture));
  if (has_lines) {
    figures.push_back(
        {"Epipolar lines",
         "Each point must lie on the line of its colour. The lines of an image meet in its "
         "epipole, "
         "the direction in which the other camera stands: outside the image when the flight was "
         "sideways, inside when it was forward.",
         epipolar_picture(outcome), true});
    files.add("epipolar.png", png_bytes(figures.back().picture));
  }
  files.add("report.html", report_html(outcome, cloud, figures));
}

std::string uncertainty_line(const tv_two_view& v) {
  const Uncertainty sigma = uncertainty_deg(v);
  return summary_line("uncertainty", "rotation %s deg, direction %s deg (1 sigma)",
                      sigma_in_words(sigma.rotation).c_str(),
                      sigma_in_words(sigma.direction).c_str());
}

// The line that reports the shift of the principal point; empty if there is none.
std::string camera_line(const tv_two_view& v) {
  const double* shift = v.principal_point_shift;
  if (shift[0] == 0 && shift[1] == 0) return "";
  return summary_line(
      "camera",
      "its principal point seems to be (%+.1f, %+.1f) px off; pose and points are of the "
      "corrected camera",
      shift[0], shift[1]);
}

std::string pose_lines(const Outcome& outcome) {
  const tv_two_view& v = outcome.two_view;
  std::string text;
  if (v.has_R)
    text += summary_line("rotation", "%.3f deg between the views",
                         rotation_error_deg(rotation_of(v), {1, 0, 0, 0, 1, 0, 0, 0, 1}));
  if (has_full_pose(v)) {
    // The position of camera 1 in the frame of camera 0, which is easier to interpret than t.
    const Vector3 c = applied(transposed(rotation_of(v)), translation_of(v));
    const double unit = unit_of(outcome);
    char far[48] = "one baseline";
    if (outcome.scale) std::snprintf(far, sizeof far, "%.3f m", unit);
    text += summary_line("direction",
                         "camera 1 stands at (%+.3f right, %+.3f down, %+.3f forward), %s away",
                         -unit * c[0], -unit * c[1], -unit * c[2], far);
  }
  if (v.has_covariance) text += uncertainty_line(v);
  if (focal_length_is_uncertain(v))
    text += summary_line("camera", "focal length uncertain: %+.1f %% of the given one, +- %.1f %%",
                         focal_change_percent(v), 100 * v.focal_sigma);
  return text + camera_line(v);
}

std::string truth_line(const nlohmann::ordered_json& truth) {
  std::string text = "no pose to compare";
  const auto part = [&](const char* key, const char* format) {
    if (!truth[key].is_number()) return;
    char number[96];
    std::snprintf(number, sizeof number, format, truth[key].get<double>());
    text += number;
  };
  if (truth["rotation_error_deg"].is_number()) text.clear();
  part("rotation_error_deg", "rotation off by %.3f deg");
  part("translation_error_deg", ", direction by %.3f deg");
  part("depth_error_median_percent", ", depth by %.2f %% (median)");
  part("depth_error_p95_percent", ", %.2f %% (95th percentile)");
  std::string lines = summary_line("truth", "%s", text.c_str());
  text.clear();
  if (!truth.contains("num_dense_depths")) return lines;
  part("num_dense_depths", "%.0f dense points of known depth");
  part("dense_depth_error_median_percent", ", depth off by %.2f %% (median)");
  part("dense_depth_error_p95_percent", ", %.2f %% (95th percentile)");
  return lines + summary_line("", "%s", text.c_str());
}

std::string summary(const Outcome& outcome, const RecordingInput* recording, const OutputSet& files,
                    size_t context_bytes, const std::string& notes) {
  const Style style = stdout_style();
  const tv_two_view& v = outcome.two_view;
  const tv_reconstruction& r = outcome.reconstruction;
  const Picture &a = outcome.picture[0], &b = outcome.picture[1];
  std::string text;
  text += summary_line("images", "%s %dx%d, %s %dx%d", a.name.c_str(), a.luma.cols, a.luma.rows,
                       b.name.c_str(), b.luma.cols, b.luma.rows);
  text += notes;
  const char* const colours[] = {style.poor, style.fair, style.good};
  const std::string reasons = reasons_in_words(outcome);
  text += summary_line("verdict", "%s%s%s: %s%s%s", colours[v.verdict], verdict_in_words(v).c_str(),
                       style.off, kind_in_words(v.kind).c_str(), reasons.empty() ? "" : "; ",
                       reasons.c_str());
  for (const std::string& advice : advice_on(outcome))
    text += summary_line("advice", "%s", advice.c_str());
  if (v.has_R && v.has_t)
    text += summary_line("belief", "rotation off by more than 5 deg with probability %.2g %%%s",
                         100 * v.probability_wrong,
                         focal_length_is_uncertain(v) ? ", if the focal length is right" : "");
  text += summary_line("keypoints", "%d and %d", r.num_keypoints[0], r.num_keypoints[1]);
  if (r.effort > 0)
    text += summary_line("effort", "rung %d, after %d %s", r.effort, r.num_rungs,
                         r.num_rungs == 1 ? "rung" : "rungs");
  text += summary_line("matches", "%d, of which %d agree (%.0f %%)", v.num_matches, v.num_inliers,
                       v.num_matches ? 100.0 * v.num_inliers / v.num_matches : 0.0);
  if (r.num_matches_left_out > 0)
    text +=
        summary_line("left out", "%d matches, of the highest ratio: more than the context holds",
                     r.num_matches_left_out);
  text += pose_lines(outcome);
  if (recording) text += recording->words(outcome);
  const auto& j = outcome.json;
  if (j["median_parallax_deg"].is_number())
    text += summary_line("parallax", "%.2f deg (median)", j["median_parallax_deg"].get<double>());
  if (r.num_points > 0)
    text += summary_line("cloud", "%d points, reprojection %.2f px rms", r.num_points,
                         j["rms_reprojection_px"].get<double>());
  if (outcome.dense) {
    text += summary_line("dense", "%zu points in %.0f ms", outcome.dense->size(),
                         j["timings_ms"]["dense"].get<double>());
    if (!outcome.dense->empty())
      text +=
          summary_line("", "distance known to %.2f %% by the match, %.2f %% by the pose (1 sigma)",
                       j["dense_sigma_median_percent"].get<double>(),
                       j["dense_pose_sigma_median_percent"].get<double>());
  }
  if (j["truth"].is_object()) text += truth_line(j["truth"]);
  text += summary_line(
      "work", "%.1f ms with %s kernels in %.1f MiB", j["timings_ms"]["total"].get<double>(),
      j["kernels"].get<std::string>().c_str(), static_cast<double>(context_bytes) / (1 << 20));
  std::string names;
  for (const std::string& name : files.names()) names += " " + name;
  return text + summary_line("files", "%s:%s", files.folder().c_str(), names.c_str());
}

// Writes the result in the folder as a file for Rerun's viewer. Returns the exit status.
int write_rerun(const Arguments& a, const Outcome& outcome, const std::string& folder) {
  std::vector<std::string> arguments{folder, a.rerun};
  if (!a.common.speaks()) arguments.emplace_back("--quiet");
  if (!a.recording.given()) arguments.insert(arguments.end(), {"--images", a.image[0], a.image[1]});
  if (outcome.has_cameras) {
    arguments.emplace_back("--intrinsics");
    const tv_camera_pair pair = corrected_pair(outcome);
    for (const tv_camera& camera : {pair.camera0, pair.camera1}) {
      for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) {
        char digits[32];
        std::snprintf(digits, sizeof digits, "%.17g", value);
        arguments.emplace_back(digits);
      }
    }
  }
  return run_python_verb("rerun", arguments);
}

int reconstruct(Arguments& a) {
  Common& common = a.common;
  common.options.settle();
  check_inputs(a);
  // A missing package and a file that cannot be written are reported, by the tool itself, before
  // anything is computed or written.
  if (!a.rerun.empty() && run_python_verb("rerun", {"--check=" + a.rerun}) != 0)
    return kExitBadInput;
  std::unique_ptr<RecordingInput> recording;
  if (a.recording.given())
    recording = std::make_unique<RecordingInput>(a.recording, a.cameras.both);
  Session session(common.options);
  Outcome outcome;
  MatchList own_matches;
  if (a.own.given()) own_matches = load_matches(a.own.path);
  const ImageCameras cameras = load_inputs(a, recording.get(), session, outcome);
  if (recording) recording->add_gravity(common.options.estimate);
  if (a.own.given()) {
    fit_to_pictures(outcome.picture, a.own.resize, a.own.path, own_matches);
    for (const std::string& note : own_match_notes(own_matches, a.own.path)) common.note(note);
  }
  const bool has_truth = !a.truth.empty();
  Truth truth;
  if (has_truth) {
    truth = load_truth(a.truth);
    check_truth(truth, outcome.picture[0]);
  }
  OutputSet files(common.output);
  for (const std::string& image : a.image) files.keep(image);
  for (const std::string& mask : common.options.masks.files()) files.keep(mask);
  for (const std::string& camera : a.cameras.files()) files.keep(camera_path(camera));
  files.keep(a.truth);
  files.keep(a.own.path);
  files.require_own({"reconstruct", kFiles, {"result.json", "matches.png"}, {}});
  uint64_t total_ns = 0;
  {
    const Stopwatch watch(!common.quiet, watch_text(common.options));
    total_ns = a.own.given() ? estimate_own_matches(session, common.options, own_matches, outcome)
                             : reconstruct_pair(session, common.options, outcome);
  }
  uint64_t dense_ns = 0;
#ifdef TWOVIEW_HAS_DENSE
  if (a.dense > 0) dense_ns = densify_pair(a.dense, outcome);
#endif
  if (recording) recording->add_scale(outcome);

  outcome.json = result_json(outcome);
  if (outcome.estimates_focal_length) add_estimated_focal_length(outcome, outcome.json);
  if (recording) recording->add_json(outcome);
  if (has_truth)
    outcome.json["truth"] =
        truth_json(truth, outcome.picture[0], outcome.two_view, outcome.reconstruction);
  if (has_truth) note_reading(truth, outcome.two_view, common);
  if (has_truth && outcome.dense)
    add_dense_truth(truth, outcome.picture[0], *outcome.dense, outcome.json["truth"]);
  outcome.json["timings_ms"] = session.take_times(total_ns + dense_ns, true);
  outcome.json["timings_ms"]["rungs"] = rungs_json(outcome.reconstruction);
  if (outcome.dense) outcome.json["timings_ms"]["dense"] = static_cast<double>(dense_ns) * 1e-6;
  outcome.json["context_bytes"] = session.context_bytes();
  outcome.json["cameras"] = cameras_json(cameras);
  outcome.json["options"] = options_of(a);
  outcome.json["kernels"] = session.kernels();
  note_still_matches(outcome.two_view, common);
  outcome.notes = common.notes;
  outcome.json["notes"] = outcome.notes;
  make_files(outcome, files);

  if (common.json) print(json_text(outcome.json));
  const std::string notes = common.note_lines();
  if (common.speaks())
    print(summary(outcome, recording.get(), files, session.context_bytes(), notes));
  files.commit();
  files.remove_others(kFiles);
  if (!a.rerun.empty() && write_rerun(a, outcome, files.folder()) != 0) return kExitBadInput;
  if (has_full_pose(outcome.two_view)) return kExitPose;
  const std::string reasons = reasons_in_words(outcome);
  std::fprintf(stderr, "twoview: no full pose: %s%s%s\n",
               kind_in_words(outcome.two_view.kind).c_str(), reasons.empty() ? "" : ": ",
               reasons.c_str());
  return kExitNoPose;
}

}  // namespace

void add_reconstruct(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      program.add_subcommand("reconstruct", "two images to a pose, a point cloud and a report");
  verb->add_option("A", a->image[0], "image 0")->type_name("IMAGE");
  verb->add_option("B", a->image[1], "image 1")->type_name("IMAGE");
  a->recording.add_to(*verb);
  a->cameras.add_to(*verb, true);
  verb->add_option("--truth", a->truth, "known R, t, baseline, depth0 (YAML) to compare with")
      ->type_name("FILE");
  verb->add_option("--rerun", a->rerun, "also write a file for Rerun's viewer (needs rerun-sdk)")
      ->type_name("FILE.rrd");
#ifdef TWOVIEW_HAS_DENSE
  verb->add_option("--dense", a->dense, "also up to N dense points, by matching all of the images")
      ->type_name("N")
      ->check(CLI::Range(0, kMostDensePoints));
#endif
  add_common(*verb, a->common, kAllOptions | kEffort | kGravity, "folder for the results");
  a->own.add_to(*verb,
                "matches of A and B by another program, in place of twoview's: .npz, .npy, or a "
                "table of x0 y0 x1 y1 and perhaps a score",
                "FILE");
  verb->final_callback([a, &run] { run = [a] { return reconstruct(*a); }; });
}

}  // namespace cli
