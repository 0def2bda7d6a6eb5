// The input of `reconstruct --recording`: its options, and two frames of a flight in place of two
// image files, with the attitudes at both and the scale in metres.
// A program built without the driver has recording_none.cc in place of recording_input.cc.
#pragma once

#include <CLI/App.hpp>
#include <memory>
#include <string>
#include <vector>

#include "pair/result.h"
#include "pair/session.h"

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

  // Puts the pictures of the pair, not resized, into outcome.picture. `camera` is their camera.
  void load(const tv_camera& camera, Session& session, const Options& options, Outcome& outcome);
  // Sets gravity at both instants as a prior, unless the caller gave one.
  void add_gravity(tv_estimate_options& options);
  // Sets outcome.scale where the flight's measurements give it. Call before result_json.
  void add_scale(Outcome& outcome) const;
  // Adds "imu" and "recording" to outcome.json.
  void add_json(Outcome& outcome) const;
  // Lines of the summary for people.
  std::string words(const Outcome& outcome) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
