#include "odometry/adjust.h"

#include <algorithm>

#include "odometry/map_window.h"

namespace tv {
namespace {

constexpr int32_t kLeastShared = 10;
// The errors of a keypoint in successive keyframes are alike, so that the standard deviation is
// this many times that of independent ones; and the map's scale drifts by this share from window to
// window. Measured: docs/algorithms/odometry.md.
constexpr double kCorrelation = 2, kDrift = 0.015;

WindowSizes sizes_of(const tv_odometry_options& o) {
  return {2 * o.window, std::min(6 * o.max_keypoints, o.max_points), 14 * o.max_keypoints};
}

// How many marked points each keyframe of a segment sees; 0 for those of other segments. A keyframe
// whose number is -1 is left out.
void count_marked_of(const Map& map, int32_t segment, int32_t* numbers) {
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    if (numbers[k] == -1) continue;
    const MapKeyframe& keyframe = map.keyframes[k];
    numbers[k] = keyframe.segment == segment ? count_marked(map, keyframe) : 0;
  }
}

// The keyframes that are adjusted: those that share most points with this one, in ascending order.
// `shared` receives how many points each keyframe shares with it. Returns how many there are.
int32_t choose_adjusted(Odometry* odometry, int32_t keyframe, int32_t* shared, int32_t* chosen) {
  count_shared(odometry, keyframe, shared);
  const int32_t num =
      largest(shared, odometry->map.num_keyframes, kLeastShared, odometry->options.window, chosen);
  for (int32_t i = 1; i < num; ++i) {  // few numbers; std::sort would take half a kilobyte
    for (int32_t k = i; k > 0 && chosen[k] < chosen[k - 1]; --k) {
      std::swap(chosen[k], chosen[k - 1]);
    }
  }
  return num;
}

// Adds the points of the views, those of the newest view first.
void add_points(const Map& map, MapWindow* window) {
  for (int32_t v = window->model.num_views - 1; v >= 0; --v) {
    const MapKeyframe& view = map.keyframes[window->keyframes[v]];
    const int32_t* seen = seen_by(map, view);
    for (int32_t i = 0; i < view.num_keypoints; ++i) {
      const int32_t p = seen[i];
      if (p == kNoPoint || window->numbers[p] >= 0) continue;
      if (window->model.num_points == window->sizes.points) break;
      add_map_point(map, p, window);
    }
  }
}

int32_t* keyframe_numbers(Odometry* odometry) {
  return arena_alloc<int32_t>(odometry->scratch, static_cast<size_t>(odometry->map.num_keyframes));
}

// An empty window around a keyframe, and two numbers for each keyframe of the map: how many points
// it shares with that one, and the keyframes that are adjusted, in ascending order.
struct Around {
  MapWindow window;
  int32_t *shared, *chosen;
  int32_t num_adjusted;
};

Around look_around(Odometry* odometry, int32_t keyframe) {
  Around around;
  around.window = make_map_window(*odometry, sizes_of(odometry->options), odometry->scratch);
  around.shared = keyframe_numbers(odometry);
  around.chosen = keyframe_numbers(odometry);
  around.num_adjusted = choose_adjusted(odometry, keyframe, around.shared, around.chosen);
  return around;
}

}  // namespace

size_t adjust_bytes(const tv_odometry_options& o) {
  const WindowSizes sizes = sizes_of(o);
  return map_window_bytes(o, sizes) +
         2 * arena_bytes<int32_t>(static_cast<size_t>(o.max_keyframes)) +
         arena_bytes<double>(36 * static_cast<size_t>(sizes.views)) +
         arena_bytes<uint8_t>(static_cast<size_t>(o.max_points));  // unused since there are marks
}

void count_shared(Odometry* odometry, int32_t keyframe, int32_t* shared) {
  Map* map = &odometry->map;
  const MapKeyframe& own = map->keyframes[keyframe];
  mark_points(map, seen_by(*map, own), own.num_keypoints);
  std::fill_n(shared, map->num_keyframes, 0);
  count_marked_of(*map, own.segment, shared);
  shared[keyframe] = 1 << 30;
}

int32_t largest(const int32_t* numbers, int32_t num, int32_t least, int32_t count,
                int32_t* chosen) {
  int32_t num_chosen = 0;
  for (int32_t k = num - 1; k >= 0; --k) {
    if (numbers[k] < least) continue;
    int32_t at = num_chosen;
    while (at > 0 && numbers[chosen[at - 1]] < numbers[k]) --at;
    if (at >= count) continue;
    num_chosen = std::min(num_chosen + 1, count);
    for (int32_t i = num_chosen - 1; i > at; --i) chosen[i] = chosen[i - 1];
    chosen[at] = k;
  }
  return num_chosen;
}

bool estimate_covariance(Odometry* odometry, int32_t keyframe, double covariance[36]) {
  Arena& arena = odometry->scratch;
  ArenaScope scope(arena);
  const Map& map = odometry->map;
  Around around = look_around(odometry, keyframe);
  MapWindow& window = around.window;
  const int32_t* chosen = around.chosen;
  bool holds_before = false;
  int32_t view = -1;
  for (int32_t k = 0; k < around.num_adjusted; ++k) {
    holds_before = holds_before || chosen[k] == keyframe - 1;
    if (chosen[k] == keyframe) view = k;
    add_view(map, chosen[k], chosen[k] == keyframe - 1, &window);
  }
  if (!holds_before) return false;
  add_points(map, &window);
  add_observations(*odometry, &window);
  window.covariances = arena_alloc<double>(arena, 36 * static_cast<size_t>(window.sizes.views));
  window.max_iterations = 1;
  if (!adjust_map_window(*odometry, &window, arena)) return false;
  std::copy_n(window.covariances + 36 * view, 36, covariance);
  const Rigid moved = motion_between(map.keyframes[keyframe - 1].cam_from_world,
                                     map.keyframes[keyframe].cam_from_world);
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c) {
      double* entry = &covariance[6 * r + c];
      *entry *= kCorrelation * kCorrelation;
      if (r >= 3 && c >= 3) *entry += (kDrift * moved.t[r - 3]) * (kDrift * moved.t[c - 3]);
    }
  }
  return window.result.has_covariance != 0;
}

void adjust_around(Odometry* odometry, int32_t keyframe, int32_t max_iterations) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  Around around = look_around(odometry, keyframe);
  MapWindow& window = around.window;
  int32_t *shared = around.shared, *chosen = around.chosen;
  const int32_t segment = map.keyframes[keyframe].segment;
  int32_t first = 0;
  while (map.keyframes[first].segment != segment) ++first;
  for (int32_t k = 0; k < around.num_adjusted; ++k) {
    add_view(map, chosen[k], chosen[k] == first, &window);
    shared[chosen[k]] = -1;
  }
  add_points(map, &window);
  // The other keyframes that see the points are held.
  mark_points(&map, window.places, window.model.num_points);
  count_marked_of(map, segment, shared);
  const int32_t num_held =
      largest(shared, map.num_keyframes, kLeastShared, odometry->options.window, chosen);
  for (int32_t k = 0; k < num_held; ++k) add_view(map, chosen[k], true, &window);
  add_observations(*odometry, &window);
  window.max_iterations = max_iterations;
  if (!adjust_map_window(*odometry, &window, odometry->scratch)) return;
  for (int32_t v = 0; v < window.model.num_views; ++v) {
    if (window.views[v].fixed != 0) continue;
    map.keyframes[window.keyframes[v]].cam_from_world = pose_of(window, v);
  }
  keep_positions(window, &map);
  drop_outliers(window, odometry);
  remove_lone_points(&map);
}

}  // namespace tv
