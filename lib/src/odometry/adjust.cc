#include "odometry/adjust.h"

#include <algorithm>
#include <cmath>

#include "geometry/vector3.h"
#include "odometry/window.h"

namespace tv {
namespace {

constexpr int32_t kLeastShared = 10;
// The errors of a keypoint in successive keyframes are alike, so that the standard deviation is
// this many times that of independent ones; and the map's scale drifts by this share from window to
// window. Measured: docs/odometry.md.
constexpr double kCorrelation = 2, kDrift = 0.015;
constexpr float kLeastDepthSigma = 0.002f, kLargestDepthSigma = 1.0f;

int32_t most_views(const tv_odometry_options& o) { return 2 * o.window; }
int32_t most_points(const tv_odometry_options& o) {
  return std::min(6 * o.max_keypoints, o.max_points);
}
int32_t most_observations(const tv_odometry_options& o) { return 14 * o.max_keypoints; }

tv_window largest_window(const tv_odometry_options& options) {
  tv_window window;
  tv_window_init(&window);
  window.num_cameras = 1;
  window.num_views = most_views(options);
  window.num_points = most_points(options);
  window.num_observations = most_observations(options);
  window.num_gravity_priors = window.num_views;
  return window;
}

size_t window_bytes(const tv_odometry_options& options) {
  const tv_window window = largest_window(options);
  return window_scratch_bytes(window);
}

// What is adjusted, with the arrays that tv_window points to.
struct Around {
  tv_window window;
  tv_window_view* views;
  int32_t* keyframes;  // of each view
  double* points;
  int32_t* places;   // of each point in the map
  int32_t* numbers;  // of each place in the map: its point here, or -1
  tv_observation* observations;
  int32_t* keypoints;    // of each observation
  double* planes;        // two of each observation, as adjust_window takes them
  int32_t* shared;       // for each keyframe, how many points it shares with the one in the middle
  int32_t num_adjusted;  // views; the other ones are held
};

void add_view(const Map& map, int32_t keyframe, bool fixed, Around* around) {
  const int32_t v = around->window.num_views++;
  around->keyframes[v] = keyframe;
  tv_window_view* view = &around->views[v];
  const Rigid& pose = map.keyframes[keyframe].cam_from_world;
  std::copy_n(pose.R, 9, view->R);
  std::copy_n(pose.t, 3, view->t);
  view->idx_camera = 0;
  view->fixed = fixed;
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

void add_observations(const Odometry& odometry, int32_t view, int32_t most, Around* around) {
  const Map& map = odometry.map;
  const MapKeyframe& keyframe = map.keyframes[around->keyframes[view]];
  const MapKeypoint* own = keypoints_of(map, keyframe);
  for (int32_t i = 0; i < keyframe.num_keypoints; ++i) {
    if (own[i].point == kNoPoint || around->numbers[own[i].point] < 0) continue;
    if (around->window.num_observations == most) return;
    const int32_t n = around->window.num_observations++;
    tv_observation* o = &around->observations[n];
    *o = tv_observation{};
    o->idx_view = view;
    o->idx_point = around->numbers[own[i].point];
    o->pixel[0] = static_cast<double>(own[i].x);
    o->pixel[1] = static_cast<double>(own[i].y);
    o->sigma = static_cast<float>(sigma_of(own[i]));
    around->keypoints[n] = i;
    Vec2 plane(__builtin_nan(""), 0);
    double* known = keyframe.described < 0 ? plane.data() : planes_of(map, keyframe) + 2 * i;
    if (keyframe.described >= 0 && !(known[0] == known[0]) &&
        undistort(odometry.camera, Vec2(o->pixel[0], o->pixel[1]), &plane)) {
      std::copy_n(plane.data(), 2, known);
    }
    std::copy_n(known, 2, around->planes + 2 * n);
  }
}

Around make_around(Odometry* odometry) {
  Arena& arena = odometry->scratch;
  const tv_odometry_options& options = odometry->options;
  const size_t views = static_cast<size_t>(most_views(options));
  const size_t points = static_cast<size_t>(most_points(options));
  const size_t observations = static_cast<size_t>(most_observations(options));
  Around around{};
  tv_window_init(&around.window);
  around.views = arena_alloc<tv_window_view>(arena, views);
  around.keyframes = arena_alloc<int32_t>(arena, views);
  around.points = arena_alloc<double>(arena, 3 * points);
  around.places = arena_alloc<int32_t>(arena, points);
  around.numbers = arena_alloc<int32_t>(arena, static_cast<size_t>(options.max_points));
  around.observations = arena_alloc<tv_observation>(arena, observations);
  around.keypoints = arena_alloc<int32_t>(arena, observations);
  around.planes = arena_alloc<double>(arena, 2 * observations);
  around.shared = arena_alloc<int32_t>(arena, static_cast<size_t>(odometry->map.num_keyframes));
  return around;
}

// The keyframes that are adjusted: those that share most points with this one, in ascending order.
int32_t* choose_adjusted(Odometry* odometry, int32_t keyframe, Around* around) {
  const int32_t window = odometry->options.window;
  int32_t* chosen = arena_alloc<int32_t>(odometry->scratch, static_cast<size_t>(window) + 1);
  count_shared(odometry, keyframe, around->shared);
  around->num_adjusted =
      largest(around->shared, odometry->map.num_keyframes, kLeastShared, window, chosen);
  for (int32_t i = 1; i < around->num_adjusted; ++i) {  // few: std::sort is half a kilobyte
    for (int32_t k = i; k > 0 && chosen[k] < chosen[k - 1]; --k) {
      std::swap(chosen[k], chosen[k - 1]);
    }
  }
  return chosen;
}

// Adds the points of the views, those of the newest view first.
void add_points(const Odometry& odometry, Around* around) {
  const Map& map = odometry.map;
  const int32_t most = most_points(odometry.options);
  std::fill(around->numbers, around->numbers + odometry.options.max_points, -1);
  for (int32_t v = around->num_adjusted - 1; v >= 0; --v) {
    const MapKeyframe& view = map.keyframes[around->keyframes[v]];
    const MapKeypoint* own = keypoints_of(map, view);
    for (int32_t i = 0; i < view.num_keypoints; ++i) {
      const int32_t p = own[i].point;
      if (p == kNoPoint || around->numbers[p] >= 0) continue;
      if (around->window.num_points == most) break;
      const int32_t n = around->window.num_points++;
      around->numbers[p] = n;
      around->places[n] = p;
      std::copy_n(map.points[p].position, 3, around->points + 3 * n);
    }
  }
}

void add_all_observations(const Odometry& odometry, Around* around) {
  for (int32_t v = 0; v < around->window.num_views; ++v) {
    add_observations(odometry, v, most_observations(odometry.options), around);
  }
}

// Adjusts what was collected, with the measured directions of gravity. False: nothing has changed.
bool solve_window(Odometry* odometry, int32_t max_iterations, Around* around, double* covariances,
                  float* errors, tv_window_result* result) {
  const Map& map = odometry->map;
  tv_window& window = around->window;
  tv_gravity_prior* downs = arena_alloc<tv_gravity_prior>(
      odometry->scratch, static_cast<size_t>(most_views(odometry->options)));
  for (int32_t v = 0; v < around->num_adjusted && odometry->is_upright; ++v) {
    const MapKeyframe& view = map.keyframes[around->keyframes[v]];
    if (view.down_sigma_rad == 0) continue;
    tv_gravity_prior* down = &downs[window.num_gravity_priors++];
    *down = tv_gravity_prior{};
    down->idx_view = v;
    std::copy_n(view.down, 3, down->down);
    down->sigma_rad = view.down_sigma_rad;
  }
  window.gravity_priors = downs;
  window.world_down[1] = 0;
  window.world_down[2] = 1;
  window.num_cameras = 1;
  window.cameras = &odometry->camera.model;
  window.views = around->views;
  window.points = around->points;
  window.observations = around->observations;
  tv_window_options how;
  tv_window_options_init(&how);
  how.max_iterations = max_iterations;
  how.tolerance = 1e-4;
  *result = tv_window_result{};
  return adjust_window(window, how, around->planes, odometry->scratch, covariances, errors, result);
}

// Sets how uncertain the points' depths are from the largest angle between the rays to them.
void measure_depths(Odometry* odometry, const Around& around) {
  Map& map = odometry->map;
  for (int32_t k = 0; k < around.window.num_points; ++k) {
    MapPoint& point = map.points[around.places[k]];
    point.depth_sigma = 0;  // here: the largest squared sine
  }
  double centre[3];
  for (int32_t n = 0, view = -1; n < around.window.num_observations; ++n) {
    const tv_observation& o = around.observations[n];
    MapPoint& point = map.points[around.places[o.idx_point]];
    if (o.idx_view != view) {
      view = o.idx_view;
      centre_of(map.keyframes[around.keyframes[view]].cam_from_world, centre);
    }
    double a[3], b[3], normal[3];
    for (int c = 0; c < 3; ++c) {
      a[c] = point.position[c] - centre[c];
      b[c] = point.position[c] - static_cast<double>(point.seen_from[c]);
    }
    cross(a, b, normal);
    const double sine_sq = dot(normal, normal) / std::max(dot(a, a) * dot(b, b), 1e-300);
    point.depth_sigma = std::max(point.depth_sigma, static_cast<float>(sine_sq));
  }
  for (int32_t k = 0; k < around.window.num_points; ++k) {
    MapPoint& point = map.points[around.places[k]];
    const double sine = std::sqrt(static_cast<double>(point.depth_sigma));
    const double sigma = kTypicalNoise / (odometry->camera.model.fx * std::max(sine, 1e-6));
    point.depth_sigma =
        std::min(std::max(static_cast<float>(sigma), kLeastDepthSigma), kLargestDepthSigma);
  }
}

}  // namespace

size_t adjust_bytes(const tv_odometry_options& o) {
  const size_t views = static_cast<size_t>(most_views(o)) + 1;
  const size_t points = static_cast<size_t>(most_points(o));
  const size_t observations = static_cast<size_t>(most_observations(o));
  const size_t keyframes = static_cast<size_t>(o.max_keyframes);
  return arena_bytes<tv_window_view>(views) + 2 * arena_bytes<int32_t>(views) +
         arena_bytes<int32_t>(keyframes) + arena_bytes<double>(3 * points) +
         arena_bytes<int32_t>(points) + arena_bytes<int32_t>(static_cast<size_t>(o.max_points)) +
         arena_bytes<tv_observation>(observations) + arena_bytes<int32_t>(observations) +
         arena_bytes<double>(2 * observations) + arena_bytes<float>(observations) +
         arena_bytes<double>(36 * views) + arena_bytes<tv_gravity_prior>(views) +
         arena_bytes<uint8_t>(static_cast<size_t>(o.max_points)) +  // of remove_lone_points
         arena_bytes<uint8_t>(window_bytes(o));
}

void count_shared(Odometry* odometry, int32_t keyframe, int32_t* shared) {
  Map* map = &odometry->map;
  clear_marks(map);
  mark_points_of(map, map->keyframes[keyframe]);
  std::fill_n(shared, map->num_keyframes, 0);
  count_marked_of(*map, map->keyframes[keyframe].segment, shared);
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
  ArenaScope scope(odometry->scratch);
  const Map& map = odometry->map;
  Around around = make_around(odometry);
  int32_t* chosen = choose_adjusted(odometry, keyframe, &around);
  bool holds_before = false;
  int32_t view = -1;
  for (int32_t k = 0; k < around.num_adjusted; ++k) {
    holds_before = holds_before || chosen[k] == keyframe - 1;
    if (chosen[k] == keyframe) view = k;
    add_view(map, chosen[k], chosen[k] == keyframe - 1, &around);
  }
  if (!holds_before) return false;
  add_points(*odometry, &around);
  add_all_observations(*odometry, &around);
  double* covariances = arena_alloc<double>(
      odometry->scratch, 36 * static_cast<size_t>(most_views(odometry->options)));
  tv_window_result result;
  if (!solve_window(odometry, 1, &around, covariances, nullptr, &result)) return false;
  std::copy_n(covariances + 36 * view, 36, covariance);
  const Rigid moved = motion_between(map.keyframes[keyframe - 1].cam_from_world,
                                     map.keyframes[keyframe].cam_from_world);
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c) {
      double* entry = &covariance[6 * r + c];
      *entry *= kCorrelation * kCorrelation;
      if (r >= 3 && c >= 3) *entry += (kDrift * moved.t[r - 3]) * (kDrift * moved.t[c - 3]);
    }
  }
  return result.has_covariance != 0;
}

void adjust_around(Odometry* odometry, int32_t keyframe, int32_t max_iterations) {
  ArenaScope scope(odometry->scratch);
  Map& map = odometry->map;
  const tv_odometry_options& options = odometry->options;
  Around around = make_around(odometry);
  int32_t* chosen = choose_adjusted(odometry, keyframe, &around);
  int32_t* shared = around.shared;
  const int32_t segment = map.keyframes[keyframe].segment;
  int32_t first = 0;
  while (map.keyframes[first].segment != segment) ++first;
  for (int32_t k = 0; k < around.num_adjusted; ++k) {
    add_view(map, chosen[k], chosen[k] == first, &around);
    shared[chosen[k]] = -1;
  }
  add_points(*odometry, &around);
  // The other keyframes that see the points are held.
  clear_marks(&map);
  for (int32_t n = 0; n < around.window.num_points; ++n) mark_point(&map, around.places[n]);
  count_marked_of(map, segment, shared);
  const int32_t num_held = largest(shared, map.num_keyframes, kLeastShared, options.window, chosen);
  for (int32_t k = 0; k < num_held; ++k) add_view(map, chosen[k], true, &around);
  add_all_observations(*odometry, &around);
  const tv_window& window = around.window;
  float* errors =
      arena_alloc<float>(odometry->scratch, static_cast<size_t>(window.num_observations));
  tv_window_result result;
  if (!solve_window(odometry, max_iterations, &around, nullptr, errors, &result)) return;
  for (int32_t v = 0; v < window.num_views; ++v) {
    if (around.views[v].fixed) continue;
    Rigid pose;
    std::copy_n(around.views[v].R, 9, pose.R);
    std::copy_n(around.views[v].t, 3, pose.t);
    map.keyframes[around.keyframes[v]].cam_from_world = pose;
  }
  for (int32_t k = 0; k < window.num_points; ++k) {
    std::copy_n(around.points + 3 * k, 3, map.points[around.places[k]].position);
  }
  for (int32_t n = 0; n < window.num_observations; ++n) {
    const tv_observation& o = around.observations[n];
    const double largest_error = kLargestError * static_cast<double>(o.sigma);
    if (errors[n] >= 0 && static_cast<double>(errors[n]) <= largest_error) continue;
    forget_observation(&map, around.keyframes[o.idx_view], around.keypoints[n]);
  }
  measure_depths(odometry, around);
  remove_lone_points(&map, odometry->scratch);
}

}  // namespace tv
