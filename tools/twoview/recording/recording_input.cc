#include "recording/recording_input.h"

#include <CLI/App.hpp>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output.h"
#include "files/camera_formats.h"
#include "files/yaml_values.h"
#include "recording/recording_pair.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 20;
// The numbers of an optional entry; empty if the entry is missing.
std::vector<double> optional_numbers(const YAML::Node& root, const std::string& entry, size_t count,
                                     const std::string& file) {
  if (!root[entry]) return {};
  std::vector<double> numbers = numbers_at(root, entry, file);
  if (numbers.size() != count)
    throw BadInput(file + ": " + entry + " has " + std::to_string(numbers.size()) +
                   " numbers, not " + std::to_string(count));
  return numbers;
}

// The entries of a camera file; an empty map for a format without entries and without a file.
YAML::Node mount_entries(const std::string& file) {
  if (file.empty()) return YAML::Node(YAML::NodeType::Map);
  const std::string path = camera_path(file);
  const CameraFile camera = parse_camera_file(read_file(path, kMaxFileBytes), path);
  return camera.root.IsMap() ? camera.root : YAML::Node(YAML::NodeType::Map);
}

// The mount from the command line, else from the camera file, else a camera at the body's origin
// that looks forward.
CameraMount mount_of(const RecordingOptions& options, const std::string& file) {
  const YAML::Node root = mount_entries(file);
  const bool rotation_given = !options.body_from_camera.empty();
  const std::vector<double> rotation = rotation_given
                                           ? options.body_from_camera
                                           : optional_numbers(root, "body_from_camera", 9, file);
  const std::vector<double> position = !options.camera_in_body.empty()
                                           ? options.camera_in_body
                                           : optional_numbers(root, "camera_in_body", 3, file);
  CameraMount mount;
  for (const double number : position)
    if (!std::isfinite(number)) throw BadInput("--camera-in-body is not finite");
  if (!rotation.empty()) {
    std::copy(rotation.begin(), rotation.end(), mount.body_from_camera.begin());
    mount.body_from_camera =
        made_rotation(mount.body_from_camera,
                      rotation_given ? "--body-from-camera" : file + ": body_from_camera");
  }
  std::copy(position.begin(), position.end(), mount.position.begin());
  return mount;
}

}  // namespace

CameraMount load_mount(const std::string& camera_file) { return mount_of({}, camera_file); }

struct RecordingInput::State {
  RecordingOptions options;
  CameraMount mount;
  RecordedFlight flight;
  RecordingPair pair;
  bool gravity_used = false;
  std::optional<ContraryScales> contrary;
};

namespace {

nlohmann::ordered_json contradiction_json(const std::optional<ContraryScales>& contrary) {
  if (!contrary) return nullptr;
  nlohmann::ordered_json list;
  for (const MetricScale& scale : {contrary->one, contrary->other})
    list.push_back(
        {{"source", scale.source}, {"baseline_m", scale.baseline_m}, {"sigma_m", scale.sigma_m}});
  return list;
}

}  // namespace

void RecordingOptions::add_to(CLI::App& verb) {
  verb.add_option("--recording", folder,
                  "two frames of what `drone record` made, in place of A and B")
      ->type_name("DIR");
  verb.add_option("--frames", frames,
                  "which two of its decoded pictures, from 0 (without: the best pair)")
      ->expected(2)
      ->check(CLI::Range(0, 1 << 30))
      ->type_name("I J");
  verb.add_option(
          "--body-from-camera", body_from_camera,
          "rotation, row-major, of body axes (forward, right, down); default: looks forward")
      ->delimiter(',')
      ->expected(9)
      ->type_name("R11,..,R33");
  verb.add_option("--camera-in-body", camera_in_body, "where the camera is in the body, metres")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z");
}

RecordingInput::RecordingInput(const RecordingOptions& options, const std::string& camera_file)
    : state_(new State) {
  state_->options = options;
  state_->mount = mount_of(options, camera_file);
  state_->flight = read_flight(options.folder);
}

RecordingInput::~RecordingInput() = default;

int RecordingInput::width() const { return state_->flight.width; }
int RecordingInput::height() const { return state_->flight.height; }

void RecordingInput::load(const tv_camera& camera, Session& session, const Options& options,
                          const Progress& progress, Outcome& outcome) {
  State& s = *state_;
  const std::vector<int>& frames = s.options.frames;
  if (frames.empty()) {
    s.pair = choose_pair(s.options.folder, s.flight, camera, s.mount, session, options, progress);
    // Discards the times of the choice of frames, which do not belong to the pair.
    session.take_times(0, true);
  } else {
    s.pair = pair_of(s.options.folder, s.flight, frames[0], frames[1]);
  }
  for (int k = 0; k < 2; ++k) outcome.picture[k] = s.pair.picture[k];
}

void RecordingInput::add_gravity(tv_estimate_options& options) {
  if (options.gravity_sigma_rad > 0) return;
  state_->gravity_used = set_gravity(state_->flight, state_->pair.frame, state_->mount, options);
}

void RecordingInput::add_scale(Outcome& outcome) const {
  const auto found = scales_of(state_->flight, state_->pair.frame, state_->mount, outcome);
  outcome.scale = best_scale(found);
  state_->contrary = contrary_scales(found);
}

void RecordingInput::add_json(Outcome& outcome) const {
  const State& s = *state_;
  const RecordedFrame* frames = s.pair.frame;
  outcome.json["imu"] =
      imu_json(s.flight, frames, s.mount, outcome.two_view, s.gravity_used, outcome.scale);
  if (outcome.json["imu"].is_object())
    outcome.json["imu"]["scale_contradiction"] = contradiction_json(s.contrary);
  outcome.json["recording"] = {{"folder", s.options.folder},
                               {"frames", {frames[0].index, frames[1].index}},
                               {"frame_numbers", {frames[0].number, frames[1].number}},
                               {"seconds_apart", frames[1].time_s - frames[0].time_s},
                               {"chosen", s.pair.why},
                               {"body_from_camera", s.mount.body_from_camera},
                               {"camera_in_body", s.mount.position}};
}

std::string RecordingInput::words(const Outcome& outcome) const {
  const State& s = *state_;
  std::string text = summary_line(
      "frames", "%d and %d of %zu, %.2f s apart: %s", s.pair.frame[0].index, s.pair.frame[1].index,
      s.flight.frames.size(), s.pair.frame[1].time_s - s.pair.frame[0].time_s, s.pair.why.c_str());
  const nlohmann::ordered_json& imu = outcome.json["imu"];
  if (imu.is_object() && imu["sigma_deg"].is_number())
    text +=
        summary_line("imu", "turned by %.2f deg otherwise than the cameras (sigma %.2f)%s",
                     imu["rotation_difference_deg"].get<double>(), imu["sigma_deg"].get<double>(),
                     s.gravity_used ? "; its gravity was a prior" : "");
  else
    text += summary_line("imu", "%s", "its attitudes at the two instants are not known");
  if (outcome.scale)
    text += summary_line("scale", "one baseline is %.3f m (sigma %.3f), by %s",
                         outcome.scale->baseline_m, outcome.scale->sigma_m,
                         outcome.scale->source.c_str());
  else if (s.contrary)
    text += summary_line("scale",
                         "unknown: one baseline is %.3f m (sigma %.3f) by %s, and %.3f m (%.3f) by "
                         "%s, which contradict each other",
                         s.contrary->one.baseline_m, s.contrary->one.sigma_m,
                         s.contrary->one.source.c_str(), s.contrary->other.baseline_m,
                         s.contrary->other.sigma_m, s.contrary->other.source.c_str());
  else
    text += summary_line("scale", "%s",
                         "unknown: neither velocity, altitude nor a floor tells it here");
  return text;
}

}  // namespace cli
