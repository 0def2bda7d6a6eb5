// What is known of a frame of a flight.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "odometry/poses.h"
#include "twoview/odometry.h"
#include "twoview/path.h"

namespace cli {

// What a frame's final pose comes from.
enum class PoseOrigin { kNone, kTracked, kLocated };

// What is kept of each frame.
struct FlightFrame {
  int index = 0;  // among the source's frames
  std::string name;
  double time_s = 0;
  int32_t status = TV_ODOMETRY_STARTING;
  uint32_t reasons = 0;
  uint32_t map_reasons = 0;
  bool unreadable = false;
  bool withheld = false;     // not given to the tracker: its picture is the one before again
  bool is_repeated = false;  // by what came later, the camera moved on meanwhile: it has no pose
  bool is_keyframe = false, relocated = false, loop_closed = false;
  bool attitude_ignored = false;
  std::optional<Matrix3> attitude;  // world_from_cam of a world whose z axis points down
  int32_t num_keypoints = 0, num_matches = 0, num_inliers = 0;
  double time_ms = 0;  // CPU time of tv_odometry_track
  // As known when the frame was tracked; segment -1: no pose.
  int32_t live_segment = -1;
  bool live_metric = false;  // whether the map's unit was the metre then
  double live_scale_sigma = 0;
  Pose live;
  // The frame's record, from which tv_path_poses gives its pose in any later state of the map;
  // number -1: the frame was not given to the tracker.
  tv_path_frame known{0, -1, TV_PATH_UNKNOWN, -1, 0, {}, {}};
  // The pose in the last state of the map, and how it was found; segment -1: none.
  PoseOrigin origin = PoseOrigin::kNone;
  int32_t segment = -1;
  Pose pose;
};

}  // namespace cli
