#include "odometry/find_frame.h"

#include <algorithm>

#include "odometry/find_points.h"
#include "odometry/fit_pose.h"
#include "odometry/gyro.h"
#include "odometry/keyframe.h"
#include "odometry/metric.h"
#include "odometry/start.h"

namespace tv {
namespace {

constexpr int32_t kLeastInliers = 20, kLeastRelocated = 30;
constexpr int32_t kSearchedKeyframes = 6;  // in which a lost frame is looked for, a frame

// Finds the frame's pose from points that are looked for near where the predicted pose puts them.
bool track_points(Odometry* odometry, const int32_t* points, int32_t num, const Rigid& predicted,
                  double radius_px, Frame* frame, PoseFit* fit) {
  const PointSearch search{points, num, predicted, radius_px, true};
  forget_points(frame);
  frame->cam_from_world = predicted;
  frame->has_pose = true;
  if (find_points(odometry, search, frame) < kLeastInliers) return false;
  if (!search_pose(odometry, 100, 4.0, frame, fit)) return false;
  if (fit->estimate.num_inliers < kLeastInliers) return false;
  frame->cam_from_world = fit->cam_from_world;
  return true;
}

// From a pose that is known to a few pixels: looks for all local points again, within 5 pixels of
// where they must appear, and fits the pose anew. `counts`: whether num_visible of the points
// within the picture is raised (num_found is raised later, for those that the frame keeps). False
// where the pose does not hold.
bool refine_track(Odometry* odometry, bool counts, Frame* frame, PoseFit* fit) {
  const PointSearch search{odometry->local_points, odometry->num_local_points, fit->cam_from_world,
                           5.0, counts};
  find_points(odometry, search, frame);
  frame->cam_from_world = fit->cam_from_world;
  if (!refine_pose(odometry, 3.0, frame, fit)) return false;
  frame->cam_from_world = fit->cam_from_world;
  return fit->estimate.num_inliers >= kLeastInliers;
}

bool match_and_fit(Odometry* odometry, const int32_t* points, int32_t num, Frame* frame,
                   PoseFit* fit) {
  frame->has_pose = false;
  if (match_points(odometry, points, num, 0.9, frame) < kLeastInliers) return false;
  if (!fit_pose(odometry, 1000, 4.0, frame, fit)) return false;
  if (fit->estimate.num_inliers < kLeastInliers ||
      4 * fit->estimate.num_inliers < fit->estimate.num_matches) {
    return false;
  }
  frame->cam_from_world = fit->cam_from_world;
  frame->has_pose = true;
  return true;
}

// Looks for the local points around the predicted pose, and then anywhere in the picture.
// wider_px: what is added to the radius within which a point is looked for.
bool follow_points(Odometry* odometry, const Rigid& predicted, double wider_px, Frame* frame,
                   PoseFit* fit) {
  const int32_t* points = odometry->local_points;
  const int32_t num = odometry->num_local_points;
  return (track_points(odometry, points, num, predicted, 15.0 + wider_px, frame, fit) ||
          track_points(odometry, points, num, predicted, 40.0 + wider_px, frame, fit) ||
          match_and_fit(odometry, points, num, frame, fit)) &&
         refine_track(odometry, true, frame, fit);
}

// Three standard deviations of the held turn, in pixels.
double held_px(const Odometry& odometry) {
  return 3 * held_sigma(odometry.gyro) * odometry.camera.model.fx;
}

bool is_sure(const PoseFit& fit) {
  return fit.estimate.num_inliers >= kLeastRelocated && fit.estimate.verdict == TV_VERDICT_OK;
}

// Whether a pose that was found without that of the frame before can be believed.
bool is_found(const Odometry& odometry, int32_t keyframe, const Frame& frame, const PoseFit& fit) {
  if (!is_sure(fit)) return false;
  return odometry.map.keyframes[keyframe].segment != odometry.segment ||
         (agrees_with_held(odometry.gyro, frame.cam_from_world) && is_reachable(odometry, frame));
}

// The segment's keyframe that looks most nearly as the held pose does; -1: none.
int32_t nearest_to_held(const Odometry& odometry) {
  int32_t nearest = -1;
  double least = 0;
  for (int32_t k = 0; k < odometry.map.num_keyframes; ++k) {
    const MapKeyframe& keyframe = odometry.map.keyframes[k];
    if (keyframe.segment != odometry.segment) continue;
    const Rigid& held = odometry.gyro.cam_from_world;
    const double distance = turn_between(held, keyframe.cam_from_world) +
                            way_between(held, keyframe.cam_from_world) / odometry.median_depth;
    if (nearest >= 0 && distance >= least) continue;
    nearest = k;
    least = distance;
  }
  return nearest;
}

// Looks for the points where the pose that the gyro has held sees them.
bool follow_held(Odometry* odometry, Frame* frame, PoseFit* fit) {
  const int32_t k = nearest_to_held(*odometry);
  if (k < 0) return false;
  list_local_points(odometry, k);
  if (!follow_points(odometry, odometry->gyro.cam_from_world, held_px(*odometry), frame, fit) ||
      !is_found(*odometry, k, *frame, *fit))
    return false;
  odometry->reference_id = odometry->map.keyframes[k].id;
  return true;
}

}  // namespace

bool follow_map(Odometry* odometry, bool has_gap, Frame* frame, PoseFit* fit) {
  const Frame& previous = odometry->previous;
  Rigid predicted = previous.cam_from_world;
  double wider_px = 0;
  if (odometry->gyro.is_held) {
    predicted = odometry->gyro.cam_from_world;
    wider_px = held_px(*odometry);
  } else if (odometry->has_motion && !has_gap) {
    const double factor =
        odometry->motion_s > 0 ? (frame->time_s - previous.time_s) / odometry->motion_s : 1;
    predicted =
        compose(scaled_motion(odometry->motion, std::min(factor, 3.0)), previous.cam_from_world);
  }
  if (!follow_points(odometry, predicted, wider_px, frame, fit)) return false;
  if (!odometry->gyro.is_held) return true;
  return odometry->tracking.state == TrackingState::kTracked
             ? agrees_with_held(odometry->gyro, frame->cam_from_world)
             : is_found(*odometry, find_keyframe(odometry->map, odometry->reference_id), *frame,
                        *fit);
}

bool find_in_keyframes(Odometry* odometry, int32_t from, int32_t count, bool is_locating,
                       Frame* frame, PoseFit* fit) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  int32_t* points =
      arena_alloc<int32_t>(odometry->scratch, static_cast<size_t>(map.sizes.max_keypoints));
  for (int32_t n = 0; n < count && n < map.num_keyframes; ++n) {
    const int32_t k = (from + map.num_keyframes - n) % map.num_keyframes;
    const int32_t* seen = seen_by(map, map.keyframes[k]);
    int32_t num = 0;
    for (int32_t i = 0; i < map.keyframes[k].num_keypoints; ++i) {
      if (seen[i] != kNoPoint) points[num++] = seen[i];
    }
    if (!match_and_fit(odometry, points, num, frame, fit)) continue;
    list_local_points(odometry, k);
    if (!refine_track(odometry, !is_locating, frame, fit)) continue;
    if (is_locating ? !is_sure(*fit) : !is_found(*odometry, k, *frame, *fit)) continue;
    odometry->reference_id = map.keyframes[k].id;
    return true;
  }
  return false;
}

bool search_map(Odometry* odometry, bool is_first, Frame* frame, PoseFit* fit) {
  const Map& map = odometry->map;
  if (odometry->gyro.is_held && follow_held(odometry, frame, fit)) return true;
  if (is_first) odometry->next_search = map.num_keyframes - 1;
  if (find_in_keyframes(odometry, odometry->next_search, kSearchedKeyframes, false, frame, fit)) {
    const int32_t segment = map.keyframes[find_keyframe(map, odometry->reference_id)].segment;
    if (segment != odometry->segment) odometry->check = MapCheck{};
    enter_segment(odometry, segment);
    return true;
  }
  odometry->next_search = odometry->next_search >= kSearchedKeyframes
                              ? odometry->next_search - kSearchedKeyframes
                              : map.num_keyframes - 1;
  return false;
}

bool follow_turn(Odometry* odometry, Frame* frame) {
  Rigid turn = kIdentity;
  if (odometry->gyro.is_held) {
    std::copy_n(motion_between(odometry->previous.cam_from_world, odometry->gyro.cam_from_world).R,
                9, turn.R);
  } else if (!estimate_turn(odometry, odometry->previous, *frame, &turn)) {
    return false;
  }
  // The camera's centre stays: cam_from_world is the turn after that of the frame before.
  frame->cam_from_world = orthonormalised(compose(turn, odometry->previous.cam_from_world));
  forget_points(frame);  // those of a pose that was refused
  return true;
}

}  // namespace tv
