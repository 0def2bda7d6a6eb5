#include "odometry/start.h"

#include <algorithm>

#include "odometry/adjust.h"
#include "odometry/find_points.h"
#include "odometry/frame_pair.h"
#include "odometry/keyframe.h"

namespace tv {
namespace {

constexpr int32_t kLeastMatches = 30, kLeastPoints = 40;
constexpr double kLeastParallax = 0.015;  // radians, the median
constexpr int32_t kLeastTurnInliers = 50;
constexpr int32_t kFramesBetween = 6;      // from one frame that waits to the next
constexpr double kLargestTurnSigma = 0.3;  // of the median parallax, in frames nearer than that
constexpr double kGrowth = 2;              // how many times as fast the parallax may go on growing

// Matches two frames and estimates the motion between them. False: there are too few matches.
bool match_frames(Odometry* odometry, const Frame& frame0, const Frame& frame1, Pair* pair) {
  const int32_t room = std::min(frame0.num, frame1.num);
  tv_correspondence* found =
      arena_alloc<tv_correspondence>(odometry->scratch, static_cast<size_t>(std::max(room, 1)));
  const tv_features features0 = as_features(frame0.keypoints, frame0.descriptors, frame0.num);
  const tv_features features1 = as_features(frame1.keypoints, frame1.descriptors, frame1.num);
  int32_t num = 0;
  tv_match(odometry->context, &features0, &features1, nullptr, found, room, &num);
  return estimate_pair(odometry, frame0.keypoints, frame1.keypoints, found, num, pair);
}

// The number of the next frame to match with the first one: the parallax may be enough there. It
// is at most as far from this one as this one is from the first, and kFramesBetween.
int32_t next_try_of(const Frame& first, const Frame& frame, double parallax) {
  const int32_t elapsed = frame.number - first.number;
  int32_t next = elapsed + 1;
  while (next < elapsed + std::min(elapsed, kFramesBetween) &&
         kGrowth * parallax * next < kLeastParallax * elapsed) {
    ++next;
  }
  return first.number + next;
}

// Whether the rotation is known well enough for the depths of the first points, which are off by
// the share of its error in the parallax.
bool is_turn_sure(const tv_two_view& view) {
  return turn_sigma_of(view.covariance, 5) <= kLargestTurnSigma * view.median_parallax_rad;
}

void drop_start(Odometry* odometry, int n) {
  const Frame dropped = odometry->starts[n];
  for (int k = n; k + 1 < odometry->num_starts; ++k) odometry->starts[k] = odometry->starts[k + 1];
  odometry->starts[--odometry->num_starts] = dropped;
}

// Makes the two frames the first keyframes of a segment, with points. Returns false, and makes
// none, where too few points can be made.
bool make_first_points(Odometry* odometry, Frame* frame0, Frame* frame, const Pair& pair) {
  Map& map = odometry->map;
  // The world is the frame of the first camera; with an attitude it has the axes of the attitude,
  // and is upright.
  frame0->cam_from_world = kIdentity;
  odometry->is_upright = frame0->sensors.attitude_sigma_rad > 0;
  if (odometry->is_upright) {
    std::copy_n(frame0->sensors.world_from_cam, 9, frame0->cam_from_world.R);
    frame0->cam_from_world = inverse(frame0->cam_from_world);
  }
  const Rigid relative = rigid_of(pair.view->R, pair.view->t);
  frame->cam_from_world = compose(relative, frame0->cam_from_world);
  forget_points(frame);
  make_room(odometry, 2);
  const int32_t first = make_keyframe(odometry, *frame0);
  const int32_t second = make_keyframe(odometry, *frame);
  tv_correspondence* inliers =
      arena_alloc<tv_correspondence>(odometry->scratch, static_cast<size_t>(pair.num));
  int32_t num = 0;
  for (int32_t k = 0; k < pair.num; ++k) {
    if (pair.is_inlier[k]) inliers[num++] = pair.matches[k];
  }
  int32_t made =
      triangulate_matches(odometry, first, second, inliers, num, kLeastAngle, frame->greys);
  if (made >= kLeastPoints) {
    adjust_around(odometry, second, 20);
    made = map.keyframes[second].num_observations;
  }
  if (made >= kLeastPoints) return true;
  remove_segment_points(odometry);
  map.free_rooms[map.num_free_rooms++] = map.keyframes[second].room;
  map.free_rooms[map.num_free_rooms++] = map.keyframes[first].room;
  map.num_keyframes -= 2;
  map.next_keyframe_id -= 2;
  map.next_described = (map.next_described + kDescribedKeyframes - 2) % kDescribedKeyframes;
  return false;
}

}  // namespace

void remove_segment_points(Odometry* odometry) {
  Map& map = odometry->map;
  clear_marks(&map);
  for (int32_t p = 0; p < map.end_points; ++p) {
    if (map.points[p].segment == odometry->segment) mark_point(&map, p);
  }
  remove_marked_points(&map);
}

void copy_frame(const Odometry& odometry, const Frame& from, Frame* to) {
  const size_t n = static_cast<size_t>(from.num);
  std::copy_n(from.keypoints, n, to->keypoints);
  std::copy_n(from.descriptors, n * TV_DESCRIPTOR_BYTES, to->descriptors);
  std::copy_n(from.sigmas, n, to->sigmas);
  to->num = from.num;
  to->number = to->next_try = from.number;
  to->time_s = from.time_s;
  to->sensors = from.sensors;
  to->cam_from_world = kIdentity;
  make_grid(odometry, to);
}

bool start_map(Odometry* odometry, Frame* frame, uint32_t* reasons) {
  *reasons = 0;
  for (int n = 0; n < odometry->num_starts; ++n) {
    ArenaScope scope(odometry->scratch);
    Pair pair;
    Frame* const first = &odometry->starts[n];
    if (frame->number < first->next_try) {
      *reasons |= TV_REASON_LOW_PARALLAX;
      break;
    }
    if (!match_frames(odometry, *first, *frame, &pair) ||
        2 * pair.view->num_inliers < pair.num - pair.view->num_still ||
        pair.view->num_inliers < kLeastMatches) {
      *reasons |= TV_REASON_TOO_FEW_MATCHES;
      if (pair.num < kLeastMatches || odometry->num_starts > 1) drop_start(odometry, n--);
      continue;
    }
    *reasons |= pair.view->reasons;
    // For two frames near each other a later view may be better, so the start waits for it.
    const bool is_near = frame->number - first->number < kFramesBetween;
    if (!pair.view->has_t || pair.view->median_parallax_rad < kLeastParallax ||
        (is_near && !is_turn_sure(*pair.view))) {
      *reasons |= TV_REASON_LOW_PARALLAX;
      first->next_try = next_try_of(*first, *frame, pair.view->median_parallax_rad);
      // The waiting frames that follow are nearer still, unless the camera went to and fro.
      if (pair.view->median_parallax_rad < kLeastParallax / 2) break;
      continue;
    }
    if (pair.view->verdict != TV_VERDICT_OK || !make_first_points(odometry, first, frame, pair)) {
      continue;
    }
    *reasons = 0;
    odometry->num_starts = 0;
    return true;
  }
  if (odometry->num_starts == 0 ||
      frame->number - odometry->starts[odometry->num_starts - 1].number >= kFramesBetween) {
    if (odometry->num_starts == kNumStarts) drop_start(odometry, kNumStarts / 2);
    copy_frame(*odometry, *frame, &odometry->starts[odometry->num_starts++]);
  }
  return false;
}

bool estimate_turn(Odometry* odometry, const Frame& frame0, const Frame& frame1, Rigid* turn) {
  ArenaScope scope(odometry->scratch);
  Pair pair;
  if (!match_frames(odometry, frame0, frame1, &pair) || !pair.view->has_R ||
      pair.view->num_inliers < kLeastTurnInliers ||
      2 * pair.view->num_inliers < pair.num - pair.view->num_still) {
    return false;
  }
  *turn = kIdentity;
  std::copy_n(pair.view->R, 9, turn->R);
  return true;
}

}  // namespace tv
