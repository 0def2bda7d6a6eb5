#include "odometry/path.h"

#include <algorithm>
#include <cmath>

#include "geometry/vector3.h"

namespace tv {
namespace {

// How many times the largest speed between two tracked frames a camera may have flown at where it
// could not be followed.
constexpr double kMostSpeeds = 2;

tv_path_pose pose_at(const Map& map, int32_t keyframe, const Rigid& world_from_cam,
                     int32_t origin) {
  tv_path_pose pose{};
  pose.origin = origin;
  pose.segment = map.keyframes[keyframe].segment;
  write_rigid(world_from_cam, pose.world_from_cam_R, pose.world_from_cam_t);
  return pose;
}

// The nearest tracked frame of a segment from number idx on, step by step; unknown if there is
// none.
tv_path_pose nearest_tracked(const Map& map, const tv_path_frame* frames, int32_t num_frames,
                             int32_t idx, int32_t step, int32_t segment, double* time_s) {
  for (int32_t n = idx + step; n >= 0 && n < num_frames; n += step) {
    const tv_path_pose pose = path_pose(map, frames[n]);
    if (pose.origin != TV_PATH_TRACKED || pose.segment != segment) continue;
    *time_s = frames[n].time_s;
    return pose;
  }
  return tv_path_pose{};
}

// The largest speed between two tracked frames of a segment that follow each other; 0 without any.
double largest_speed(const Map& map, const tv_path_frame* frames, int32_t num_frames,
                     int32_t segment) {
  double largest = 0;
  tv_path_pose before{};
  for (int32_t n = 0; n < num_frames; ++n) {
    const tv_path_pose pose = path_pose(map, frames[n]);
    const bool follows = n > 0 && frames[n].frame == frames[n - 1].frame + 1 &&
                         pose.origin == TV_PATH_TRACKED && before.origin == TV_PATH_TRACKED &&
                         pose.segment == segment && before.segment == segment;
    const double seconds = follows ? std::fabs(frames[n].time_s - frames[n - 1].time_s) : 0;
    if (seconds > 0) {
      const double way = distance_between(before.world_from_cam_t, pose.world_from_cam_t);
      largest = std::max(largest, way / seconds);
    }
    before = pose;
  }
  return largest;
}

}  // namespace

bool is_in_order(const tv_path_frame* frames, int32_t num_frames) {
  for (int32_t n = 1; n < num_frames; ++n) {
    if (frames[n].frame <= frames[n - 1].frame) return false;
  }
  return true;
}

tv_path_pose path_pose(const Map& map, const tv_path_frame& frame) {
  if (frame.origin != TV_PATH_UNKNOWN) {
    Rigid pose = rigid_of(frame.reference_from_cam_R, frame.reference_from_cam_t);
    const int32_t k = pose_in_world(map, frame.reference_id, &pose);
    if (k >= 0) return pose_at(map, k, pose, frame.origin);
  } else {
    // The first keyframe of a segment became one only when a later frame completed the start.
    const MapKeyframe *begin = map.keyframes, *end = begin + map.num_keyframes;
    const MapKeyframe* own =
        std::lower_bound(begin, end, frame.frame,
                         [](const MapKeyframe& k, int32_t number) { return k.frame < number; });
    if (own != end && own->frame == frame.frame) {
      return pose_at(map, static_cast<int32_t>(own - begin), inverse(own->cam_from_world),
                     TV_PATH_TRACKED);
    }
  }
  tv_path_pose unknown{};
  unknown.segment = -1;
  return unknown;
}

bool can_have_flown(const Map& map, const tv_path_frame* frames, int32_t num_frames, int32_t idx,
                    const tv_path_pose& pose) {
  const double speed = largest_speed(map, frames, num_frames, pose.segment);
  if (!(speed > 0)) return true;  // nothing is known of how fast it flies
  for (const int32_t step : {-1, 1}) {
    double time_s = 0;
    const tv_path_pose other =
        nearest_tracked(map, frames, num_frames, idx, step, pose.segment, &time_s);
    if (other.origin == TV_PATH_UNKNOWN) continue;
    const double way = distance_between(other.world_from_cam_t, pose.world_from_cam_t);
    if (way > kMostSpeeds * speed * std::fabs(frames[idx].time_s - time_s)) return false;
  }
  return true;
}

}  // namespace tv
