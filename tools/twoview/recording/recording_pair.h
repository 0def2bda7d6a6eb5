// The choice of two frames of a recording, what the IMU measured at both, and the scale in metres.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pair/result.h"
#include "pair/session.h"
#include "recording/metric_scale.h"

namespace cli {

struct RecordedFrame {
  int index = 0;        // among the decoded pictures, from 0
  uint64_t number = 0;  // the drone's own count
  double time_s = 0;    // host clock
  bool timed = false;   // on the attitudes' clock
};

struct RecordedFlight {
  FlightLog log;
  std::vector<RecordedFrame> frames;
};

// Plays the whole recording once. Throws BadInput where there is none, or no picture in it.
RecordedFlight read_flight(const std::string& folder);

// Two chosen frames, their pictures, and the reason for the choice in words.
struct RecordingPair {
  RecordedFrame frame[2];
  Picture picture[2];
  std::string why;
};

// The pictures of two indices. Throws BadInput when the recording has no such frame.
RecordingPair pair_of(const std::string& folder, const RecordedFlight& flight, int index0,
                      int index1);

// Chooses among frames with an attitude that are spread over the flight and at most 4 s apart: the
// pair with the most inliers whose verdict is ok. A pair whose median parallax is below 3 degrees
// counts for proportionally less. `camera` is of the pictures as they are; they are shrunk as
// `options` say. Throws BadInput when no two frames give a full pose.
RecordingPair choose_pair(const std::string& folder, const RecordedFlight& flight,
                          const tv_camera& camera, const CameraMount& mount, Session& session,
                          const Options& options);

// Directions of gravity in both cameras, from the attitudes at the frames' times, set in `options`
// as a prior; false, and nothing set, where an attitude is not known.
bool set_gravity(const RecordedFlight& flight, const RecordedFrame frames[2],
                 const CameraMount& mount, tv_estimate_options& options);

// result.json's "imu", or null without both attitudes.
nlohmann::ordered_json imu_json(const RecordedFlight& flight, const RecordedFrame frames[2],
                                const CameraMount& mount, const tv_two_view& two_view,
                                bool gravity_used, const std::optional<MetricScale>& scale);

// The scales by velocity, by altitude and by the floor; each is empty where it cannot be measured.
// All need a full pose.
std::vector<std::optional<MetricScale>> scales_of(const RecordedFlight& flight,
                                                  const RecordedFrame frames[2],
                                                  const CameraMount& mount, const Outcome& outcome);

}  // namespace cli
