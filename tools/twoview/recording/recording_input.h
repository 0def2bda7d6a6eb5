// The options of `reconstruct --recording`, and what they bring: two frames of a flight in place of
// two image files, the attitudes beside them, and metres.
// A program built without the driver has recording_none.cc in place of recording_input.cc.
#pragma once

#include <CLI/App.hpp>
#include <memory>
#include <string>
#include <vector>

#include "result.h"
#include "session.h"

namespace cli {

struct RecordingOptions {
  std::string folder;
  std::vector<int> frames;                               // two indices, or none
  std::vector<double> body_from_camera, camera_in_body;  // 9 and 3 numbers, or none

  // Nothing in a program without the driver.
  void add_to(CLI::App& verb);
  bool given() const { return !folder.empty(); }
};

class RecordingInput {
 public:
  // Reads the flight and the mount (the camera file's body_from_camera and camera_in_body where the
  // options have none). Throws BadInput.
  RecordingInput(const RecordingOptions& options, const std::string& camera_file);
  ~RecordingInput();

  // The pictures of the pair, whole, into outcome.picture. `camera` is theirs.
  void load(const tv_camera& camera, Session& session, const Options& options, Outcome& outcome);
  // Gravity at both instants as a prior, unless the caller gave one.
  void add_gravity(tv_estimate_options& options);
  // Metres, where the flight can tell them. Before result_json.
  void add_scale(Outcome& outcome) const;
  // "imu" and "recording" of result.json.
  void add_json(Outcome& outcome) const;
  // Lines for people.
  std::string words(const Outcome& outcome) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
