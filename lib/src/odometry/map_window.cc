#include "odometry/map_window.h"

#include <algorithm>
#include <cmath>

#include "adjust/window.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

// A window assumes a noise of one pixel for a corner, twice the real one. The standard deviations
// of the velocities are multiplied by the same factor, so that the weights stay in proportion.
constexpr double kNoise = 2;
constexpr double kLargestShare = 0.5;  // of a way, by which the map may contradict it
constexpr float kLeastDepthSigma = 0.002f, kLargestDepthSigma = 1.0f;

size_t count_of(int32_t n) { return static_cast<size_t>(n); }

tv_window largest_window(const WindowSizes& sizes) {
  tv_window window;
  tv_window_init(&window);
  window.num_cameras = 1;
  window.num_views = window.num_gravity_priors = window.num_distance_priors = sizes.views;
  window.num_points = sizes.points;
  window.num_observations = sizes.observations;
  return window;
}

void take_arrays(const WindowSizes& sizes, int32_t max_points, Arena& arena, MapWindow* window) {
  const size_t views = count_of(sizes.views), points = count_of(sizes.points);
  const size_t observations = count_of(sizes.observations);
  window->views = arena_alloc<tv_window_view>(arena, views);
  window->keyframes = arena_alloc<int32_t>(arena, views);
  window->points = arena_alloc<double>(arena, 3 * points);
  window->places = arena_alloc<int32_t>(arena, points);
  window->numbers = arena_alloc<int32_t>(arena, count_of(max_points));
  window->observations = arena_alloc<tv_observation>(arena, observations);
  window->keypoints = arena_alloc<int32_t>(arena, observations);
  window->planes = arena_alloc<double>(arena, 2 * observations);
  window->gravity = arena_alloc<tv_gravity_prior>(arena, views);
  window->distances = arena_alloc<tv_distance_prior>(arena, views);
  window->sines_sq = arena_alloc<float>(arena, points);
  window->errors = arena_alloc<float>(arena, observations);
}

void add_observations_of(const Odometry& odometry, int32_t view, MapWindow* window) {
  const Map& map = odometry.map;
  const MapKeyframe& keyframe = map.keyframes[window->keyframes[view]];
  const MapKeypoint* own = keypoints_of(map, keyframe);
  const int32_t* seen = seen_by(map, keyframe);
  for (int32_t i = 0; i < keyframe.num_keypoints; ++i) {
    if (seen[i] == kNoPoint || window->numbers[seen[i]] < 0) continue;
    if (window->model.num_observations == window->sizes.observations) return;
    const int32_t n = window->model.num_observations++;
    tv_observation* o = &window->observations[n];
    *o = tv_observation{};
    o->idx_view = view;
    o->idx_point = window->numbers[seen[i]];
    o->pixel[0] = static_cast<double>(own[i].x);
    o->pixel[1] = static_cast<double>(own[i].y);
    o->sigma = static_cast<float>(sigma_of(own[i]));
    window->keypoints[n] = i;
    Vec2 plane(__builtin_nan(""), 0);
    double* known = keyframe.described < 0 ? plane.data() : planes_of(map, keyframe) + 2 * i;
    if (keyframe.described >= 0 && !(known[0] == known[0]) &&
        undistort(odometry.camera, Vec2(o->pixel[0], o->pixel[1]), &plane)) {
      std::copy_n(plane.data(), 2, known);
    }
    std::copy_n(known, 2, window->planes + 2 * n);
  }
}

// Sets how uncertain the points' depths are from the largest angle between the rays to them.
void measure_depths(const MapWindow& window, Odometry* odometry) {
  Map& map = odometry->map;
  std::fill_n(window.sines_sq, window.model.num_points, 0.0f);
  double centre[3];
  for (int32_t n = 0, view = -1; n < window.model.num_observations; ++n) {
    const tv_observation& o = window.observations[n];
    const MapPoint& point = map.points[window.places[o.idx_point]];
    if (o.idx_view != view) {
      view = o.idx_view;
      centre_of(map.keyframes[window.keyframes[view]].cam_from_world, centre);
    }
    double a[3], b[3], normal[3];
    for (int c = 0; c < 3; ++c) {
      a[c] = point.position[c] - centre[c];
      b[c] = point.position[c] - static_cast<double>(point.seen_from[c]);
    }
    cross(a, b, normal);
    const double sine_sq =
        length_sq_of(normal) / std::max(length_sq_of(a) * length_sq_of(b), 1e-300);
    float* largest = &window.sines_sq[o.idx_point];
    *largest = std::max(*largest, static_cast<float>(sine_sq));
  }
  for (int32_t k = 0; k < window.model.num_points; ++k) {
    const double sine = std::sqrt(static_cast<double>(window.sines_sq[k]));
    const double sigma = kTypicalNoise / (odometry->camera.model.fx * std::max(sine, 1e-6));
    map.points[window.places[k]].depth_sigma =
        std::min(std::max(static_cast<float>(sigma), kLeastDepthSigma), kLargestDepthSigma);
  }
}

// What sensors say of a view: gravity, and in a map in metres the length of the way from the
// keyframe before, if it is in the window, too. Left out are a way within the velocities' noise,
// which makes it longer, and one that the map's contradicts: it does not drift so much between two
// keyframes.
void add_priors(const Odometry& odometry, int32_t view, MapWindow* window) {
  tv_window& model = window->model;
  const int32_t k = window->keyframes[view];
  const MapKeyframe& own = odometry.map.keyframes[k];
  if (odometry.is_upright && own.down_sigma_rad > 0) {
    window->gravity[model.num_gravity_priors++] = {
        view, 0, {own.down[0], own.down[1], own.down[2]}, own.down_sigma_rad};
  }
  if (odometry.scale.source == TV_SCALE_UNIT || own.segment != odometry.segment || k == 0 ||
      !(own.way_variance > 0) || own.is_contrary) {
    return;
  }
  const double way = length_of(own.way_m), sigma = kNoise * std::sqrt(own.way_variance);
  const double way_here =
      way_between(own.cam_from_world, odometry.map.keyframes[k - 1].cam_from_world);
  if (!(way > sigma && std::fabs(way_here - way) < kLargestShare * way)) return;
  for (int32_t v = 0; v < model.num_views; ++v) {
    if (window->keyframes[v] != k - 1) continue;
    window->distances[model.num_distance_priors++] = {v, view, way, sigma};
  }
}

}  // namespace

size_t map_window_bytes(const tv_odometry_options& options, const WindowSizes& sizes) {
  MapWindow window{};
  Arena arena = measuring_arena();
  take_arrays(sizes, options.max_points, arena, &window);
  return arena.used_bytes + window_scratch_bytes(largest_window(sizes));
}

MapWindow make_map_window(const Odometry& odometry, const WindowSizes& sizes, Arena& arena) {
  const int32_t places = odometry.options.max_points;
  MapWindow window{};
  window.sizes = sizes;
  window.damping = WindowStart{}.damping;
  tv_window_init(&window.model);
  take_arrays(sizes, places, arena, &window);
  std::fill(window.numbers, window.numbers + places, -1);
  return window;
}

void add_view(const Map& map, int32_t keyframe, bool fixed, MapWindow* window) {
  const int32_t v = window->model.num_views++;
  window->keyframes[v] = keyframe;
  tv_window_view* view = &window->views[v];
  write_rigid(map.keyframes[keyframe].cam_from_world, view->R, view->t);
  view->idx_camera = 0;
  view->fixed = fixed;
}

void add_map_point(const Map& map, int32_t place, MapWindow* window) {
  const int32_t n = window->model.num_points++;
  window->numbers[place] = n;
  window->places[n] = place;
  std::copy_n(map.points[place].position, 3, window->points + 3 * n);
}

void add_observations(const Odometry& odometry, MapWindow* window) {
  for (int32_t v = 0; v < window->model.num_views; ++v) add_observations_of(odometry, v, window);
}

bool adjust_map_window(const Odometry& odometry, MapWindow* window, Arena& arena) {
  tv_window& model = window->model;
  for (int32_t v = 0; v < model.num_views; ++v) {
    if (window->views[v].fixed == 0) add_priors(odometry, v, window);
  }
  model.gravity_priors = window->gravity;
  model.distance_priors = window->distances;
  model.world_down[1] = 0;
  model.world_down[2] = 1;
  model.num_cameras = 1;
  model.cameras = &odometry.camera.model;
  model.views = window->views;
  model.points = window->points;
  model.observations = window->observations;
  tv_window_options how;
  tv_window_options_init(&how);
  how.max_iterations = window->max_iterations;
  how.tolerance = 1e-4;
  return adjust_window(model, how, {odometry.kernels, window->planes, window->damping}, arena,
                       window->covariances, window->errors, &window->result);
}

Rigid pose_of(const MapWindow& window, int32_t view) {
  return rigid_of(window.views[view].R, window.views[view].t);
}

void keep_positions(const MapWindow& window, Map* map) {
  for (int32_t k = 0; k < window.model.num_points; ++k) {
    std::copy_n(window.points + 3 * k, 3, map->points[window.places[k]].position);
  }
}

void drop_outliers(const MapWindow& window, Odometry* odometry) {
  for (int32_t n = 0; n < window.model.num_observations; ++n) {
    const tv_observation& o = window.observations[n];
    const double largest_error = kLargestError * static_cast<double>(o.sigma);
    const float error = window.errors[n];
    if (error >= 0 && static_cast<double>(error) <= largest_error) continue;
    forget_observation(&odometry->map, window.keyframes[o.idx_view], window.keypoints[n]);
  }
  measure_depths(window, odometry);
}

}  // namespace tv
