// The input of `reconstruct --recording`: its options, and two frames of a flight in place of two
// image files, with the attitudes at both frames and the scale in metres. A program that is built
// without the driver contains recording_none.cc instead of recording_input.cc.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/cli_fwd.h"
#include "base/terminal.h"
#include "pair/result.h"
#include "pair/session.h"
#include "recording/metric_scale.h"

namespace cli {

struct RecordingOptions {
  std::string folder;
  std::vector<int> frames;  // indices of two pictures; empty: the pair is chosen
  std::vector<double> body_from_camera, camera_in_body;  // 9 and 3 numbers; empty: not given

  // Adds the options to a verb; adds nothing in a program without the driver.
  void add_to(CLI::App& verb);
  bool given() const { return !folder.empty(); }
};

// The mount of the camera that a camera file describes, else a camera at the body's origin that
// looks forward. Throws BadInput. Only in a program with the driver.
CameraMount load_mount(const std::string& camera_file);

class RecordingInput {
 public:
  // Reads the flight and the mount of the camera: from the options, else from the camera file's
  // body_from_camera and camera_in_body. camera_file may be empty. Throws BadInput.
  RecordingInput(const RecordingOptions& options, const std::string& camera_file);
  ~RecordingInput();

  // The size of the recording's pictures, which does not change during a flight.
  int width() const;
  int height() const;
  // Puts the two pictures, not resized, into outcome.picture; chooses them if the options name
  // none. `camera` is the camera of these pictures.
  void load(const tv_camera& camera, Session& session, const Options& options,
            const Progress& progress, Outcome& outcome);
  // Sets the gravity at both frames as a prior. Does nothing if the caller already gave one, or if
  // an attitude is unknown.
  void add_gravity(tv_estimate_options& options);
  // Sets outcome.scale if the measurements of the flight determine it. Call it before result_json.
  void add_scale(Outcome& outcome) const;
  // Adds the entries "imu" and "recording" to the member `json` of outcome.
  void add_json(Outcome& outcome) const;
  // The lines on the recording in the summary that is printed for the user.
  std::string words(const Outcome& outcome) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
