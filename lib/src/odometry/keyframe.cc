#include "odometry/keyframe.h"

#include <algorithm>
#include <cmath>

#include "base/order.h"
#include "geometry/vector3.h"
#include "odometry/adjust.h"
#include "odometry/map_check.h"
#include "twoview/triangulate.h"

namespace tv {
namespace {

constexpr double kLeastBaseline = 0.01;  // of the median depth: nearer keyframes make no points
// A keyframe is matched with so many earlier ones, and at once with so many where it can wait.
constexpr int32_t kMostNeighbours = 4, kNeighboursAtOnce = 2;
// A point is made where its rays meet at this many times the standard deviation of the attitude:
// below that, the depths of all points are wrong together.
constexpr double kLeastTurnSigmas = 5;
constexpr double kLargestSizeRatio = 2.2;
constexpr double kMostTurned = 1.0;  // radians between keyframes that make points together
// In place of a gap's length: the first keyframe of a segment, and the last one.
constexpr double kHardlyEver = 1e300, kRarely = 1e299;
// A frame's surroundings are the points of this many keyframes that share at least so many with it.
constexpr int32_t kSurroundingKeyframes = 12, kLeastShared = 5;

// The keypoint of a keyframe sees the point from now on if the point's image lies where it does, up
// to the largest error.
void observe_if_near(Odometry* odometry, int32_t keyframe, int32_t keypoint, int32_t point) {
  Map& map = odometry->map;
  const MapKeypoint& own = keypoints_of(map, map.keyframes[keyframe])[keypoint];
  double x[3];
  transform(map.keyframes[keyframe].cam_from_world, map.points[point].position, x);
  Vec2 pixel;
  if (!project(odometry->camera, Vec3(x[0], x[1], x[2]), &pixel, nullptr)) return;
  const double dx = pixel.x() - static_cast<double>(own.x);
  const double dy = pixel.y() - static_cast<double>(own.y);
  if (std::sqrt(dx * dx + dy * dy) <= kLargestError * sigma_of(own)) {
    observe(&map, keyframe, keypoint, point);
  }
}

// The newest keyframes before this one with which it makes points, at most kMostNeighbours.
int32_t list_neighbours(const Odometry& odometry, int32_t keyframe, int32_t* neighbours) {
  const Map& map = odometry.map;
  const MapKeyframe& own = map.keyframes[keyframe];
  int32_t num = 0;
  for (int32_t k = keyframe - 1; k >= 0 && num < kMostNeighbours; --k) {
    const MapKeyframe& other = map.keyframes[k];
    if (other.described < 0 || other.segment != own.segment) continue;
    if (way_between(other.cam_from_world, own.cam_from_world) <
        kLeastBaseline * odometry.median_depth) {
      continue;
    }
    if (turn_between(other.cam_from_world, own.cam_from_world) > kMostTurned) continue;
    neighbours[num++] = k;
  }
  return num;
}

}  // namespace

void make_room(Odometry* odometry, int32_t wanted) {
  Map& map = odometry->map;
  while (map.num_keyframes + wanted > map.sizes.max_keyframes) {
    int32_t best = -1;
    double least = 0;
    for (int32_t k = 1; k + 2 < map.num_keyframes; ++k) {
      const MapKeyframe &before = map.keyframes[k - 1], &own = map.keyframes[k];
      const MapKeyframe& after = map.keyframes[k + 1];
      if (own.id == odometry->reference_id) continue;
      double gap =
          way_between(before.cam_from_world, after.cam_from_world) +
          odometry->median_depth * turn_between(before.cam_from_world, after.cam_from_world);
      if (before.segment != own.segment)
        gap = kHardlyEver;
      else if (after.segment != own.segment)
        gap = kRarely;
      if (best < 0 || gap < least) {
        least = gap;
        best = k;
      }
    }
    const int32_t segment = map.keyframes[best].segment;
    int32_t kept = newest_of(map, segment, best);
    if (kept < 0 && map.keyframes[best + 1].segment == segment) kept = best + 1;
    remove_keyframe(&map, best, kept);
  }
}

int32_t make_keyframe(Odometry* odometry, const Frame& frame) {
  Map& map = odometry->map;
  const int32_t idx = add_keyframe(&map, frame.keypoints, frame.descriptors, frame.num);
  odometry->unfinished.next_neighbour = 0;
  MapKeyframe* keyframe = &map.keyframes[idx];
  keyframe->segment = odometry->segment;
  keyframe->frame = frame.number;
  keyframe->time_s = frame.time_s;
  keyframe->cam_from_world = orthonormalised(frame.cam_from_world);
  const Sensors& sensors = frame.sensors;
  if (odometry->is_upright && sensors.attitude_sigma_rad > 0) {
    std::copy_n(sensors.world_from_cam + 6, 3, keyframe->down);
    keyframe->down_sigma_rad = sensors.attitude_sigma_rad;
  }
  keyframe->height_m = sensors.height_m;
  keyframe->height_sigma_m = sensors.height_sigma_m;
  for (int32_t k = 0; k < frame.num; ++k) {
    const int32_t point = frame.points[k];
    if (point == kNoPoint) continue;
    observe(&map, idx, k, point);
    std::copy_n(frame.descriptors + static_cast<size_t>(k) * TV_DESCRIPTOR_BYTES,
                TV_DESCRIPTOR_BYTES, descriptor_of(map, point));
  }
  return idx;
}

int32_t triangulate_matches(Odometry* odometry, int32_t keyframe0, int32_t keyframe1,
                            const tv_correspondence* matches, int32_t num, double least_angle_rad,
                            const uint8_t* greys) {
  ArenaScope scope(odometry->scratch);
  Arena& arena = odometry->scratch;
  Map& map = odometry->map;
  const MapKeyframe& k0 = map.keyframes[keyframe0];
  const MapKeyframe& k1 = map.keyframes[keyframe1];
  const MapKeypoint* own0 = keypoints_of(map, k0);
  const MapKeypoint* own1 = keypoints_of(map, k1);
  const int32_t *seen0 = seen_by(map, k0), *seen1 = seen_by(map, k1);
  const size_t n = static_cast<size_t>(num);
  double* pixels0 = arena_alloc<double>(arena, 2 * n);
  double* pixels1 = arena_alloc<double>(arena, 2 * n);
  tv_point* points = arena_alloc<tv_point>(arena, n);
  for (int32_t k = 0; k < num; ++k) {
    const MapKeypoint &a = own0[matches[k].idx0], &b = own1[matches[k].idx1];
    pixels0[2 * k] = static_cast<double>(a.x);
    pixels0[2 * k + 1] = static_cast<double>(a.y);
    pixels1[2 * k] = static_cast<double>(b.x);
    pixels1[2 * k + 1] = static_cast<double>(b.y);
  }
  const Rigid cam1_from_cam0 =
      orthonormalised(motion_between(k0.cam_from_world, k1.cam_from_world));
  const tv_camera& camera = odometry->camera.model;
  tv_camera_pair pair{camera, camera, {}, {}};
  std::copy(cam1_from_cam0.R, cam1_from_cam0.R + 9, pair.cam1_from_cam0_R);
  std::copy(cam1_from_cam0.t, cam1_from_cam0.t + 3, pair.cam1_from_cam0_t);
  const tv_pixel_pairs pixels = {sizeof pixels, num, pixels0, pixels1, nullptr, nullptr, nullptr};
  if (tv_triangulate(&pair, &pixels, TV_TRIANGULATION_ITERATIVE_LS, points) != TV_OK) return 0;
  const Rigid world_from_cam0 = inverse(k0.cam_from_world);
  int32_t num_made = 0;
  for (int32_t k = 0; k < num; ++k) {
    const tv_point& p = points[k];
    const int32_t idx0 = matches[k].idx0, idx1 = matches[k].idx1;
    const MapKeypoint &a = own0[idx0], &b = own1[idx1];
    if (seen0[idx0] != kNoPoint || seen1[idx1] != kNoPoint) continue;
    const double sigma = std::sqrt(0.5 * (sigma_of(a) * sigma_of(a) + sigma_of(b) * sigma_of(b)));
    if (p.status != TV_POINT_OK || static_cast<double>(p.angle_rad) < least_angle_rad * sigma ||
        static_cast<double>(p.error_px) > kLargestError * sigma) {
      continue;
    }
    double x[3], world[3];
    transform(cam1_from_cam0, p.position, x);
    const double ratio =
        (static_cast<double>(a.size) * p.position[2]) / (static_cast<double>(b.size) * x[2]);
    if (!(ratio < kLargestSizeRatio && ratio > 1 / kLargestSizeRatio)) continue;
    transform(world_from_cam0, p.position, world);
    const uint8_t* descriptor =
        descriptors_of(map, k1) + static_cast<size_t>(idx1) * TV_DESCRIPTOR_BYTES;
    const int32_t made = add_point(&map, world, descriptor, k1.segment);
    if (made == kNoPoint) break;
    MapPoint* point = &map.points[made];
    point->made_at = k1.id;
    point->num_visible = point->num_found = 1;
    for (int c = 0; c < 3; ++c) point->seen_from[c] = static_cast<float>(world_from_cam0.t[c]);
    point->depth_sigma = static_cast<float>(
        std::min(1.0, kTypicalNoise / (camera.fx * static_cast<double>(p.angle_rad))));
    point->grey = greys[idx1];
    observe(&map, keyframe0, idx0, made);
    observe(&map, keyframe1, idx1, made);
    ++num_made;
  }
  return num_made;
}

void make_points(Odometry* odometry, int32_t keyframe, const Frame& frame, bool can_wait) {
  int32_t* next = &odometry->unfinished.next_neighbour;
  if (*next == kMostNeighbours) return;
  ArenaScope scope(odometry->scratch);
  Arena& arena = odometry->scratch;
  Map& map = odometry->map;
  const MapKeyframe& own = map.keyframes[keyframe];
  const int32_t room = map.sizes.max_keypoints;
  const size_t n = static_cast<size_t>(room);
  tv_correspondence* found = arena_alloc<tv_correspondence>(arena, n);
  const tv_features mine = features_of(map, own, arena_alloc<tv_keypoint>(arena, n));
  tv_keypoint* their_room = arena_alloc<tv_keypoint>(arena, n);
  int32_t neighbours[kMostNeighbours];
  const int32_t num_neighbours = list_neighbours(*odometry, keyframe, neighbours);
  MapCheck* check = &odometry->check;
  const bool is_first_call = *next == 0;  // only its votes are heeded at once
  // The nearest one is left out: from near by, a wrong motion looks like the right one.
  const int32_t first_checked = num_neighbours > 1 ? 1 : 0;
  for (; *next < num_neighbours; ++*next) {
    const int32_t i = *next, k = neighbours[i];
    if (can_wait && i == kNeighboursAtOnce && check->vote.num_disagree == 0) return;
    const MapKeyframe& other = map.keyframes[k];
    const tv_features theirs = features_of(map, other, their_room);
    int32_t num_found = 0;
    if (tv_match(odometry->context, &theirs, &mine, nullptr, found, room, &num_found) != TV_OK) {
      continue;
    }
    if (is_first_call && (i == first_checked || (i > first_checked && is_urgent(check->vote)))) {
      add_vote(odometry, theirs.keypoints, mine.keypoints, found, num_found,
               motion_between(other.cam_from_world, own.cam_from_world), &check->vote);
    } else if (i > first_checked && needs_vote(check->vote)) {
      add_pair(check, other.id);
    }
    const int32_t *seen = seen_by(map, own), *seen_by_them = seen_by(map, other);
    int32_t num = 0;
    for (int32_t m = 0; m < num_found; ++m) {
      const int32_t a = found[m].idx0, b = found[m].idx1;
      const int32_t theirs_point = seen_by_them[a], point = seen[b];
      if (point == kNoPoint && theirs_point == kNoPoint) {
        found[num++] = found[m];
      } else if (theirs_point == kNoPoint) {
        observe_if_near(odometry, k, a, point);
      } else if (point == kNoPoint) {
        observe_if_near(odometry, keyframe, b, theirs_point);
      }
    }
    triangulate_matches(odometry, k, keyframe, found, num,
                        std::max(kLeastAngle, kLeastTurnSigmas * odometry->turn_sigma),
                        frame.greys);
  }
  *next = kMostNeighbours;
}

void point_covariance(const Odometry& odometry, const MapPoint& point, double covariance[9]) {
  double ray[3], distance_sq = 0;
  for (int c = 0; c < 3; ++c) {
    ray[c] = point.position[c] - static_cast<double>(point.seen_from[c]);
    distance_sq += ray[c] * ray[c];
  }
  const double along = static_cast<double>(point.depth_sigma);
  const double across = kTypicalNoise / odometry.camera.model.fx;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      covariance[3 * r + c] = (along * along - across * across) * (ray[r] * ray[c]) +
                              (r == c ? across * across * distance_sq : 0);
    }
  }
}

void remove_bad_points(Odometry* odometry) {
  Map& map = odometry->map;
  clear_marks(&map);
  for (int32_t p = 0; p < map.end_points; ++p) {
    const MapPoint& point = map.points[p];
    if (point.num_visible >= 8 && 4 * point.num_found < point.num_visible) mark_point(&map, p);
  }
  remove_marked_points(&map);
}

int32_t list_points(Odometry* odometry, int32_t keyframe, int32_t* points) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  int32_t* shared = arena_alloc<int32_t>(odometry->scratch, static_cast<size_t>(map.num_keyframes));
  count_shared(odometry, keyframe, shared);
  int32_t chosen[kSurroundingKeyframes];
  const int32_t num_chosen =
      largest(shared, map.num_keyframes, kLeastShared, kSurroundingKeyframes, chosen);
  clear_marks(&map);
  int32_t num = 0;
  for (int32_t n = 0; n < num_chosen; ++n) {
    const MapKeyframe& other = map.keyframes[chosen[n]];
    const int32_t* seen = seen_by(map, other);
    for (int32_t i = 0; i < other.num_keypoints; ++i) {
      const int32_t p = seen[i];
      if (p == kNoPoint || is_marked(map, p)) continue;
      if (num == odometry->max_matched) return num;
      mark_point(&map, p);
      points[num++] = p;
    }
  }
  return num;
}

void list_local_points(Odometry* odometry, int32_t keyframe) {
  odometry->num_local_points = list_points(odometry, keyframe, odometry->local_points);
}

void take_keyframe(const Odometry& odometry, int32_t keyframe, Frame* frame) {
  const MapKeyframe& own = odometry.map.keyframes[keyframe];
  frame->cam_from_world = own.cam_from_world;
  std::copy_n(seen_by(odometry.map, own), frame->num, frame->points);
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

}  // namespace tv
