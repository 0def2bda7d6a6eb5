#include "odometry/track.h"

#include <algorithm>
#include <cmath>

#include "odometry/doubts.h"
#include "odometry/find_frame.h"
#include "odometry/find_points.h"
#include "odometry/frame_pair.h"
#include "odometry/gyro.h"
#include "odometry/keyframe.h"
#include "odometry/loop_closure.h"
#include "odometry/map_check.h"
#include "odometry/metric.h"
#include "odometry/move_principal_point.h"
#include "odometry/spread.h"
#include "odometry/start.h"
#include "odometry/still_cells.h"
#include "odometry/work.h"

namespace tv {
namespace {

// A frame becomes a keyframe when the camera moved by kFarMoved median depths or turned by
// kFarTurned radians since the last one, and earlier where few of its points are left.
constexpr double kFarMoved = 0.10, kFarTurned = 0.25, kLeastMoved = 0.02, kLeastTurned = 0.08;
constexpr int32_t kFewInliers = 100;
constexpr int32_t kFewKeypoints = 20;  // fewer can give no pose
constexpr int32_t kLoopKeyframes = 2;  // that are searched for a loop at each frame
// Frames are weak while the keyframes' attitudes are so uncertain together, in radians.
constexpr double kMostDrift = 0.026;
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

// The frame becomes a keyframe, and closes a loop where there is one. False: the map is wrong
// here, and the frame is no keyframe.
bool add_frame_as_keyframe(Odometry* odometry, Frame* frame, LoopEnd* loop,
                           tv_odometry_state* state) {
  Map& map = odometry->map;
  Frame* again = &odometry->starts[0];  // the same frame, as it sees the loop's old points
  const int32_t end_id = loop != nullptr ? map.keyframes[loop->keyframe].id : -1;
  const int32_t next_point_id = map.next_point_id;
  make_room(odometry, 1);
  // A frame that has just done a step of a loop, or found one, does not also take the time for all
  // these points.
  const bool can_wait = odometry->done == Work::kStepSpread || loop != nullptr;
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
  odometry->unfinished.id = odometry->reference_id;
  odometry->unfinished.closed_loop = closes;
  odometry->drift_sq += odometry->turn_sigma * odometry->turn_sigma;
  state->is_keyframe = 1;
  return true;
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
// before, and the frame was tracked from it. False: the map is wrong here.
bool finish_tracked(Odometry* odometry, const PoseFit& fit, bool follows, bool gap, Frame* frame,
                    tv_odometry_state* state) {
  odometry->num_starts = 0;
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
  if (follows) measure_bias(odometry, *frame);
  // The path jumps here, because the map was moved since the last tracked frame.
  if (odometry->was_moved_far) state->map_reasons |= TV_MAP_REASON_JUMPED;
  odometry->was_moved_far = false;
  // The frame was tracked with the map as it is at this moment; a check may confirm that map now,
  // and an adjustment will move it before the next frame.
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
  return true;
}

void write_counts(const Odometry& odometry, tv_odometry_state* state) {
  state->status = status_of(odometry.tracking.state, state->reasons);
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
  odometry->has_motion = false;
}

// Tries, in order, what the state allows, and returns what succeeded. If that gives a pose, it is
// written to the frame and *state.
TrackingEvent place_frame(Odometry* odometry, bool has_gap, Frame* frame,
                          tv_odometry_state* state) {
  ArenaScope scope(odometry->scratch);
  PoseFit& fit = *arena_alloc<PoseFit>(odometry->scratch, 1);
  const Tracking& tracking = odometry->tracking;
  const bool was_tracked = tracking.state == TrackingState::kTracked;
  TrackingEvent event = TrackingEvent::kMissed;
  if (may_try(tracking, TrackingEvent::kFollowed) && follow_map(odometry, has_gap, frame, &fit)) {
    event = TrackingEvent::kFollowed;
  } else if (may_try(tracking, TrackingEvent::kFound)) {
    if (was_tracked) odometry->num_starts = 0;
    if (search_map(odometry, was_tracked, frame, &fit)) event = TrackingEvent::kFound;
    state->relocated = event == TrackingEvent::kFound && !was_tracked;
    odometry->num_relocations += state->relocated;
    odometry->is_found_again |= state->relocated != 0;
  }
  if (event != TrackingEvent::kMissed) {
    const bool follows = event == TrackingEvent::kFollowed && was_tracked;
    if (finish_tracked(odometry, fit, follows, has_gap, frame, state)) return event;
    lose_frame(odometry, *frame, state);
    return TrackingEvent::kContradicted;
  }
  odometry->has_motion = false;
  if (may_try(tracking, TrackingEvent::kTurned) && follow_turn(odometry, frame)) {
    event = TrackingEvent::kTurned;
  }
  // While the gyro holds the attitude, the camera may return to the map.
  const bool waits = odometry->gyro.is_held && event == TrackingEvent::kTurned;
  if (!waits && may_try(tracking, TrackingEvent::kBegan) && begin_segment(odometry, frame, state)) {
    return TrackingEvent::kBegan;
  }
  if (event == TrackingEvent::kTurned) state->reasons = TV_REASON_PURE_ROTATION;
  return event;
}

}  // namespace

void track_frame(Odometry* odometry, const tv_odometry_frame& input, tv_odometry_state* state) {
  std::swap(odometry->frame, odometry->previous);
  odometry->done = do_next_work(odometry, &odometry->previous);
  correct_camera(odometry, &odometry->previous);
  Frame* frame = &odometry->frame;
  extract_frame(odometry, input.image, input.mask.data != nullptr ? &input.mask : nullptr, frame);
  frame->number = odometry->num_frames++;
  frame->time_s = input.time_s;
  read_sensors(input, frame);
  add_reach(odometry, *frame, input.gap != 0);
  hold_turn(odometry, input, *frame);
  clear_state(*frame, state);
  Tracking* tracking = &odometry->tracking;
  if (odometry->map.num_keyframes == 0) tracking->state = TrackingState::kStarting;
  const int32_t num_away = tracking->num_away;
  move_on(place_frame(odometry, input.gap != 0, frame, state), tracking);
  // A picture that shows nothing was not looked for, and the gyro's turn is as good after it.
  if (odometry->gyro.is_held && frame->num < kFewKeypoints) tracking->num_away = num_away;
  frame->has_pose = has_pose(tracking->state);
  // The list of local points is of the keyframes in which the frame was not found, and not of the
  // reference keyframe.
  if (tracking->state == TrackingState::kTurned) {
    list_local_points(odometry, find_keyframe(odometry->map, odometry->reference_id));
  }
  if (frame->has_pose) write_pose(*odometry, *frame, state);
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
      find_in_keyframes(odometry, from >= 0 ? from : odometry->map.num_keyframes - 1,
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
