// The files of `twoview odometry`: trajectories, tables, the cloud, COLMAP's text model, and
// result.json.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "odometry/accuracy.h"
#include "odometry/flight.h"

namespace cli {

// A segment, -1 for none, and whether its unit is the metre.
struct LiveStretch {
  int32_t segment = -1;
  bool is_metric = false;
};

// What the outputs are made from.
struct FlightResult {
  const Flight* flight = nullptr;
  int num_source_frames = 0;  // that the run was to track: after --every and --max-frames
  std::vector<FlightKeyframe> keyframes;
  std::vector<tv_map_point> points;
  std::vector<Rgb> colours;  // of these points
  // The segment that the most frames have their final pose in, -1 without any pose.
  int32_t segment = -1;
  // The segment and unit that the most frames had when they were tracked: poses from before the
  // metre was known do not compare with later ones.
  LiveStretch live_stretch;
  bool has_truth = false;
  Trajectory truth;
  // A note on the times of the truth, empty where nothing was odd, and all notes on it.
  std::string truth_note;
  std::vector<std::string> truth_notes;
  Accuracy accuracy, live_accuracy;  // of the segment, and of that stretch
  nlohmann::ordered_json json;
};

// Collects the map, chooses the segments, and compares them with the truth.
// film_start_s: what a film's own clock says at time 0, which the truth's times may be of.
FlightResult result_of(const Flight& flight, const std::optional<TruePoses>& truth,
                       double film_start_s, int num_source_frames);

// world_from_cam of a keyframe.
Pose pose_of(const tv_keyframe& keyframe);

// The frames of one segment with their final poses, and those of a stretch as they were known when
// tracked.
Trajectory trajectory_of(const Flight& flight, int32_t segment);
Trajectory live_trajectory_of(const Flight& flight, const LiveStretch& stretch);

// The content of result.json but for `options`, `seed`, `version` and `kernels`.
nlohmann::ordered_json flight_json(const FlightResult& result);

// trajectory.txt, or with `live` live.txt. A comment says where a segment begins.
std::string trajectory_text(const Flight& flight, bool live);
std::string keyframes_text(const FlightResult& result);
// The text of covariances.txt: for each keyframe the covariance of its pose relative to the
// keyframe before, where it is known. Empty where none is known.
std::string covariances_text(const std::vector<FlightKeyframe>& keyframes);
std::string frames_csv(const Flight& flight);
// The words for a frame's reasons: those of the verdict, "unreadable" or "repeated".
std::string reasons_text(const FlightFrame& frame);
// The names of a frame's tv_map_reason bits, in lower case.
std::string map_reasons_text(const FlightFrame& frame);
// The indices of the points of the cloud: those that two keyframes see at an angle of at least 1.5
// degrees. Below that their distance is a guess.
std::vector<size_t> cloud_points(const std::vector<tv_map_point>& points,
                                 const std::vector<FlightKeyframe>& keyframes);
// x y z, colour, number of observations, standard deviation of the position and segment of the
// points of the cloud.
std::string map_ply(const std::vector<tv_map_point>& points, const std::vector<Rgb>& colours,
                    const std::vector<FlightKeyframe>& keyframes);

// COLMAP's model of one segment as text: cameras.txt, images.txt, points3D.txt.
struct ColmapModel {
  std::string cameras, images, points;
};

// Pictures that were made of the frames of some keyframes, and the camera that they are of.
struct ColmapPictures {
  tv_camera camera{};
  std::map<int32_t, std::string> names;  // by the keyframe's id
};

// The longest segment: of the frames as they were tracked, under the source's names, or of pictures
// that were made of them, with what lies in these.
ColmapModel colmap_model(const FlightResult& result, const ColmapPictures* pictures = nullptr);

}  // namespace cli
