#include "odometry/track.h"

#include <algorithm>
#include <cmath>

#include "base/order.h"
#include "geometry/vector3.h"
#include "odometry/adjust.h"
#include "odometry/calibration.h"
#include "odometry/fit_pose.h"
#include "odometry/keyframe.h"
#include "odometry/loop.h"
#include "odometry/map_check.h"
#include "odometry/metric.h"
#include "odometry/search.h"
#include "odometry/start.h"
#include "odometry/still.h"

namespace tv {
namespace {

constexpr int32_t kLeastInliers = 20, kLeastRelocated = 30;
constexpr int32_t kSearchedKeyframes = 6;  // in which a lost frame is looked for, a frame
// A frame becomes a keyframe when the camera moved by kFarMoved median depths or turned by
// kFarTurned radians since the last one, and earlier where few of its points are left.
constexpr double kFarMoved = 0.10, kFarTurned = 0.25, kLeastMoved = 0.02, kLeastTurned = 0.08;
constexpr int32_t kFewInliers = 100;
constexpr int32_t kWindowSteps = 4;        // of the adjustment after a keyframe
constexpr int32_t kLoopSteps = 8;          // and after a loop
constexpr int32_t kLoopKeyframes = 2;      // that are searched for a loop at each frame
constexpr int32_t kMostTurnedFrames = 60;  // of status rotation, in a row
constexpr int32_t kLostBeforeStart = 8;    // frames without a pose before a new segment
// Frames are weak while the keyframes' attitudes are so uncertain together, in radians.
constexpr double kMostDrift = 0.026;
// Velocities are believed against the map once so many of its ways agreed with them. The map is
// wrong where so many frames in a row contradict velocities that are believed.
constexpr int32_t kLeastTrust = 5, kMostContrary = 5;
constexpr double kLongestGap = 0.25;  // seconds: over a longer one velocities say no way

int32_t nearest_pixel(float x, int32_t size) {
  return std::min(std::max(static_cast<int32_t>(x + 0.5f), 0), size - 1);
}

uint8_t grey_at(const tv_image& image, const tv_keypoint& keypoint) {
  const int64_t x = nearest_pixel(keypoint.x, image.width);
  const int64_t y = nearest_pixel(keypoint.y, image.height);
  return image.data[y * image.stride_bytes + x];
}

// mask: null, or of the image's size.
void extract_frame(Odometry* odometry, const tv_image& image, const tv_image* mask, Frame* frame) {
  ArenaScope scope(odometry->scratch);
  tv_image used{};
  if (odometry->still_until > odometry->num_frames) {
    const size_t num_pixels = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
    uint8_t* pixels = arena_alloc<uint8_t>(odometry->scratch, num_pixels);
    write_mask(*odometry, mask, pixels);
    used = tv_image{pixels, image.width, image.height, image.width};
    mask = &used;
  }
  frame->num = 0;
  tv_extract(odometry->context, &image, mask, &odometry->features, frame->keypoints,
             frame->descriptors, odometry->options.max_keypoints, &frame->num);
  tv_keypoint_sigmas(frame->keypoints, frame->num, odometry->features.keypoint_size, 1.0,
                     frame->sigmas);
  for (int32_t k = 0; k < frame->num; ++k) frame->greys[k] = grey_at(image, frame->keypoints[k]);
  make_grid(*odometry, frame);
  frame->has_pose = false;
}

// The pose from the points that are looked for around a predicted pose.
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

// The pose is known to a few pixels: looks for all points once more, near where they must be, and
// counts them as looked for if `counts`.
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

void measure_depth(Odometry* odometry, const Frame& frame) {
  ArenaScope scope(odometry->scratch);
  double* depths = arena_alloc<double>(odometry->scratch, static_cast<size_t>(frame.num));
  int32_t num = 0;
  for (int32_t k = 0; k < frame.num; ++k) {
    if (frame.points[k] == kNoPoint) continue;
    double x[3];
    transform(frame.cam_from_world, odometry->map.points[frame.points[k]].position, x);
    depths[num++] = x[2];
  }
  if (num == 0) return;
  odometry->median_depth = median(depths, num);
}

void count_found(Odometry* odometry, const Frame& frame) {
  for (int32_t k = 0; k < frame.num; ++k) {
    if (frame.points[k] != kNoPoint) ++odometry->map.points[frame.points[k]].num_found;
  }
}

bool needs_keyframe(const Odometry& odometry, const Frame& frame, int32_t num_inliers) {
  const Map& map = odometry.map;
  const MapKeyframe& last = map.keyframes[newest_of(map, odometry.segment, map.num_keyframes)];
  if (frame.number == last.frame) return false;
  const double moved =
      way_between(last.cam_from_world, frame.cam_from_world) / odometry.median_depth;
  const double turned = turn_between(last.cam_from_world, frame.cam_from_world);
  const bool few = 10 * num_inliers < 6 * odometry.keyframe_inliers || num_inliers < kFewInliers;
  return moved > kFarMoved || turned > kFarTurned ||
         (few && (moved > kLeastMoved || turned > kLeastTurned));
}

// The frame's pose and points are those of the keyframe that was made of it.
void take_keyframe(const Odometry& odometry, int32_t idx, Frame* frame) {
  const MapKeyframe& keyframe = odometry.map.keyframes[idx];
  frame->cam_from_world = keyframe.cam_from_world;
  std::copy_n(seen_by(odometry.map, keyframe), frame->num, frame->points);
}

// The reasons of a frame that those against the map stand for.
uint32_t reasons_of(uint32_t map_reasons) {
  constexpr uint32_t kParallax =
      TV_MAP_REASON_UNCONFIRMED | TV_MAP_REASON_JUMPED | TV_MAP_REASON_UNSURE_ATTITUDE;
  constexpr uint32_t kPlanar = TV_MAP_REASON_CONTRADICTED | TV_MAP_REASON_ONE_PLANE;
  uint32_t reasons = 0;
  if ((map_reasons & kParallax) != 0) reasons |= TV_REASON_LOW_PARALLAX;
  if ((map_reasons & kPlanar) != 0) reasons |= TV_REASON_TWO_PLANAR_SOLUTIONS;
  if ((map_reasons & TV_MAP_REASON_VELOCITIES_DISAGREE) != 0) reasons |= TV_REASON_SECOND_MOTION;
  return reasons;
}

// The segment's frames have this reason until one of its keyframes is confirmed.
void doubt(Odometry* odometry, tv_map_reason reason) {
  odometry->doubts = reason;
  odometry->doubtful_segment = odometry->segment;
}

void add_doubts(const Odometry& odometry, tv_odometry_state* state) {
  if (odometry.doubtful_segment == odometry.segment) state->map_reasons |= odometry.doubts;
}

// Removes the segment's keyframes that were made since the last confirmed one, and what only they
// saw. Frames are doubtful until one is confirmed. Of a segment that is removed as a whole nothing
// is left but its number, until the frame is found in another one or begins another.
void remove_unconfirmed(Odometry* odometry) {
  Map& map = odometry->map;
  int32_t last = newest_of(map, odometry->segment, map.num_keyframes);
  while (last >= 0 && map.keyframes[last].id > odometry->confirmed_id) {
    const int32_t before = newest_of(map, odometry->segment, last);
    remove_keyframe(&map, last, before);
    last = before;
  }
  remove_lone_points(&map);
  gather_ways(odometry);  // what was wrong says nothing of the scale
  doubt(odometry, TV_MAP_REASON_CONTRADICTED);
  odometry->reference_id = last >= 0 ? map.keyframes[last].id : -1;
}

// Compares the map's way with that of the velocities. False: the map is wrong here, and what was
// made since the last confirmed keyframe is removed, and all of a segment that was never in metres.
bool heed_velocities(Odometry* odometry, const Frame& frame, uint32_t* map_reasons) {
  if (!is_contrary(*odometry, frame)) {
    odometry->num_contrary = 0;
    return true;
  }
  *map_reasons |= TV_MAP_REASON_VELOCITIES_DISAGREE;
  odometry->travel.is_contrary = true;
  if (odometry->velocity_trust < kLeastTrust || ++odometry->num_contrary < kMostContrary)
    return true;
  odometry->velocity_trust -= odometry->velocity_trust / 4;
  if (!odometry->scale.was_known && !odometry->scale.is_contradicted) odometry->confirmed_id = -1;
  remove_unconfirmed(odometry);
  return false;
}

// What the pairs of the newest keyframe say of the map. False: it is wrong here, and what was made
// since the last confirmed keyframe is removed.
bool heed_check(Odometry* odometry) {
  const MapVerdict verdict = verdict_of(odometry->check.vote);
  if (verdict == MapVerdict::kAgrees && odometry->num_contrary == 0) {
    odometry->confirmed_id = odometry->check.keyframe_id;
    measure_reach(*odometry, odometry->frame, &odometry->confirmed);
    if (odometry->doubtful_segment == odometry->segment) odometry->doubts = 0;
  } else if (verdict == MapVerdict::kContradicts) {
    remove_unconfirmed(odometry);
  } else if (verdict == MapVerdict::kOnePlane && !is_checking(odometry->check)) {
    doubt(odometry, TV_MAP_REASON_ONE_PLANE);
  } else if (is_unconfirmed(odometry->check)) {
    doubt(odometry, TV_MAP_REASON_UNCONFIRMED);
  }
  return verdict != MapVerdict::kContradicts;
}

// The frame becomes a keyframe, and closes a loop where there is one. False: the map is wrong
// here, and the frame is no keyframe.
bool add_frame_as_keyframe(Odometry* odometry, Frame* frame, LoopEnd* loop,
                           tv_odometry_state* state) {
  Map& map = odometry->map;
  Frame* again = &odometry->starts[0];  // the same frame, as it sees the loop's old points
  const int32_t end_id = loop != nullptr ? map.keyframes[loop->keyframe].id : -1;
  const int32_t next_point_id = map.next_point_id;
  make_room(odometry, 1);
  // No frame takes the time of a loop, or of a step after it, and of all these points.
  const bool can_wait = odometry->took_step || loop != nullptr;
  const int32_t keyframe = make_keyframe(odometry, *frame);
  begin_check(odometry, map.keyframes[keyframe].id);
  make_points(odometry, keyframe, *frame, can_wait);
  if (!heed_check(odometry)) return false;
  remove_bad_points(odometry);
  const int32_t newest = map.num_keyframes - 1;
  odometry->reference_id = map.keyframes[newest].id;
  if (loop != nullptr) loop->keyframe = find_keyframe(map, end_id);
  const bool closes = loop != nullptr && loop->keyframe >= 0;
  if (closes) {
    for (int32_t k = 0; k < again->num; ++k) {
      // The point may be gone, and its place taken by a new one.
      if (again->points[k] == kNoPoint) continue;
      const int32_t id = map.points[again->points[k]].id;
      if (id < 0 || id >= next_point_id) again->points[k] = kNoPoint;
    }
    if (close_loop(odometry, newest, *again, *loop)) state->map_reasons |= TV_MAP_REASON_JUMPED;
    scale_by(loop->scale, odometry->motion.t);
    ++odometry->num_loops;
    state->loop_closed = 1;
  }
  take_keyframe(*odometry, newest, frame);
  odometry->unadjusted_id = odometry->reference_id;
  odometry->closed_loop = closes;
  odometry->drift_sq += odometry->turn_sigma * odometry->turn_sigma;
  state->is_keyframe = 1;
  return true;
}

// Looks for the frame in the map. True: the frame has its pose, and the keyframe's surroundings are
// those in which the next frame is looked for. is_locating: it is a frame of tv_odometry_locate,
// which may be anywhere, and for which no point counts as looked for.
bool relocate(Odometry* odometry, int32_t from, int32_t count, bool is_locating, Frame* frame,
              PoseFit* fit) {
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
    if (!refine_track(odometry, !is_locating, frame, fit) ||
        fit->estimate.num_inliers < kLeastRelocated || fit->estimate.verdict != TV_VERDICT_OK)
      continue;
    if (!is_locating && map.keyframes[k].segment == odometry->segment &&
        !is_reachable(*odometry, *frame))
      continue;
    odometry->reference_id = map.keyframes[k].id;
    return true;
  }
  return false;
}

bool track_map(Odometry* odometry, const tv_odometry_frame& input, Frame* frame, PoseFit* fit) {
  const Frame& previous = odometry->previous;
  Rigid predicted = previous.cam_from_world;
  if (odometry->has_motion && input.gap == 0) {
    const double factor =
        odometry->motion_s > 0 ? (input.time_s - previous.time_s) / odometry->motion_s : 1;
    predicted =
        compose(scaled_motion(odometry->motion, std::min(factor, 3.0)), previous.cam_from_world);
  }
  const int32_t* points = odometry->local_points;
  const int32_t num = odometry->num_local_points;
  return (track_points(odometry, points, num, predicted, 15.0, frame, fit) ||
          track_points(odometry, points, num, predicted, 40.0, frame, fit) ||
          match_and_fit(odometry, points, num, frame, fit)) &&
         refine_track(odometry, true, frame, fit);
}

void write_pose(const Odometry& odometry, const Frame& frame, tv_odometry_state* state) {
  const Map& map = odometry.map;
  const int32_t k = find_keyframe(map, odometry.reference_id);
  const Rigid world_from_cam = inverse(frame.cam_from_world);
  const Rigid relative = compose(map.keyframes[k].cam_from_world, world_from_cam);
  state->has_pose = 1;
  state->segment = map.keyframes[k].segment;
  state->reference_id = odometry.reference_id;
  std::copy_n(relative.R, 9, state->reference_from_cam_R);
  for (int c = 0; c < 3; ++c) {
    state->reference_from_cam_t[c] = relative.t[c] / map.keyframes[k].scale;
  }
  write_rigid(world_from_cam, state->world_from_cam_R, state->world_from_cam_t);
}

void write_fit(const PoseFit& fit, tv_odometry_state* state) {
  state->num_matches = fit.estimate.num_matches;
  state->num_inliers = fit.estimate.num_inliers;
  state->has_covariance = fit.estimate.has_covariance;
  std::copy_n(fit.estimate.covariance, 36, state->cam_from_world_covariance);
  state->noise_px = fit.estimate.noise_px;
  state->reasons = fit.estimate.reasons;
}

// The frame's pose is known: keyframe, loops, scale, state. follows: so was that of the frame
// before. False: the map is wrong here.
bool finish_tracked(Odometry* odometry, const PoseFit& fit, bool follows, bool gap, Frame* frame,
                    tv_odometry_state* state) {
  odometry->lost_frames = odometry->turned_frames = odometry->num_starts = 0;
  count_found(odometry, *frame);
  measure_depth(odometry, *frame);
  write_fit(fit, state);
  const double seconds = frame->time_s - odometry->previous.time_s;
  follows = follows && seconds > 0;  // else the clock began anew, and nobody knows how long it was
  odometry->has_motion = follows;
  if (follows) {
    odometry->motion = motion_between(odometry->previous.cam_from_world, frame->cam_from_world);
    odometry->motion_s = seconds;
  }
  if (follows && !(gap && seconds > kLongestGap))
    add_travel(odometry, *frame);
  else
    begin_travel(odometry, frame->cam_from_world, -1);
  if (!heed_velocities(odometry, *frame, &state->map_reasons)) return false;
  state->attitude_ignored = !check_attitude(*odometry, frame);
  odometry->turn_sigma = turn_sigma_of(fit.estimate.covariance, 6);
  // The path jumps here, because the map was moved since the last tracked frame.
  if (odometry->was_moved_far) state->map_reasons |= TV_MAP_REASON_JUMPED;
  odometry->was_moved_far = false;
  // It was tracked with the map as it was, which a check may confirm now and an adjustment moves
  // before the next frame.
  add_doubts(*odometry, state);
  const bool is_due = needs_keyframe(*odometry, *frame, fit.estimate.num_inliers);
  LoopEnd loop;
  const bool found_loop = odometry->num_contrary == 0 && !is_spreading(*odometry) &&
                          find_loop(odometry, *frame, kLoopKeyframes, &odometry->starts[0], &loop);
  if (is_due || found_loop) {
    if (!add_frame_as_keyframe(odometry, frame, found_loop ? &loop : nullptr, state)) return false;
  } else if (is_checking(odometry->check)) {
    check_next_pair(odometry);
    if (!heed_check(odometry)) return false;
  }
  add_doubts(*odometry, state);
  if (odometry->drift_sq > kMostDrift * kMostDrift) {
    state->map_reasons |= TV_MAP_REASON_UNSURE_ATTITUDE;
  }
  state->reasons |= reasons_of(state->map_reasons);
  odometry->status = state->reasons == 0 ? TV_ODOMETRY_TRACKING : TV_ODOMETRY_WEAK;
  return true;
}

// Looks for a lost frame in a few keyframes, at each frame in the next ones.
bool search_map(Odometry* odometry, bool is_first, Frame* frame, PoseFit* fit) {
  const Map& map = odometry->map;
  if (is_first) odometry->next_search = map.num_keyframes - 1;
  if (relocate(odometry, odometry->next_search, kSearchedKeyframes, false, frame, fit)) {
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

// The map does not reach the frame. True: it follows the frame before by a turn, so that its
// attitude is known.
bool follow_turn(Odometry* odometry, Frame* frame) {
  Rigid turn;
  if (odometry->turned_frames >= kMostTurnedFrames ||
      !estimate_turn(odometry, odometry->previous, *frame, &turn)) {
    return false;
  }
  // The camera's centre stays: cam_from_world is the turn after that of the frame before.
  frame->cam_from_world = orthonormalised(compose(turn, odometry->previous.cam_from_world));
  forget_points(frame);  // those of a pose that was refused
  ++odometry->turned_frames;
  return true;
}

// Tries to begin a map, or another segment of it.
bool begin_segment(Odometry* odometry, Frame* frame, tv_odometry_state* state) {
  const int32_t segment = odometry->segment;
  const bool is_upright = odometry->is_upright;
  odometry->segment = odometry->num_segments;
  if (!start_map(odometry, frame, &state->reasons)) {
    odometry->segment = segment;
    odometry->is_upright = is_upright;
    return false;
  }
  change_scale(odometry, segment, odometry->segment);
  odometry->drift_sq = 0;
  ++odometry->num_segments;
  odometry->lost_frames = odometry->turned_frames = 0;
  const int32_t newest = odometry->map.num_keyframes - 1;
  take_keyframe(*odometry, newest, frame);
  odometry->reference_id = odometry->map.keyframes[newest].id;
  odometry->confirmed_id = odometry->reference_id;
  measure_reach(*odometry, *frame, &odometry->confirmed);
  doubt(odometry, TV_MAP_REASON_UNCONFIRMED);
  state->map_reasons = odometry->doubts;
  state->reasons = reasons_of(state->map_reasons);
  odometry->check = MapCheck{};
  odometry->keyframe_inliers = odometry->map.keyframes[newest].num_observations;
  list_local_points(odometry, newest);
  measure_depth(odometry, *frame);
  begin_travel(odometry, frame->cam_from_world, odometry->reference_id);
  state->is_keyframe = 1;
  odometry->status = TV_ODOMETRY_WEAK;
  return true;
}

void write_counts(const Odometry& odometry, tv_odometry_state* state) {
  state->status = odometry.status;
  state->num_frames = odometry.num_frames;
  state->num_keyframes = odometry.map.num_keyframes;
  state->num_points = odometry.map.num_points;
  state->num_segments = odometry.num_segments;
  state->num_relocations = odometry.num_relocations;
  state->num_loops = odometry.num_loops;
  state->scale_source = odometry.scale.source;
  state->scale_sigma = odometry.scale.sigma;
  state->scale_contradicted = odometry.scale.is_contradicted;
  const ScaleEstimate h = height_estimate(odometry.scale);
  const ScaleEstimate v = velocity_estimate(odometry.scale);
  if (h.source != TV_SCALE_UNIT) {
    state->height_scale = h.product / h.square;
    state->height_scale_sigma = std::sqrt(1 / h.square);
  }
  if (v.source != TV_SCALE_UNIT) {
    state->velocity_scale = v.product / v.square;
    state->velocity_scale_sigma = std::sqrt(1 / v.square);
  }
  state->still_share = still_share(odometry);
  state->principal_point_shift_px[0] = odometry.camera.model.cx - odometry.given_camera.cx;
  state->principal_point_shift_px[1] = odometry.camera.model.cy - odometry.given_camera.cy;
}

// Makes *state that of a frame without a pose.
void clear_state(const Frame& frame, tv_odometry_state* state) {
  *state = tv_odometry_state{};
  state->num_keypoints = frame.num;
  state->segment = state->reference_id = -1;
}

// What the frame was tracked with was wrong.
void lose_frame(Odometry* odometry, const Frame& frame, tv_odometry_state* state) {
  const bool is_contrary = (state->map_reasons & TV_MAP_REASON_VELOCITIES_DISAGREE) != 0;
  clear_state(frame, state);
  state->map_reasons = is_contrary ? TV_MAP_REASON_VELOCITIES_DISAGREE : TV_MAP_REASON_CONTRADICTED;
  state->reasons = reasons_of(state->map_reasons);
  odometry->status = TV_ODOMETRY_LOST;
  odometry->lost_frames = 1;
  odometry->has_motion = false;
}

}  // namespace

bool finish_keyframe(Odometry* odometry, Frame* frame) {
  const int32_t newest = find_keyframe(odometry->map, odometry->unadjusted_id);
  odometry->unadjusted_id = -1;
  if (newest < 0) return false;
  make_points(odometry, newest, *frame, false);
  const Rigid before = odometry->map.keyframes[newest].cam_from_world;
  adjust_around(odometry, newest, odometry->closed_loop ? kLoopSteps : kWindowSteps);
  odometry->was_moved_far = is_jump(odometry, before, newest);
  odometry->keyframe_inliers = odometry->map.keyframes[newest].num_observations;
  list_local_points(odometry, newest);
  take_keyframe(*odometry, newest, frame);
  if (odometry->closed_loop) measure_depth(odometry, *frame);
  // Not between keyframes of two maps, where one was added meanwhile.
  if (newest == odometry->map.num_keyframes - 1) measure_scale(odometry, frame);
  return true;
}

void finish_map(Odometry* odometry) {
  finish_keyframe(odometry, &odometry->frame);
  while (is_spreading(*odometry)) spread_loop(odometry, &odometry->frame);
}

void track_frame(Odometry* odometry, const tv_odometry_frame& input, tv_odometry_state* state) {
  std::swap(odometry->frame, odometry->previous);
  odometry->took_step = !finish_keyframe(odometry, &odometry->previous) && is_spreading(*odometry);
  if (odometry->took_step) spread_loop(odometry, &odometry->previous);
  correct_camera(odometry, &odometry->previous);
  Frame* frame = &odometry->frame;
  extract_frame(odometry, input.image, input.mask.data != nullptr ? &input.mask : nullptr, frame);
  frame->number = odometry->num_frames++;
  frame->time_s = input.time_s;
  read_sensors(input, frame);
  add_reach(odometry, *frame, input.gap != 0);
  clear_state(*frame, state);

  ArenaScope scope(odometry->scratch);
  PoseFit& fit = *arena_alloc<PoseFit>(odometry->scratch, 1);
  const bool has_map = odometry->map.num_keyframes > 0;
  const bool had_pose = odometry->previous.has_pose;
  const bool was_tracked = had_pose && odometry->turned_frames == 0;
  bool has_pose = has_map && had_pose && track_map(odometry, input, frame, &fit);
  const bool follows = has_pose && was_tracked;
  if (!has_pose && has_map) {
    if (was_tracked) odometry->num_starts = 0;
    has_pose = search_map(odometry, was_tracked, frame, &fit);
    state->relocated = has_pose && !was_tracked;
    odometry->num_relocations += state->relocated;
    odometry->is_found_again |= state->relocated != 0;
  }
  if (has_pose && !finish_tracked(odometry, fit, follows, input.gap != 0, frame, state)) {
    lose_frame(odometry, *frame, state);
    has_pose = false;
  } else if (!has_pose) {
    odometry->has_motion = false;
    has_pose = has_map && had_pose && follow_turn(odometry, frame);
    odometry->status = has_pose  ? TV_ODOMETRY_ROTATION
                       : has_map ? TV_ODOMETRY_LOST
                                 : TV_ODOMETRY_STARTING;
    if (has_pose) state->reasons = TV_REASON_PURE_ROTATION;
    ++odometry->lost_frames;
    if (!has_map || odometry->lost_frames > kLostBeforeStart) {
      uint32_t reasons = state->reasons;
      if (begin_segment(odometry, frame, state))
        has_pose = true;
      else if (has_pose)
        state->reasons = reasons;
    }
    // The points near the keyframes in which the frame was not found are not those of the next one.
    if (odometry->status == TV_ODOMETRY_ROTATION) {
      list_local_points(odometry, find_keyframe(odometry->map, odometry->reference_id));
    }
  }
  frame->has_pose = has_pose;
  if (has_pose) write_pose(*odometry, *frame, state);
  write_counts(*odometry, state);
  odometry->last_time_s = input.time_s;
}

void locate_frame(Odometry* odometry, const tv_image& image, const tv_image* mask, int32_t near_id,
                  tv_odometry_state* state) {
  const int32_t reference = odometry->reference_id;
  Frame* frame = &odometry->previous;  // has no other use until the next frame comes
  extract_frame(odometry, image, mask, frame);
  PoseFit fit;
  clear_state(*frame, state);
  write_counts(*odometry, state);
  state->status = TV_ODOMETRY_LOST;
  const int32_t from = find_keyframe(odometry->map, near_id);
  if (odometry->map.num_keyframes > 0 &&
      relocate(odometry, from >= 0 ? from : odometry->map.num_keyframes - 1,
               odometry->map.num_keyframes, true, frame, &fit)) {
    write_fit(fit, state);
    state->status = fit.estimate.reasons == 0 ? TV_ODOMETRY_TRACKING : TV_ODOMETRY_WEAK;
    write_pose(*odometry, *frame, state);
  }
  odometry->reference_id = reference;
  const int32_t k = find_keyframe(odometry->map, reference);
  if (k >= 0) list_local_points(odometry, k);
}

}  // namespace tv
