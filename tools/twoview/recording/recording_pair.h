// Chooses two frames of a recording, and gives the IMU's measurements at both and the scale in
// metres.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/terminal.h"
#include "pair/result.h"
#include "pair/session.h"
#include "recording/metric_scale.h"

namespace cli {

struct RecordedFrame {
  int index = 0;        // index among the decoded pictures, from 0
  uint64_t number = 0;  // the drone's own frame number
  double time_s = 0;    // time of the picture on the host's clock, seconds
  bool timed = false;   // false: no attitude came less than 0.25 s before it
};

struct RecordedFlight {
  FlightLog log;
  std::vector<RecordedFrame> frames;
  int width = 0, height = 0;  // of the first picture
};

// Plays the whole recording once. Throws BadInput where there is none, or no picture in it decodes.
RecordedFlight read_flight(const std::string& folder);

// Two chosen frames with their pictures, and the reason for the choice in words.
struct RecordingPair {
  RecordedFrame frame[2];
  Picture picture[2];
  std::string why;
};

// The pictures with these two indices. Throws BadInput if the recording has no such frame.
RecordingPair pair_of(const std::string& folder, const RecordedFlight& flight, int index0,
                      int index1);

// Chooses the two frames among at most 24, spread evenly over the frames in which the drone moved;
// over all with a known attitude if fewer than two moved; over all frames if fewer than two have an
// attitude. Every two of them that are at most 4 s apart are reconstructed. The pair with the most
// inliers among those with a full pose and the verdict "ok" is chosen; the count of a pair with a
// median parallax below 3 degrees is reduced in proportion. `camera` is that of the pictures before
// resizing; they are resized as `options` say. Throws BadInput if no pair has a full pose and the
// verdict "ok".
RecordingPair choose_pair(const std::string& folder, const RecordedFlight& flight,
                          const tv_camera& camera, const CameraMount& mount, Session& session,
                          const Options& options, const Progress& progress);

// Sets the directions of gravity in both cameras, from the attitudes at the frames' times, as a
// prior in `options`. Returns false and sets nothing if an attitude is unknown.
bool set_gravity(const RecordedFlight& flight, const RecordedFrame frames[2],
                 const CameraMount& mount, tv_estimate_options& options);

// The entry "imu" of result.json; null unless both attitudes are known, belong to one run of the
// drone, and the result has a rotation.
nlohmann::ordered_json imu_json(const RecordedFlight& flight, const RecordedFrame frames[2],
                                const CameraMount& mount, const tv_two_view& two_view,
                                bool gravity_used, const std::optional<MetricScale>& scale);

// The scales by velocity, by altitude and by the floor; each is empty if it cannot be measured. The
// list is empty without a full pose or without the attitude at the first frame.
std::vector<std::optional<MetricScale>> scales_of(const RecordedFlight& flight,
                                                  const RecordedFrame frames[2],
                                                  const CameraMount& mount, const Outcome& outcome);

}  // namespace cli
