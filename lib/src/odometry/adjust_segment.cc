#include "odometry/adjust_segment.h"

#include <algorithm>

#include "odometry/map_window.h"
#include "odometry/metric.h"

namespace tv {
namespace {

constexpr int32_t kMostKeyframes = 256;
// Points are chosen until each keyframe sees its share of the observations divided by this: a point
// that is chosen for one keyframe has observations in the others.
constexpr double kOverlap = 1.7;
// Of the first step. With a hundred times as much, a long path bends by a tenth of what it should
// at each step.
constexpr double kDamping = 1e-6;
constexpr double kLeastGain = 1e-3;  // of the cost, for which another step is worth its time

WindowSizes sizes_of(const tv_odometry_options& o) {
  return {std::min(o.max_keyframes, kMostKeyframes), std::min(6 * o.max_keypoints, o.max_points),
          22 * o.max_keypoints};
}

// Adds the keyframes of a segment, all held or all free. False: there are too many. No keyframe is
// held where gravity is known (else adjust_window holds the first one): one that is can only come
// to where it belongs when all others move, which the steps do last.
bool add_segment(const Map& map, int32_t segment, bool fixed, MapWindow* window) {
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    if (map.keyframes[k].segment != segment) continue;
    if (window->model.num_views == window->sizes.views) return false;
    add_view(map, k, fixed, window);
  }
  return true;
}

// Adds points until each keyframe sees enough of them, those first that most keyframes see.
void add_shared_points(const Map& map, MapWindow* window) {
  const WindowSizes& sizes = window->sizes;
  const int32_t wanted =
      static_cast<int32_t>(sizes.observations / (kOverlap * window->model.num_views));
  int32_t left = sizes.observations;
  for (int32_t least = 16; least > 1; least /= 2) {
    for (int32_t v = 0; v < window->model.num_views; ++v) {
      const MapKeyframe& view = map.keyframes[window->keyframes[v]];
      const MapKeypoint* own = keypoints_of(map, view);
      int32_t seen = 0;
      for (int32_t i = 0; i < view.num_keypoints; ++i) {
        seen += own[i].point != kNoPoint && window->numbers[own[i].point] >= 0;
      }
      for (int32_t i = 0; i < view.num_keypoints && seen < wanted; ++i) {
        const int32_t p = own[i].point;
        if (p == kNoPoint || window->numbers[p] >= 0) continue;
        const int32_t num = map.points[p].num_observations;
        if (num < least || num > left || window->model.num_points == sizes.points) continue;
        add_map_point(map, p, window);
        left -= num;
        ++seen;
      }
    }
  }
}

}  // namespace

size_t adjust_segment_bytes(const tv_odometry_options& o) {
  return map_window_bytes(o, sizes_of(o)) +
         arena_bytes<MovedKeyframe>(static_cast<size_t>(o.max_keyframes));
}

bool adjust_segment(Odometry* odometry, int32_t segment, int32_t max_iterations) {
  Arena arena = odometry->whole_scratch;
  Map& map = odometry->map;
  MapWindow window = make_map_window(*odometry, sizes_of(odometry->options), arena);
  if (!add_segment(map, segment, false, &window)) return false;
  add_shared_points(map, &window);
  add_observations(*odometry, &window);
  MovedKeyframe* moved = arena_alloc<MovedKeyframe>(arena, static_cast<size_t>(map.num_keyframes));
  window.max_iterations = max_iterations;
  window.damping = kDamping;
  if (!adjust_map_window(*odometry, &window, arena)) return false;
  for (int32_t k = 0; k < map.num_keyframes; ++k) moved[k].scale = 0;
  for (int32_t v = 0; v < window.model.num_views; ++v) {
    moved[window.keyframes[v]] = {pose_of(window, v), 1};
  }
  const bool counts = segment == odometry->segment;
  if (counts) add_ways(odometry, -1);
  move_keyframes(&map, moved);
  if (counts) add_ways(odometry, 1);
  keep_positions(window, &map);
  return window.result.final_cost < (1 - kLeastGain) * window.result.initial_cost;
}

int32_t adjust_points(Odometry* odometry, int32_t segment, int32_t first, int32_t max_iterations) {
  Arena arena = odometry->whole_scratch;
  const Map& map = odometry->map;
  MapWindow window = make_map_window(*odometry, sizes_of(odometry->options), arena);
  if (!add_segment(map, segment, true, &window)) return map.end_points;
  int32_t left = window.sizes.observations, place = first;
  for (; place < map.end_points && window.model.num_points < window.sizes.points; ++place) {
    const MapPoint& point = map.points[place];
    if (point.id < 0 || point.segment != segment) continue;
    left -= point.num_observations;
    if (left < 0) break;
    add_map_point(map, place, &window);
  }
  add_observations(*odometry, &window);
  window.max_iterations = max_iterations;
  if (adjust_map_window(*odometry, &window, arena)) {
    keep_positions(window, &odometry->map);
    drop_outliers(window, odometry);
  }
  return place;
}

}  // namespace tv
