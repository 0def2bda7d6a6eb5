#include "odometry/loop_closure.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "base/order.h"
#include "geometry/vector3.h"
#include "odometry/adjust.h"
#include "odometry/adjust_segment.h"
#include "odometry/find_points.h"
#include "odometry/fit_pose.h"
#include "odometry/keyframe.h"
#include "odometry/metric.h"
#include "odometry/spread.h"
#include "odometry/start.h"

namespace tv {
namespace {

// The path jumps where the newest keyframe's pose changes by more than this share of the path's
// length, or by more than so many radians.
constexpr double kJumpShare = 0.03, kJumpTurn = 0.05;
constexpr int32_t kLeastKeyframesBetween = 12;
constexpr int32_t kLeastMatches = 25, kLeastInliers = 50, kLeastCommon = 8;
// With fewer inliers a loop of the same segment, or between upright ones, needs another one of the
// last frames that agrees with it, and most of the matches.
constexpr int32_t kLeastWeakInliers = 24, kMostFramesBetween = 15;
constexpr double kWeakShare = 0.75, kJoinShare = 0.67;  // of the matches: in one segment, in two
constexpr double kWeakWay = 0.03, kWeakTurn = 0.015;    // median depths, radians
constexpr double kLeastWeakPath = 4;                    // median depths
// A correction larger than this, in median depths or radians, needs another loop that agrees, too.
constexpr double kGrossWay = 0.1, kGrossTurn = 0.05;

constexpr double kLargestDrift = 0.05;  // of the path, in position
constexpr double kLargestShift = 0.15;  // of the median depth, added to it
constexpr double kLargestTurn = 0.4;    // radians
// In an upright segment, where only the yaw drifts: radians, for each median depth of the above.
constexpr double kLargestYaw = 0.2;
// Cameras farther from each other, in median depths, or turned by more see nothing in common.
constexpr double kFarthestSeen = 2, kMostTurned = 1.2;
constexpr double kLeastScale = 0.6875, kLargestScale = 1.5;
constexpr int32_t kJoinSteps = 20;  // of the adjustment around the keyframe where two maps meet
// After a loop at least so many of the newest keyframes are adjusted together, and all since the
// loop before.
constexpr int32_t kLeastSpread = 100;
// Smaller corrections are not spread: median depths, radians.
constexpr double kLeastWay = 0.005, kLeastTurn = 0.005;
constexpr double kMatchRatio = 0.87;

// Whether the frame may see what a keyframe saw, if the drift is as large as it may be after a path
// of this length.
bool may_meet(const Odometry& odometry, const Frame& frame, double path, int32_t keyframe) {
  const Map& map = odometry.map;
  const MapKeyframe& other = map.keyframes[keyframe];
  if (other.segment != odometry.segment) return true;
  return are_near(frame.cam_from_world, other.cam_from_world,
                  kLargestDrift * path + kFarthestSeen * odometry.median_depth, kMostTurned);
}

// The median of the depths of the same keypoints among the old points over those among the new
// ones; 0 where too few keypoints see both.
double scale_between(Odometry* odometry, const Frame& frame, const Frame& again) {
  ArenaScope scope(odometry->scratch);
  const Map& map = odometry->map;
  double* ratios = arena_alloc<double>(odometry->scratch, static_cast<size_t>(frame.num));
  int32_t num = 0;
  for (int32_t k = 0; k < frame.num; ++k) {
    if (frame.points[k] == kNoPoint || again.points[k] == kNoPoint) continue;
    double x_new[3], x_old[3];
    transform(frame.cam_from_world, map.points[frame.points[k]].position, x_new);
    transform(again.cam_from_world, map.points[again.points[k]].position, x_old);
    if (x_new[2] > 0 && x_old[2] > 0) ratios[num++] = x_old[2] / x_new[2];
  }
  if (num < kLeastCommon) return 0;
  return median(ratios, num);
}

}  // namespace

void measure_paths(const Map& map, int32_t segment, double* lengths) {
  const MapKeyframe* next = nullptr;
  double length = 0;
  for (int32_t k = map.num_keyframes - 1; k >= 0; --k) {
    const MapKeyframe& own = map.keyframes[k];
    if (own.segment == segment) {
      if (next != nullptr) length += way_between(own.cam_from_world, next->cam_from_world);
      next = &own;
    }
    lengths[k] = length;
  }
}

bool is_jump(Odometry* odometry, const Rigid& before, int32_t keyframe) {
  ArenaScope scope(odometry->scratch);
  const Map& map = odometry->map;
  const MapKeyframe& own = map.keyframes[keyframe];
  double* paths = arena_alloc<double>(odometry->scratch, static_cast<size_t>(map.num_keyframes));
  measure_paths(map, own.segment, paths);
  return !are_near(before, own.cam_from_world, kJumpShare * paths[0], kJumpTurn);
}

bool is_plausible(const Odometry& odometry, const Frame& frame, double path, const LoopEnd& end) {
  const Map& map = odometry.map;
  if (map.keyframes[end.keyframe].segment != odometry.segment) return true;
  if (!(end.scale < kLargestScale && end.scale > kLeastScale)) return false;
  const double way = kLargestDrift * path + kLargestShift * odometry.median_depth;
  return are_near(frame.cam_from_world, end.cam_from_world, way,
                  odometry.is_upright && !odometry.is_found_again
                      ? kLargestYaw / odometry.median_depth * way
                      : kLargestTurn);
}

bool is_seen_twice(Odometry* odometry, const Frame& frame, const LoopEnd& end) {
  const WeakLoop before = odometry->weak_loop;
  odometry->weak_loop = {frame.number, frame.cam_from_world, end.cam_from_world};
  if (before.frame < 0 || frame.number - before.frame > kMostFramesBetween) return false;
  Rigid moved = motion_between(before.cam_from_world, frame.cam_from_world);
  scale_by(end.scale, moved.t);
  const Rigid expected = compose(moved, before.end_from_world);
  return are_near(expected, end.cam_from_world, kWeakWay * odometry->median_depth, kWeakTurn);
}

bool is_believed(Odometry* odometry, const Frame& frame, double path, int32_t num_inliers,
                 int32_t num_matches, const LoopEnd& end) {
  const bool within = odometry->map.keyframes[end.keyframe].segment == odometry->segment;
  const double depth = odometry->median_depth;
  const double turn = turn_between(frame.cam_from_world, end.cam_from_world);
  // Attitudes give upright segments the same axes.
  if (!within && odometry->is_upright && turn > kLargestTurn) return false;
  if (num_inliers >= kLeastInliers) {
    const double way = way_between(frame.cam_from_world, end.cam_from_world);
    if (!within || (way <= kGrossWay * depth && turn <= kGrossTurn)) return true;
  } else if (num_inliers < (within ? kWeakShare : kJoinShare) * num_matches ||
             !(within ? path >= kLeastWeakPath * depth : odometry->is_upright)) {
    return false;
  }
  return is_seen_twice(odometry, frame, end);
}

namespace {

bool meets(Odometry* odometry, const Frame& frame, double path, int32_t keyframe, Frame* again,
           LoopEnd* end) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  int32_t* points =
      arena_alloc<int32_t>(odometry->scratch, static_cast<size_t>(map.sizes.max_keypoints));
  const int32_t* seen = seen_by(map, map.keyframes[keyframe]);
  int32_t num = 0, num_known = 0;
  mark_points(&map, frame.points, frame.num);
  for (int32_t i = 0; i < map.keyframes[keyframe].num_keypoints; ++i) {
    if (seen[i] == kNoPoint) continue;
    num_known += is_marked(map, seen[i]);
    points[num++] = seen[i];
  }
  if (num < kLeastInliers || 10 * num_known > num) return false;
  again->has_pose = false;
  const int32_t num_matches = match_points(odometry, points, num, kMatchRatio, again);
  if (num_matches < kLeastMatches) return false;
  PoseFit fit;
  if (!fit_pose(odometry, 500, 4.0, again, &fit) || fit.estimate.num_inliers < kLeastMatches / 2 ||
      3 * fit.estimate.num_inliers < fit.estimate.num_matches) {
    return false;
  }
  again->has_pose = true;
  for (int round = 0; round < 2; ++round) {
    again->cam_from_world = fit.cam_from_world;
    if (!refine_pose(odometry, 3.0, again, &fit)) return false;
  }
  // The inliers that were found without the map's help decide about the loop. The points around are
  // searched in any case: old copies of points, which the frame sees as newer points, are then
  // found in no frame and are removed.
  const int32_t num_inliers = fit.estimate.num_inliers;
  const bool is_sure = fit.estimate.verdict == TV_VERDICT_OK;
  int32_t* around =
      arena_alloc<int32_t>(odometry->scratch, static_cast<size_t>(odometry->max_matched));
  const int32_t num_around = list_points(odometry, keyframe, around);
  again->cam_from_world = fit.cam_from_world;
  const PointSearch search{around, num_around, fit.cam_from_world, 5.0, true};
  find_points(odometry, search, again);
  if (num_inliers < kLeastWeakInliers || !is_sure || !refine_pose(odometry, 3.0, again, &fit)) {
    return false;
  }
  end->keyframe = keyframe;
  end->cam_from_world = fit.cam_from_world;
  end->scale = scale_between(odometry, frame, *again);
  if (!(end->scale > 0 && is_plausible(*odometry, frame, path, *end))) return false;
  return is_believed(odometry, frame, path, num_inliers, num_matches, *end);
}

// A pose of a keyframe between the one that follows from the beginning of the loop and the one that
// follows from its end; share 0 is the first, 1 the second.
MovedKeyframe blend(const Rigid& from_begin, const Rigid& from_end, double scale, double share) {
  MovedKeyframe moved;
  Rigid rotation = scaled_motion(motion_between(from_begin, from_end), share);
  for (double& t : rotation.t) t = 0;
  double a[3], b[3];
  centre_of(from_begin, a);
  centre_of(from_end, b);
  Rigid world_from_cam = inverse(compose(rotation, from_begin));
  for (int c = 0; c < 3; ++c) world_from_cam.t[c] = a[c] + share * (b[c] - a[c]);
  moved.cam_from_world = inverse(world_from_cam);
  moved.scale = exp(share * log(scale));
  return moved;
}

// The keypoints that see a new point and an old one see the old one from now on, in every keyframe.
void fuse_points(Odometry* odometry, int32_t keyframe, const Frame& again) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  const size_t room = static_cast<size_t>(map.end_points);
  int32_t* instead = arena_alloc<int32_t>(odometry->scratch, room);
  std::fill(instead, instead + room, kNoPoint);
  const int32_t* own = seen_by(map, map.keyframes[keyframe]);
  for (int32_t i = 0; i < again.num; ++i) {
    const int32_t old_point = again.points[i], point = own[i];
    if (old_point == kNoPoint || old_point == point) continue;
    if (point == kNoPoint)
      observe(&map, keyframe, i, old_point);
    else
      instead[point] = old_point;
  }
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    const int32_t* seen = seen_by(map, map.keyframes[k]);
    for (int32_t i = 0; i < map.keyframes[k].num_keypoints; ++i) {
      const int32_t point = seen[i];
      if (point == kNoPoint || instead[point] == kNoPoint) continue;
      forget_observation(&map, k, i);
      if (instead[instead[point]] == kNoPoint) observe(&map, k, i, instead[point]);
    }
  }
  clear_marks(&map);
  for (int32_t p = 0; p < map.end_points; ++p) {
    if (instead[p] != kNoPoint) mark_point(&map, p);
  }
  remove_marked_points(&map);
}

}  // namespace

bool find_loop(Odometry* odometry, const Frame& frame, int32_t count, Frame* again, LoopEnd* end) {
  const Map& map = odometry->map;
  const int32_t last = map.num_keyframes - 1 - kLeastKeyframesBetween;
  ArenaScope scope(odometry->scratch);
  double* paths = arena_alloc<double>(odometry->scratch, static_cast<size_t>(map.num_keyframes));
  measure_paths(map, odometry->segment, paths);
  bool copied = false, found = false;
  for (int32_t tried = 0, n = 0; tried < count && n < map.num_keyframes && !found; ++n) {
    if (odometry->next_loop <= 0 || odometry->next_loop > map.num_keyframes) {
      odometry->next_loop = map.num_keyframes;
    }
    const int32_t k = --odometry->next_loop;
    if (k > last && map.keyframes[k].segment == odometry->segment) continue;
    if (!may_meet(*odometry, frame, paths[k], k)) continue;
    if (!copied) copy_frame(*odometry, frame, again);
    copied = true;
    ++tried;
    found = meets(odometry, frame, paths[k], k, again, end);
  }
  return found;
}

bool close_loop(Odometry* odometry, int32_t keyframe, const Frame& again, const LoopEnd& end) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  const int32_t newest = map.num_keyframes - 1;
  const int32_t old_segment = map.keyframes[end.keyframe].segment;
  const int32_t segment = map.keyframes[keyframe].segment;
  MovedKeyframe* moved =
      arena_alloc<MovedKeyframe>(odometry->scratch, static_cast<size_t>(map.num_keyframes));
  const Rigid now = map.keyframes[keyframe].cam_from_world;
  double* paths = arena_alloc<double>(odometry->scratch, static_cast<size_t>(map.num_keyframes));
  measure_paths(map, segment, paths);
  const double whole = std::max(paths[end.keyframe], 1e-12);
  for (int32_t k = 0; k <= newest; ++k) {
    const MapKeyframe& own = map.keyframes[k];
    moved[k].scale = 0;
    if (own.segment != segment) continue;
    if (segment == old_segment && k <= end.keyframe) continue;
    // The pose by the loop's end: the way from the newest keyframe, in the old part's scale.
    Rigid relative = motion_between(now, own.cam_from_world);
    scale_by(end.scale, relative.t);
    const Rigid from_end = compose(relative, end.cam_from_world);
    const double share = segment == old_segment ? 1 - paths[k] / whole : 1;
    moved[k] = blend(own.cam_from_world, from_end, end.scale, share);
  }
  move_keyframes(&map, moved);
  for (int32_t k = 0; k <= newest; ++k) {
    if (moved[k].scale != 0) map.keyframes[k].segment = old_segment;
  }
  if (odometry->doubtful_segment == segment) odometry->doubtful_segment = old_segment;
  for (int32_t p = 0; p < map.end_points; ++p) {
    if (map.points[p].segment == segment) map.points[p].segment = old_segment;
  }
  const MetricScale own = odometry->scale;
  enter_segment(odometry, old_segment);
  if (segment != old_segment) join_scale(own, end.scale, odometry);
  gather_ways(odometry);
  fuse_points(odometry, keyframe, again);
  odometry->weak_loop.frame = -1;
  odometry->is_found_again = false;
  odometry->drift_sq = 0;
  const bool is_small =
      are_near(now, end.cam_from_world, kLeastWay * odometry->median_depth, kLeastTurn);
  if (segment == old_segment && is_small) return false;
  const Spread& before = odometry->spread;
  const bool again_here = segment == old_segment && before.segment == old_segment;
  const int32_t first_id = map.keyframes[std::max(newest + 1 - kLeastSpread, 0)].id;
  begin_spread(odometry, old_segment, again_here ? std::min(before.last_id, first_id) : 0);
  return segment == old_segment && is_jump(odometry, now, keyframe);
}

namespace {

// A keyframe as a frame. Descriptors are those of its points; keypoints that see none have zeros,
// which nothing matches.
void copy_keyframe(const Odometry& odometry, int32_t keyframe, Frame* frame) {
  const Map& map = odometry.map;
  const MapKeyframe& from = map.keyframes[keyframe];
  const MapKeypoint* own = keypoints_of(map, from);
  const int32_t* seen = seen_by(map, from);
  frame->num = from.num_keypoints;
  frame->cam_from_world = from.cam_from_world;
  for (int32_t i = 0; i < frame->num; ++i) {
    frame->keypoints[i] = tv_keypoint{own[i].x, own[i].y, own[i].size, 0, 1, 0};
    frame->sigmas[i] = static_cast<float>(sigma_of(own[i]));
    uint8_t* to = frame->descriptors + static_cast<size_t>(i) * TV_DESCRIPTOR_BYTES;
    if (seen[i] == kNoPoint)
      std::fill_n(to, TV_DESCRIPTOR_BYTES, uint8_t{0});
    else
      std::copy_n(descriptor_of(map, seen[i]), TV_DESCRIPTOR_BYTES, to);
  }
  make_grid(odometry, frame);
  std::copy_n(seen, frame->num, frame->points);
}

}  // namespace

int32_t join_segments(Odometry* odometry, int32_t first) {
  Map& map = odometry->map;
  Frame *frame = &odometry->starts[0], *again = &odometry->starts[1];
  odometry->num_starts = 0;
  int32_t num_joined = 0;
  for (int32_t k = first; k < map.num_keyframes; ++k) {
    bool is_joined = false;
    for (int32_t i = 0; i < first; ++i) {
      is_joined = is_joined || map.keyframes[i].segment == map.keyframes[k].segment;
    }
    if (is_joined || map.keyframes[k].num_observations < kLeastInliers) continue;
    copy_keyframe(*odometry, k, frame);
    enter_segment(odometry, map.keyframes[k].segment);
    for (int32_t i = 0; i < first && !is_joined; ++i) {
      LoopEnd end;
      copy_frame(*odometry, *frame, again);
      is_joined = meets(odometry, *frame, 0, i, again, &end);
      if (!is_joined) continue;
      close_loop(odometry, k, *again, end);
      adjust_around(odometry, k, kJoinSteps);
      adjust_segment(odometry, odometry->segment, 0, kSpreadSteps);
      odometry->spread.num_steps = 0;
      while (is_spreading(*odometry)) step_spread(odometry, frame);
      remove_lone_points(&map);
      ++odometry->num_loops;
      ++num_joined;
    }
  }
  enter_segment(odometry, map.num_keyframes > 0 ? map.keyframes[map.num_keyframes - 1].segment : 0);
  return num_joined;
}

}  // namespace tv
