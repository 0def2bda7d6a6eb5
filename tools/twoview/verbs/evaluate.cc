// twoview evaluate PAIRS.txt: estimates the poses of many pairs and reports SuperGlue's measures of
// their errors.

#include <CLI/App.hpp>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "files/camera_file.h"
#include "files/camera_formats.h"
#include "files/camera_set.h"
#include "files/match_folder.h"
#include "files/own_poses.h"
#include "files/pairs_file.h"
#include "pair/camera_advice.h"
#include "pair/measures.h"
#include "pair/options.h"
#include "pair/own_matches.h"
#include "pair/pose_readings.h"
#include "pair/reconstruct_pair.h"
#include "verbs/evaluate_tables.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
constexpr double kFailed = std::numeric_limits<double>::infinity();
constexpr size_t kMaxReportBytes = size_t{1} << 30;
constexpr int kThresholdsDeg[] = {5, 10, 20};

struct Arguments {
  Common common;
  std::string pairs, images, camera;
  double focal_35mm = 0;
  bool scales_camera = false;
  int max_pairs = 0;
  OwnMatchOptions own;
  std::vector<std::string> poses;  // of --poses, each [NAME=]FILE
  bool has_tables = false;
};

struct Errors {
  double rotation = kFailed, translation = kFailed, translation_signed = kFailed;
  double pose() const { return std::max(rotation, translation); }
  double pose_signed() const { return std::max(rotation, translation_signed); }
};

struct PairReport {
  Json json;
  bool has_truth = false;
  Errors errors;
  std::vector<Errors> own_errors;  // of the systems of --poses, in their order
  // The errors against another reading of the list's pose: of twoview, where its verdict is ok
  // (pair/pose_readings.h); of the systems of --poses, against the inverse pose.
  std::vector<Errors> reading_errors;
  std::vector<Errors> own_inverse_errors;
  bool truth_stands = false;           // the list's pose has no translation
  bool contradicts = false;            // the list's pose, by more than three of its sigmas
  std::optional<ShiftEvidence> shift;  // empty where the pair says nothing of its camera
};

// The rotation from a camera's frame to its frame after its image is turned counter-clockwise.
Matrix3 turn_matrix(int quarters) {
  Matrix3 turn = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (int i = 0; i < (quarters & 3); ++i) turn = product({0, 1, 0, -1, 0, 0, 0, 0, 1}, turn);
  return turn;
}

// What the cameras of the images are taken from: the file of --camera, or --focal-35mm, else
// cameras.yaml and K.
struct Cameras {
  std::optional<CameraFile> file;
  double focal_35mm = 0;
  NamedCameras set;
  bool scales_camera = false;

  tv_camera of(const std::string& name, const Picture& picture,
               const std::array<double, 9>* K) const {
    const int width = picture.luma.cols, height = picture.luma.rows;
    if (focal_35mm > 0) return film_camera(focal_35mm, width, height);
    if (!file && set.empty() && !K)
      throw BadInput("no camera for image " + name +
                     ": no K on its line and no cameras.yaml beside the list; give --camera or " +
                     focal_option(picture.exif));
    if (!file) return camera_of_image(set, name, width, height, K);
    return fitted(file->of(name), file->path, width, height, name, scales_camera);
  }
};

void load_pair(Arguments& a, const Cameras& cameras, const Pair& pair, Outcome& outcome) {
  const std::string* names[] = {&pair.name0, &pair.name1};
  const std::array<double, 9>* Ks[] = {&pair.K0, &pair.K1};
  const int turns[] = {pair.turns0, pair.turns1};
  outcome.has_cameras = true;
  for (int i = 0; i < 2; ++i) {
    Picture& picture = outcome.picture[i];
    picture = load_picture((fs::path(a.images) / *names[i]).string());
    outcome.camera[i] = cameras.of(*names[i], picture, pair.has_K ? Ks[i] : nullptr);
    add_picture_mask(*names[i], picture, a.common);
    turn(picture, turns[i]);
    outcome.camera[i] = turned(outcome.camera[i], turns[i]);
    bring_to_size(picture, a.common);
    outcome.camera[i] = resized(outcome.camera[i], picture.luma.cols, picture.luma.rows);
  }
}

// The errors of a pose against that of the list.
Errors errors_of(const Matrix3& R, const Vector3& t, const Matrix3& R_true, const Vector3& t_true) {
  return {rotation_error_deg(R, R_true), translation_error_deg(t, t_true),
          translation_error_signed_deg(t, t_true)};
}

// The errors against the list's pose as it may have been meant.
std::vector<Errors> reading_errors_of(const Matrix3& R, const Vector3& t, const Matrix3& R_true,
                                      const Vector3& t_true) {
  std::vector<Errors> errors;
  for (const PairReading& reading : other_readings(R_true, t_true))
    errors.push_back(errors_of(R, t, reading.R, reading.t));
  return errors;
}

void add_errors(const Errors& errors, Json& json) {
  json["rotation_error_deg"] = finite_or_null(errors.rotation);
  json["translation_error_deg"] = finite_or_null(errors.translation);
  json["translation_error_signed_deg"] = finite_or_null(errors.translation_signed);
  json["pose_error_deg"] = finite_or_null(errors.pose());
}

// Compares the poses of the user's systems with the list's.
void compare_own(const std::vector<OwnPoses>& systems, const Pair& pair, PairReport& report) {
  if (!pair.has_truth || systems.empty()) return;
  for (const OwnPoses& system : systems) {
    bool is_listed = false;
    const std::optional<OwnPose> pose = system.of(pair.name0, pair.name1, &is_listed);
    report.own_errors.push_back(pose ? errors_of(pose->R, pose->t, pair.R, pair.t) : Errors());
    report.own_inverse_errors.push_back(
        pose ? reading_errors_of(pose->R, pose->t, pair.R, pair.t)[0] : Errors());
    add_errors(report.own_errors.back(), report.json["systems"][system.name]);
  }
}

// Whether a pose is farther from the list's than kContradictsSigmas of its covariance, in rotation
// or in direction.
bool contradicts_list(const tv_two_view& v, const Errors& errors) {
  constexpr double kContradictsSigmas = 3, kDegrees = 57.29577951308232;
  if (!v.has_covariance) return false;
  const double* const c = v.covariance;
  const double rotation = std::sqrt(c[0] + c[6] + c[12]), direction = std::sqrt(c[18] + c[24]);
  const double most = kContradictsSigmas * kDegrees;
  return errors.rotation > most * rotation || errors.translation_signed > most * direction;
}

void compare(const Pair& pair, const Outcome& outcome, PairReport& report) {
  const Matrix3 turn0 = turn_matrix(pair.turns0), turn1 = turn_matrix(pair.turns1);
  const Matrix3 R_true = product(product(turn1, pair.R), transposed(turn0));
  const Vector3 t_true = applied(turn1, pair.t);
  const tv_two_view& v = outcome.two_view;
  if (v.has_R) report.errors.rotation = rotation_error_deg(rotation_of(v), R_true);
  if (has_full_pose(v))
    report.errors = errors_of(rotation_of(v), translation_of(v), R_true, t_true);
  if (has_full_pose(v) && v.verdict == TV_VERDICT_OK)
    report.reading_errors = reading_errors_of(rotation_of(v), translation_of(v), R_true, t_true);
  report.truth_stands = norm(t_true) == 0;
  report.contradicts =
      !report.reading_errors.empty() && !report.truth_stands && contradicts_list(v, report.errors);
  // Precision compares the matches with the true pose, which refers to the given cameras and not to
  // those with a shifted principal point.
  report.json["precision"] =
      match_precision(outcome.camera[0], outcome.camera[1], R_true, t_true, outcome.reconstruction);
}

// Estimates the pair of the outcome, from its pictures or from the matches of --matches. Returns
// the time in nanoseconds.
uint64_t estimate_pair(Arguments& a, const Pair& pair, MatchFolder* folder, Session& session,
                       Outcome& outcome) {
  if (!folder) return reconstruct_pair(session, a.common.options, outcome);
  std::string file;
  MatchList matches = folder->matches_of(pair.name0, pair.name1, &file);
  fit_to_pictures(outcome.picture, a.own.resize, file, matches);
  for (const std::string& note : own_match_notes(matches, "the files of matches"))
    a.common.note(note);
  return estimate_own_matches(session, a.common.options, matches, outcome);
}

PairReport evaluate_pair(Arguments& a, const Cameras& cameras, const Pair& pair,
                         MatchFolder* folder, Session& session) {
  PairReport report;
  report.has_truth = pair.has_truth;
  Json& json = report.json;
  json["name0"] = pair.name0;
  json["name1"] = pair.name1;
  for (const char* key :
       {"rotation_error_deg", "translation_error_deg", "translation_error_signed_deg",
        "pose_error_deg", "num_matches", "num_inliers", "precision", "config", "verdict", "reasons",
        "probability_wrong", "covariance", "principal_point_shift_px", "principal_point",
        "camera_misfit", "effort", "timings_ms", "time_ms"})
    json[key] = nullptr;
  try {
    Outcome outcome;
    load_pair(a, cameras, pair, outcome);
    const uint64_t total_ns = estimate_pair(a, pair, folder, session, outcome);
    const tv_two_view& v = outcome.two_view;
    if (a.common.options.masks.given())
      json["masked_share"] = {masked_share(outcome.picture[0].mask),
                              masked_share(outcome.picture[1].mask)};
    json["num_matches"] = v.num_matches;
    json["num_inliers"] = v.num_inliers;
    if (v.num_still > 0) json["num_still_matches"] = v.num_still;
    json["config"] = tv_kind_string(static_cast<tv_kind>(v.kind));
    json["verdict"] = tv_verdict_string(static_cast<tv_verdict>(v.verdict));
    json["reasons"] = reasons_json(v.reasons);
    json["probability_wrong"] = v.probability_wrong;
    json["covariance"] = covariance_json(v);
    json["principal_point_shift_px"] = v.principal_point_shift;
    json["principal_point"] = principal_point_json(outcome);
    json["camera_misfit"] = camera_misfit_json(outcome.evidence);
    report.shift = shift_evidence(outcome.evidence, outcome.camera[0]);
    json["effort"] = outcome.reconstruction.effort;
    json["timings_ms"] = {{"rungs", rungs_json(outcome.reconstruction)}};
    json["time_ms"] = static_cast<double>(total_ns) * 1e-6;
    if (pair.has_truth) compare(pair, outcome, report);
  } catch (const BadInput& e) {
    json["error"] = e.what();
  }
  if (pair.has_truth) add_errors(report.errors, json);
  return report;
}

// The errors of the pairs with a truth: of twoview, or of the user's system of this number.
constexpr size_t kTwoview = SIZE_MAX;
std::vector<Errors> errors_of_pairs(const std::vector<PairReport>& reports, size_t system) {
  std::vector<Errors> errors;
  for (const PairReport& report : reports)
    if (report.has_truth)
      errors.push_back(system == kTwoview ? report.errors : report.own_errors[system]);
  return errors;
}

Json auc_json(const std::vector<PairReport>& reports, size_t system,
              double (Errors::*error)() const) {
  std::vector<double> errors;
  for (const Errors& of_pair : errors_of_pairs(reports, system))
    errors.push_back((of_pair.*error)());
  Json json;
  for (const int threshold : kThresholdsDeg)
    json[std::to_string(threshold)] =
        errors.empty() ? Json(nullptr) : Json(auc_percent(errors, threshold));
  return json;
}

Json mean_of(const std::vector<PairReport>& reports, const char* key) {
  double sum = 0;
  int count = 0;
  for (const PairReport& report : reports)
    if (report.json[key].is_number()) sum += report.json[key].get<double>(), ++count;
  return count ? Json(sum / count) : Json(nullptr);
}

Json median_error(const std::vector<PairReport>& reports, size_t system) {
  std::vector<double> errors;
  for (const Errors& of_pair : errors_of_pairs(reports, system)) errors.push_back(of_pair.pose());
  if (errors.empty()) return nullptr;
  std::sort(errors.begin(), errors.end());
  return finite_or_null((errors[(errors.size() - 1) / 2] + errors[errors.size() / 2]) / 2);
}

// How many pairs have each verdict. A pair that cannot be read has none.
Json verdict_counts(const std::vector<PairReport>& reports) {
  Json counts;
  for (const tv_verdict verdict : {TV_VERDICT_OK, TV_VERDICT_DOUBTFUL, TV_VERDICT_REFUSED}) {
    const char* const name = tv_verdict_string(verdict);
    counts[name] = std::count_if(reports.begin(), reports.end(), [name](const PairReport& report) {
      return report.json["verdict"] == name;
    });
  }
  return counts;
}

Json principal_points_json(const std::vector<PairReport>& reports) {
  std::vector<ShiftEvidence> pairs;
  for (const PairReport& report : reports)
    if (report.shift) pairs.push_back(*report.shift);
  Json list = Json::array();
  for (const CameraAdvice& advice : advise(pairs)) {
    const tv_camera& camera = advice.camera;
    const Json asked = advice.num_asking > 0 ? Json(advice.asked_px) : Json(nullptr);
    const Json deviation = advice.num_asking > 0 ? Json(advice.deviation_px) : Json(nullptr);
    list.push_back({{"image_size", {camera.width, camera.height}},
                    {"fx", camera.fx},
                    {"fy", camera.fy},
                    {"cx", camera.cx},
                    {"cy", camera.cy},
                    {"num_pairs", advice.num_pairs},
                    {"num_asking", advice.num_asking},
                    {"asked_px", asked},
                    {"deviation_px", deviation},
                    {"calibrate_again", advice.calibrate_again}});
  }
  return list;
}

// A row for each of the user's systems.
Json systems_json(const std::vector<OwnPoses>& systems, const std::vector<PairReport>& reports) {
  Json list = Json::array();
  for (size_t i = 0; i < systems.size(); ++i) {
    const std::vector<Errors> errors = errors_of_pairs(reports, i);
    list.push_back(
        {{"name", systems[i].name},
         {"auc", auc_json(reports, i, &Errors::pose)},
         {"auc_signed", auc_json(reports, i, &Errors::pose_signed)},
         {"median_pose_error_deg", median_error(reports, i)},
         {"num_pairs", errors.size()},
         {"num_without_pose", std::count_if(errors.begin(), errors.end(), [](const Errors& error) {
            return !std::isfinite(error.pose());
          })}});
  }
  return list;
}

Json report_json(const Arguments& a, const std::vector<OwnPoses>& systems,
                 const std::vector<PairReport>& reports, const Session& session) {
  const Options& options = a.common.options;
  Json json;
  json["auc"] = auc_json(reports, kTwoview, &Errors::pose);
  json["auc_signed"] = auc_json(reports, kTwoview, &Errors::pose_signed);
  json["num_pairs"] = reports.size();
  json["verdict_counts"] = verdict_counts(reports);
  json["num_unreadable"] =
      std::count_if(reports.begin(), reports.end(),
                    [](const PairReport& report) { return report.json.contains("error"); });
  json["median_pose_error_deg"] = median_error(reports, kTwoview);
  for (const char* key : {"num_matches", "num_inliers", "precision", "time_ms"})
    json["mean_" + std::string(key)] = mean_of(reports, key);
  json["principal_points"] = principal_points_json(reports);
  json["systems"] = systems_json(systems, reports);
  json["pairs"] = Json::array();
  for (const PairReport& report : reports) json["pairs"].push_back(report.json);
  json["options"] = options_json(options, kAllOptions | kEffort);
  json["options"]["max_pairs"] = a.max_pairs;
  a.own.add_json(json["options"]);
  json["options"]["poses"] = a.poses;
  json["options"]["camera"] = a.camera.empty() ? Json(nullptr) : Json(a.camera);
  json["options"]["focal_35mm"] = a.focal_35mm > 0 ? Json(a.focal_35mm) : Json(nullptr);
  json["seed"] = options.estimate.seed;
  json["version"] = tv_version_string();
  json["kernels"] = session.get() ? Json(session.kernels()) : Json(nullptr);
  json["context_bytes"] = session.context_bytes();
  return json;
}

std::string cell(const Json& value, const char* format, int width, double factor = 1) {
  char text[64];
  if (value.is_number())
    std::snprintf(text, sizeof text, format, value.get<double>() * factor);
  else
    std::snprintf(text, sizeof text, "%*s", width, "-");
  return text;
}

std::string padded(const std::string& text, size_t width) {
  return text + std::string(width - std::min(width, text.size()), ' ');
}

// The width of a column of names, whole: what tells the names of a set apart may be at either end.
size_t name_width(const Json& pairs, const char* key) {
  size_t width = std::strlen("image 0");
  for (const Json& pair : pairs)
    width = std::max(width, pair[key].get_ref<const std::string&>().size());
  return width;
}

// A line for each camera whose pairs agree that its principal point is elsewhere.
std::string advice_lines(const Json& report) {
  std::string text;
  const Json& cameras = report["principal_points"];
  for (const Json& camera : cameras) {
    if (!camera["calibrate_again"].get<bool>()) continue;
    char which[80] = "", line[200];
    const double cx = camera["cx"], cy = camera["cy"];
    if (cameras.size() > 1) std::snprintf(which, sizeof which, " of cx %.1f, cy %.1f", cx, cy);
    std::snprintf(line, sizeof line, "%d of %d pairs%s ask for (%ld, %ld) px: calibrate again\n",
                  camera["num_asking"].get<int>(), camera["num_pairs"].get<int>(), which,
                  std::lround(camera["asked_px"][0].get<double>()),
                  std::lround(camera["asked_px"][1].get<double>()));
    text += line;
  }
  return text;
}

// A line for each of the user's systems.
std::string system_lines(const Json& report) {
  std::string text;
  for (const Json& system : report["systems"])
    text += padded(system["name"].get<std::string>(), 11) +
            " at 5, 10, 20 deg:" + cell(system["auc"]["5"], "%6.1f", 6) +
            cell(system["auc"]["10"], "%6.1f", 6) + cell(system["auc"]["20"], "%6.1f", 6) +
            " %; median pose error" + cell(system["median_pose_error_deg"], " %.2f deg", 4) + ", " +
            system["num_without_pose"].dump() + " without a pose\n";
  return text;
}

std::string table(const Json& report) {
  const Style style = stdout_style();
  const size_t width[2] = {name_width(report["pairs"], "name0"),
                           name_width(report["pairs"], "name1")};
  std::string text = style.dim + padded("image 0", width[0]) + " " + padded("image 1", width[1]) +
                     " matches inliers  prec %  R deg   t deg      ms  config" + style.off + "\n";
  for (const Json& pair : report["pairs"]) {
    text += padded(pair["name0"].get<std::string>(), width[0]) + " " +
            padded(pair["name1"].get<std::string>(), width[1]);
    if (pair.contains("error")) {
      text += std::string(" ") + style.poor + pair["error"].get<std::string>() + style.off + "\n";
      continue;
    }
    text += " " + cell(pair["num_matches"], "%7.0f", 7) + " " +
            cell(pair["num_inliers"], "%7.0f", 7) + " " + cell(pair["precision"], "%7.1f", 7, 100) +
            " " + cell(pair["rotation_error_deg"], "%6.2f", 6) + " " +
            cell(pair["translation_error_deg"], "%7.2f", 7) + " " +
            cell(pair["time_ms"], "%7.1f", 7) + "  " + pair["config"].get<std::string>() + ", " +
            pair["verdict"].get<std::string>() + "\n";
  }
  text += style.bold;
  for (const char* key : {"auc", "auc_signed"}) {
    const Json& auc = report[key];
    text += padded(key, 11) + " at 5, 10, 20 deg:" + cell(auc["5"], "%6.1f", 6) +
            cell(auc["10"], "%6.1f", 6) + cell(auc["20"], "%6.1f", 6) + " %\n";
  }
  text += system_lines(report);
  const Json& counts = report["verdict_counts"];
  text += std::to_string(report["num_pairs"].get<size_t>()) + " pairs: ";
  for (const auto& [verdict, count] : counts.items())
    text += std::to_string(count.get<int>()) + " " + verdict + (verdict == "refused" ? "" : ", ");
  const Json& unread = report["num_unreadable"];
  if (unread != 0) text += ", " + unread.dump() + " not readable";
  return text + "; median pose error" + cell(report["median_pose_error_deg"], " %.2f deg", 4) +
         ", mean time" + cell(report["mean_time_ms"], " %.1f ms", 4) + style.off + "\n" +
         advice_lines(report);
}

// Splits -o: an existing folder is a folder; otherwise a path that ends in .json or exists is a
// file, and any other path is a folder.
void split_output(const std::string& output, fs::path& folder, std::string& name) {
  const fs::path path(output);
  std::error_code error;
  const bool is_folder = fs::is_directory(path, error);
  if (!is_folder && (path.extension() == ".json" || fs::exists(path, error))) {
    folder = path.parent_path();
    name = path.filename().string();
  } else {
    folder = path;
    name = "report.json";
  }
}

// Loads the cameras, and sets how sure their calibration is, as `reconstruct` does.
Cameras load_cameras(Arguments& a) {
  Cameras cameras;
  const fs::path set_path = fs::path(a.pairs).parent_path() / "cameras.yaml";
  CalibrationSigmas sigmas = kPlainFile;
  if (!a.camera.empty()) {
    cameras.file = load_camera_file(a.camera);
    cameras.scales_camera = a.scales_camera;
    sigmas = cameras.file->sigmas;
    if (!cameras.file->note().empty()) a.common.note(cameras.file->note());
  } else if (a.focal_35mm > 0) {
    sigmas = kFilm;
    cameras.focal_35mm = a.focal_35mm;
  } else if (fs::exists(set_path)) {
    std::vector<std::string> left_out;
    cameras.set = load_camera_set(set_path.string(), &left_out);
    if (!left_out.empty()) a.common.note(left_out_note(set_path.string(), left_out));
  }
  a.common.options.set_calibrations(sigmas, sigmas);
  return cameras;
}

// The number of poses that fit another reading of the list's poses and not the list as it is
// written, if these are more than half; else 0. of_report: the errors against both readings.
template <typename OfReport>
size_t num_of_other_reading(const std::vector<PairReport>& reports, const OfReport& of_report) {
  size_t count = 0, num_other = 0;
  for (const PairReport& report : reports) {
    const auto [errors, other] = of_report(report);
    if (other.pose_signed() == kFailed) continue;
    ++count;
    num_other += other.pose_signed() < kNearPoseDeg && errors.pose_signed() > kFarPoseDeg;
  }
  return 2 * num_other > count ? num_other : 0;
}

// Notes true poses that have no translation, and lists of true poses that most estimates
// contradict. Of real pairs with the verdict ok, 3.2 % lie beyond three standard deviations.
void note_contradictions(const std::vector<PairReport>& reports, const std::string& list,
                         Common& common) {
  const auto count = [&](const auto& is_counted) {
    return std::count_if(reports.begin(), reports.end(), is_counted);
  };
  const auto num_still = count([](const PairReport& report) { return report.truth_stands; });
  if (num_still > 0)
    common.note("the true poses of " + std::to_string(num_still) + " of " +
                std::to_string(reports.size()) + " pairs of " + list +
                " have no translation: an error of direction, and so of the pose, is not known of "
                "them");
  const auto num_ok = count([](const PairReport& r) { return !r.reading_errors.empty(); });
  const auto num_contradicting = count([](const PairReport& report) { return report.contradicts; });
  if (num_contradicting < 3 || 2 * num_contradicting <= num_ok) return;
  common.note(std::to_string(num_contradicting) + " of " + std::to_string(num_ok) +
              " poses that are ok lie more than three of their standard deviations from those of " +
              list + ": are its poses those of the cameras, and of these pictures?");
}

// Notes where the estimates fit the list's poses only if these are read in another way, such as in
// the other direction.
void note_readings(const std::vector<OwnPoses>& systems, const std::vector<PairReport>& reports,
                   const std::string& list, Common& common) {
  const std::vector<PairReading> readings = other_readings({1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 1});
  size_t most = 0, best = 0;
  for (size_t k = 0; k < readings.size(); ++k) {
    const size_t count = num_of_other_reading(reports, [k](const PairReport& report) {
      return std::pair(report.errors,
                       report.reading_errors.empty() ? Errors() : report.reading_errors[k]);
    });
    if (count <= most) continue;
    most = count;
    best = k;
  }
  if (most > 0 && best == 0)
    common.note("most poses that are ok fit the inverse of those of " + list +
                ": is its T_0to1 T_1to0? The errors are those against the list as it stands");
  else if (most > 0)
    common.note("most poses that are ok fit those of " + list + " if its T_0to1 are " +
                readings[best].words + ": the errors are those against the list as it stands");
  else
    note_contradictions(reports, list, common);
  for (size_t i = 0; i < systems.size(); ++i)
    if (num_of_other_reading(reports, [i](const PairReport& report) {
          return i < report.own_errors.size()
                     ? std::pair(report.own_errors[i], report.own_inverse_errors[i])
                     : std::pair(Errors(), Errors());
        }) > 0)
      common.note("most poses of " + systems[i].name + " fit the inverse of those of " + list +
                  ": are they cam0_from_cam1? The errors are those of the poses as they stand");
}

// Refuses to replace a report.json that is not of this verb: compare and colmap import write one
// too.
void require_own_report(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored) || fs::file_size(path, ignored) == 0) return;
  const Json report = Json::parse(read_file(path.string(), kMaxReportBytes), nullptr, false);
  const bool is_own = report.is_object() && report.contains("options") &&
                      report["options"].is_object() && report["options"].contains("max_keypoints");
  if (!is_own)
    throw BadInput(path.string() +
                   " is not of an earlier run of twoview evaluate: give another -o");
}

// The systems of --poses. Throws BadInput where two have one name, or one has no pair of the list.
std::vector<OwnPoses> load_systems(const Arguments& a, const std::vector<Pair>& pairs) {
  std::vector<OwnPoses> systems;
  for (const std::string& given : a.poses) {
    systems.push_back(load_own_poses(given));
    const OwnPoses& system = systems.back();
    for (size_t i = 0; i + 1 < systems.size(); ++i)
      if (systems[i].name == system.name)
        throw BadInput("--poses: two systems are called " + system.name + "; give NAME=FILE");
    const auto has = [&](const Pair& pair) {
      bool is_listed = false;
      system.of(pair.name0, pair.name1, &is_listed);
      return is_listed;
    };
    if (std::none_of(pairs.begin(), pairs.end(), has))
      throw BadInput("--poses: " + given + " has no pair of " + a.pairs);
  }
  return systems;
}

int evaluate(Arguments& a) {
  Common& common = a.common;
  if (common.options.estimate.method == TV_SOLVER_UPRIGHT)
    throw BadInput("--method upright needs gravity, which a list of pairs does not have");
  common.options.settle();
  if (a.focal_35mm > 0 && !a.camera.empty())
    throw BadInput("--focal-35mm is for photographs without a camera file");
  if (!fs::is_directory(a.images)) throw BadInput("--images: " + a.images + " is not a folder");
  std::vector<Pair> pairs = load_pairs(a.pairs);
  if (a.max_pairs > 0 && pairs.size() > static_cast<size_t>(a.max_pairs))
    pairs.resize(static_cast<size_t>(a.max_pairs));
  const Cameras cameras = load_cameras(a);
  const std::vector<OwnPoses> systems = load_systems(a, pairs);
  std::optional<MatchFolder> folder_of_matches;
  if (a.own.given()) folder_of_matches.emplace(a.own.path);

  fs::path folder;
  std::string name;
  split_output(common.output, folder, name);
  // Before the long work, so that an unwritable folder is reported at once.
  OutputSet files(folder);
  files.keep(a.pairs);
  files.keep(camera_path(a.camera));
  for (const std::string& given : a.poses) files.keep(file_of_poses(given));
  require_own_report(folder / name);
  Session session(common.options);
  std::vector<PairReport> reports;
  const std::atomic<bool>& stop = stop_flag_for_signals();
  {
    const Progress progress(!common.quiet);
    for (size_t i = 0; i < pairs.size() && !stop; ++i) {
      progress.tell(std::to_string(i + 1) + " of " + std::to_string(pairs.size()) + ": " +
                    pairs[i].name0 + " " + pairs[i].name1);
      reports.push_back(evaluate_pair(a, cameras, pairs[i],
                                      folder_of_matches ? &*folder_of_matches : nullptr, session));
      compare_own(systems, pairs[i], reports.back());
    }
  }
  const bool interrupted = reports.size() < pairs.size();
  if (reports.empty()) {
    std::fputs("twoview: interrupted before the first pair was evaluated\n", stderr);
    return kExitInterrupted;
  }
  if (interrupted)
    common.note("interrupted: the first " + std::to_string(reports.size()) + " of " +
                std::to_string(pairs.size()) + " pairs");
  const auto is_read = [](const PairReport& report) { return !report.json.contains("error"); };
  if (std::none_of(reports.begin(), reports.end(), is_read))
    throw BadInput("none of the " + std::to_string(reports.size()) + " pairs of " + a.pairs +
                   " could be evaluated: " + reports[0].json["error"].get<std::string>());
  note_readings(systems, reports, a.pairs, common);
  Json report = report_json(a, systems, reports, session);
  report["interrupted"] = interrupted;
  files.add(name, json_text(report));
  if (a.has_tables) {
    files.add("pairs.csv", pairs_csv(report));
    files.add("systems.csv", systems_csv(report));
    files.add("systems.tex", systems_tex(report));
  }
  if (common.json) print(json_text(report));
  const std::string notes = common.note_lines();
  if (common.speaks())
    print(notes + table(report) + "files      " + (files.folder() / name).string() + "\n");
  files.commit();
  return interrupted ? kExitInterrupted : 0;
}

}  // namespace

void add_evaluate(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = program.add_subcommand("evaluate", "poses of many pairs against the truth");
  verb->add_option("PAIRS", a->pairs, "SuperGlue's list of pairs; cameras.yaml beside it is read")
      ->required()
      ->type_name("FILE");
  verb->add_option("--images", a->images, "folder of the images")->required()->type_name("DIR");
  verb->add_option("--camera", a->camera,
                   "camera file of all images, in place of cameras.yaml and of the Ks in the list")
      ->type_name("FILE");
  add_scale_camera(*verb, a->scales_camera);
  add_focal_35mm(*verb, a->focal_35mm);
  verb->add_option("--max-pairs", a->max_pairs, "take the first N pairs; 0: all")
      ->check([](const std::string& count) {
        return count[0] == '-' ? count + " is negative" : std::string();
      })
      ->type_name("N");
  verb->add_option("--poses", a->poses,
                   "poses by another program, as a row of its own: name0 name1 and the rows of "
                   "[R t], a line a pair; may be given several times")
      ->type_name("[NAME=]FILE")
      ->allow_extra_args(false);
  verb->add_flag("--tables", a->has_tables,
                 "also write pairs.csv, and systems.csv and systems.tex (LaTeX)");
  add_common(*verb, a->common, kAllOptions | kEffort, "folder for report.json, or the file itself");
  a->own.add_to(*verb,
                "folder with the matches of each pair by another program, in place of twoview's: "
                "NAME0_NAME1_matches.npz and the like, or .csv",
                "DIR");
  verb->final_callback([a, &run] { run = [a] { return evaluate(*a); }; });
}

}  // namespace cli
