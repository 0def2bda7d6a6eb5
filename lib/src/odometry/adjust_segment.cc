#include "odometry/adjust_segment.h"

#include <algorithm>

#include "odometry/map_window.h"
#include "odometry/metric.h"

namespace tv {
namespace {

constexpr int32_t kMostKeyframes = 256;
// Of the older keyframes so many are held. With more of them the others have fewer observations,
// and their covariance holds the truth less often (docs/decisions/0031-loops-adjusted-together.md).
constexpr int32_t kHeldOneIn = 4;
// Points are chosen until each keyframe sees its share of the observations divided by this: a point
// that is chosen for one keyframe has observations in the others.
constexpr double kOverlap = 1.7;
// The damping of the first step. With a hundred times as much, each step corrects only a tenth of
// the bend of a long path.
constexpr double kDamping = 1e-6;
constexpr double kLeastGain = 1e-3;  // share of the cost that a step must gain for another one

WindowSizes sizes_of(const tv_odometry_options& o) {
  return {std::min(o.max_keyframes, kMostKeyframes), std::min(6 * o.max_keypoints, o.max_points),
          22 * o.max_keypoints};
}

// Adds every `step`th of the keyframes begin..end - 1 that are of the segment. False: there are too
// many.
bool add_keyframes(const Map& map, int32_t segment, int32_t begin, int32_t end, int32_t step,
                   bool fixed, MapWindow* window) {
  for (int32_t k = begin; k < end; k += step) {
    if (map.keyframes[k].segment != segment) continue;
    if (window->model.num_views == window->sizes.views) return false;
    add_view(map, k, fixed, window);
  }
  return true;
}

// Adds points, those that most keyframes see before the others, until each free view (these come
// first) sees enough of them.
void add_shared_points(const Map& map, int32_t num_free, MapWindow* window) {
  const WindowSizes& sizes = window->sizes;
  const int32_t wanted =
      static_cast<int32_t>(sizes.observations / (kOverlap * window->model.num_views));
  int32_t left = sizes.observations;
  bool sees_enough[kMostKeyframes] = {};
  for (int32_t least = 16; least > 1; least /= 2) {
    for (int32_t v = 0; v < num_free; ++v) {
      if (sees_enough[v]) continue;
      const MapKeyframe& view = map.keyframes[window->keyframes[v]];
      const int32_t* seen = seen_by(map, view);
      int32_t num_seen = 0;
      for (int32_t i = 0; i < view.num_keypoints; ++i) {
        num_seen += seen[i] != kNoPoint && window->numbers[seen[i]] >= 0;
      }
      for (int32_t i = 0; i < view.num_keypoints && num_seen < wanted; ++i) {
        const int32_t p = seen[i];
        if (p == kNoPoint || window->numbers[p] >= 0) continue;
        const int32_t num = map.points[p].num_observations;
        if (num < least || num > left || window->model.num_points == sizes.points) continue;
        add_map_point(map, p, window);
        left -= num;
        ++num_seen;
      }
      sees_enough[v] = num_seen >= wanted;
    }
  }
}

// Which views share a point, in a matrix of bytes, 0 or 1.
struct Sharing {
  int32_t num_words;  // of a row, eight views each
  uint64_t* words;

  uint64_t* row(int32_t view) const { return words + num_words * view; }
  uint8_t* at(int32_t view) const { return reinterpret_cast<uint8_t*>(row(view)); }
};

// Which of the first num_views views share a point. `last` has room for the window's points and
// observations, and holds -1 for each of the points.
Sharing find_sharing(const MapWindow& window, int32_t num_views, int32_t* last, Arena& arena) {
  Sharing sharing{(num_views + 7) / 8, nullptr};
  const int32_t size = sharing.num_words * num_views;
  sharing.words = arena_alloc<uint64_t>(arena, static_cast<size_t>(size));
  std::fill_n(sharing.words, size, 0);
  // The observations of a point are a list, from its last one on.
  int32_t* before = last + window.model.num_points;
  for (int32_t n = 0; n < window.model.num_observations; ++n) {
    const tv_observation& o = window.observations[n];
    if (o.idx_view >= num_views) break;  // observations are in the order of the views
    before[n] = last[o.idx_point];
    last[o.idx_point] = n;
    for (int32_t k = n; k >= 0; k = before[k]) {
      const int32_t other = window.observations[k].idx_view;
      sharing.at(o.idx_view)[other] = sharing.at(other)[o.idx_view] = 1;
    }
  }
  return sharing;
}

// Gives the free views, which are the first ones, a new order, in which fewer blocks of the factor
// of their system are not zero: next comes always the view that shares a block with the fewest of
// those that are left (A. George, J. Liu, "The evolution of the minimum degree ordering algorithm",
// SIAM Review 1989). The first view stays, because it may be held.
void order_views(const Map& map, int32_t num, MapWindow* window, Arena arena) {
  const int32_t num_views = window->model.num_views;
  const int32_t num_numbers = 2 * num + window->model.num_points + window->model.num_observations;
  int32_t* keyframes = arena_alloc<int32_t>(arena, static_cast<size_t>(num_numbers));
  int32_t* rank = keyframes + num;
  std::fill_n(keyframes, num_numbers, -1);
  std::copy_n(window->keyframes, num, keyframes);
  const Sharing sharing = find_sharing(*window, num, rank + num, arena);
  window->model.num_views = 0;
  for (int32_t place = 0, view = 0; place < num; ++place) {
    uint64_t least = UINT64_MAX;
    for (int32_t v = 0; v < num && place > 0; ++v) {
      if (rank[v] >= 0) continue;
      uint64_t sums = 0;
      for (int32_t w = 0; w < sharing.num_words; ++w) sums += sharing.row(v)[w];
      const uint64_t degree = sums * 0x0101010101010101u >> 56;
      if (degree < least) least = degree, view = v;
    }
    rank[view] = place;
    add_view(map, keyframes[view], false, window);
    sharing.at(view)[view] = 0;
    for (int32_t v = 0; v < num; ++v) {
      if (sharing.at(view)[v] == 0) continue;
      sharing.at(v)[view] = 0;
      for (int32_t w = 0; w < sharing.num_words; ++w) sharing.row(v)[w] |= sharing.row(view)[w];
    }
  }
  window->model.num_views = num_views;
  for (int32_t n = 0; n < window->model.num_observations; ++n) {
    int32_t* view = &window->observations[n].idx_view;
    if (*view < num) *view = rank[*view];
  }
}

}  // namespace

size_t adjust_segment_bytes(const tv_odometry_options& o) {
  return map_window_bytes(o, sizes_of(o)) +
         arena_bytes<MovedKeyframe>(static_cast<size_t>(o.max_keyframes));
}

bool adjust_segment(Odometry* odometry, int32_t segment, int32_t first_id, int32_t max_iterations) {
  Arena arena = odometry->whole_scratch;
  Map& map = odometry->map;
  MapWindow window = make_map_window(*odometry, sizes_of(odometry->options), arena);
  const int32_t first = first_from(map, first_id);
  // With a known gravity no keyframe is held from the first one on (without it, adjust_window holds
  // the first one): a held keyframe could only reach its place by a motion of all others, which the
  // adjustment's steps find last.
  if (!add_keyframes(map, segment, first, map.num_keyframes, 1, false, &window)) return false;
  const int32_t num_free = window.model.num_views;
  if (!add_keyframes(map, segment, 0, first, kHeldOneIn, true, &window)) return false;
  add_shared_points(map, num_free, &window);
  add_observations(*odometry, &window);
  order_views(map, num_free, &window, arena);
  MovedKeyframe* moved = arena_alloc<MovedKeyframe>(arena, static_cast<size_t>(map.num_keyframes));
  window.max_iterations = max_iterations;
  window.damping = kDamping;
  window.errors = nullptr;  // the points' adjustment that follows measures them
  if (!adjust_map_window(*odometry, &window, arena)) return false;
  for (int32_t k = 0; k < map.num_keyframes; ++k) moved[k].scale = 0;
  for (int32_t v = 0; v < num_free; ++v) {
    moved[window.keyframes[v]] = {pose_of(window, v), 1};
  }
  move_keyframes(&map, moved);
  if (segment == odometry->segment) gather_ways(odometry);
  keep_positions(window, &map);
  return window.result.final_cost < (1 - kLeastGain) * window.result.initial_cost;
}

int32_t adjust_points(Odometry* odometry, int32_t segment, int32_t first, int32_t max_iterations) {
  Arena arena = odometry->whole_scratch;
  const Map& map = odometry->map;
  MapWindow window = make_map_window(*odometry, sizes_of(odometry->options), arena);
  if (!add_keyframes(map, segment, 0, map.num_keyframes, 1, true, &window)) return map.end_points;
  int32_t left = window.sizes.observations, place = first;
  for (; place < map.end_points && window.model.num_points < window.sizes.points; ++place) {
    const MapPoint& point = map.points[place];
    if (point.id < 0 || point.segment != segment) continue;
    if (point.num_observations > left) {
      if (window.model.num_points > 0) break;
      continue;  // no window has room for it
    }
    left -= point.num_observations;
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
