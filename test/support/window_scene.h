// Windows for the tests of tv_adjust_window: views on a path, the points they see, noise, wrong
// observations, priors, and a start that is off. It uses the public headers only, since bench/
// makes its windows with it, too.
#ifndef TEST_SUPPORT_WINDOW_SCENE_H
#define TEST_SUPPORT_WINDOW_SCENE_H

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "twoview/camera.h"
#include "twoview/window.h"

namespace window_scene {

// xorshift64* (S. Vigna 2016).
struct Random {
  uint64_t state;
  explicit Random(uint64_t seed) : state(seed * 0x9e3779b97f4a7c15u + 0x2545f4914f6cdd1du) {}
  double uniform(double low, double high) {
    state ^= state >> 12, state ^= state << 25, state ^= state >> 27;
    return low +
           (high - low) * (static_cast<double>((state * 0x2545f4914f6cdd1du) >> 11) * 0x1p-53);
  }
  double normal() {  // the sum of 12 uniform numbers
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += uniform(0, 1);
    return sum;
  }
};

inline tv_camera pinhole() {
  return tv_camera{TV_CAMERA_PINHOLE, 640, 480, 0, 500, 505, 321, 238, {}};
}

enum class Path { kSideways, kForward, kArc };

struct Options {
  Path path = Path::kSideways;
  int num_views = 10, num_points = 500;
  int shortest_track = 2, longest_track = 8;  // of consecutive views that may see a point
  double noise_px = 0.5, outlier_share = 0;
  double off_rad = 0.005, off_position = 0.05, off_point = 0.05;  // the start
  bool sigmas = false;
  int num_fixed = 2;
  bool pose_priors = false, gravity_priors = false, distance_priors = false;
  tv_camera camera = pinhole();
  uint64_t seed = 1;
};

struct Scene {
  Options options;
  std::vector<tv_camera> cameras;
  std::vector<tv_window_view> true_views, views;
  std::vector<double> true_points, points;
  std::vector<tv_observation> observations;
  std::vector<uint8_t> outlier;  // for each observation
  std::vector<tv_pose_prior> pose_priors;
  std::vector<tv_gravity_prior> gravity_priors;
  std::vector<tv_distance_prior> distance_priors;

  tv_window window() {
    tv_window w;
    tv_window_init(&w);
    w.num_cameras = static_cast<int32_t>(cameras.size());
    w.num_views = static_cast<int32_t>(views.size());
    w.num_points = static_cast<int32_t>(points.size() / 3);
    w.num_observations = static_cast<int32_t>(observations.size());
    w.num_pose_priors = static_cast<int32_t>(pose_priors.size());
    w.num_gravity_priors = static_cast<int32_t>(gravity_priors.size());
    w.num_distance_priors = static_cast<int32_t>(distance_priors.size());
    w.cameras = cameras.data();
    w.views = views.data();
    w.points = points.data();
    w.observations = observations.data();
    w.pose_priors = pose_priors.data();
    w.gravity_priors = gravity_priors.data();
    w.distance_priors = distance_priors.data();
    return w;
  }
};

// exp([w]x) of Rodrigues.
inline void rotation(const double w[3], double R[9]) {
  const double angle = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  const double a = angle > 1e-12 ? std::sin(angle) / angle : 1;
  const double b = angle > 1e-12 ? (1 - std::cos(angle)) / (angle * angle) : 0.5;
  const double K[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double KK = 0;
      for (int k = 0; k < 3; ++k) KK += K[3 * i + k] * K[3 * k + j];
      R[3 * i + j] = (i == j) + a * K[3 * i + j] + b * KK;
    }
  }
}

inline void multiply(const double A[9], const double B[9], double AB[9]) {
  for (int i = 0; i < 9; ++i) {
    AB[i] =
        A[i / 3 * 3] * B[i % 3] + A[i / 3 * 3 + 1] * B[3 + i % 3] + A[i / 3 * 3 + 2] * B[6 + i % 3];
  }
}

inline void transform(const double R[9], const double t[3], const double X[3], double x[3]) {
  for (int i = 0; i < 3; ++i)
    x[i] = R[3 * i] * X[0] + R[3 * i + 1] * X[1] + R[3 * i + 2] * X[2] + t[i];
}

// Writes -R't.
inline void centre(const tv_window_view& view, double C[3]) {
  for (int i = 0; i < 3; ++i) {
    C[i] = -(view.R[i] * view.t[0] + view.R[3 + i] * view.t[1] + view.R[6 + i] * view.t[2]);
  }
}

inline void set_pose(const double R[9], const double C[3], tv_window_view* view) {
  for (int i = 0; i < 9; ++i) view->R[i] = R[i];
  for (int i = 0; i < 3; ++i) {
    view->t[i] = -(R[3 * i] * C[0] + R[3 * i + 1] * C[1] + R[3 * i + 2] * C[2]);
  }
}

// The view turned by w about its centre, which moves by `by`.
inline tv_window_view moved(const tv_window_view& view, const double w[3], const double by[3]) {
  tv_window_view result = view;
  double turn[9], R[9], C[3];
  rotation(w, turn);
  multiply(turn, view.R, R);
  centre(view, C);
  for (int i = 0; i < 3; ++i) C[i] += by[i];
  set_pose(R, C, &result);
  return result;
}

// View k of the path: a step of 0.3 units, and a slow turn.
inline tv_window_view view_on_path(const Options& o, int k, Random* random) {
  double C[3] = {0, 0, 0}, w[3] = {0, 0, 0}, R[9];
  const double s = 0.3 * k;
  if (o.path == Path::kSideways) C[0] = s;
  if (o.path == Path::kForward) C[2] = s;
  if (o.path == Path::kArc) {
    const double angle = 0.08 * k;
    C[0] = 4 * std::sin(angle), C[2] = 6 - 4 * std::cos(angle) - 2;
    w[1] = angle;
  }
  for (int i = 0; i < 3; ++i) C[i] += 0.05 * random->normal(), w[i] += 0.03 * random->normal();
  rotation(w, R);
  tv_window_view view{};
  set_pose(R, C, &view);
  return view;
}

inline bool see(const Scene& s, int v, const double X[3], double pixel[2]) {
  double x[3];
  transform(s.true_views[v].R, s.true_views[v].t, X, x);
  const tv_camera& camera = s.cameras[0];
  return tv_camera_project(&camera, x, pixel, nullptr) == TV_OK && pixel[0] > 0 &&
         pixel[0] < camera.width - 1 && pixel[1] > 0 && pixel[1] < camera.height - 1;
}

// A point that a random view sees, at a depth of 2 to 12 units, and its observations.
inline bool add_point(Scene* s, Random* random) {
  const Options& o = s->options;
  const int first = static_cast<int>(random->uniform(0, o.num_views));
  const tv_window_view& view = s->true_views[first];
  const double pixel[2] = {random->uniform(5, o.camera.width - 6),
                           random->uniform(5, o.camera.height - 6)};
  double ray[3], C[3], X[3];
  if (tv_camera_unproject(&o.camera, pixel, ray, nullptr) != TV_OK) return false;
  const double depth = random->uniform(2, 12);
  centre(view, C);
  for (int i = 0; i < 3; ++i) {
    X[i] = C[i] + depth * (view.R[i] * ray[0] + view.R[3 + i] * ray[1] + view.R[6 + i] * ray[2]);
  }
  const int longest = static_cast<int>(random->uniform(o.shortest_track, o.longest_track + 1));
  const int begin = std::max(0, first - static_cast<int>(random->uniform(0, longest)));
  const size_t size = s->observations.size();
  const int32_t idx = static_cast<int32_t>(s->true_points.size() / 3);
  for (int v = begin; v < std::min(begin + longest, o.num_views); ++v) {
    tv_observation observation{};
    observation.idx_view = v;
    observation.idx_point = idx;
    if (!see(*s, v, X, observation.pixel)) continue;
    observation.sigma = o.sigmas ? static_cast<float>(random->uniform(0.5, 2)) : 0;
    const double noise = o.noise_px * (o.sigmas ? static_cast<double>(observation.sigma) : 1.0);
    const bool wrong = random->uniform(0, 1) < o.outlier_share;
    for (int i = 0; i < 2; ++i) {
      observation.pixel[i] += noise * random->normal() + (wrong ? random->uniform(-40, 40) : 0);
    }
    s->observations.push_back(observation);
    s->outlier.push_back(wrong);
  }
  if (s->observations.size() < size + static_cast<size_t>(o.shortest_track)) {
    s->observations.resize(size);
    s->outlier.resize(size);
    return false;
  }
  s->true_points.insert(s->true_points.end(), X, X + 3);
  return true;
}

inline void add_priors(Scene* s, Random* random) {
  const Options& o = s->options;
  for (int v = 0; v < o.num_views; ++v) {
    const tv_window_view& truth = s->true_views[v];
    if (o.pose_priors && v % 3 == 0) {
      tv_pose_prior prior{};
      prior.idx_view = v;
      double w[3], by[3];
      for (int i = 0; i < 3; ++i) w[i] = 0.01 * random->normal(), by[i] = 0.05 * random->normal();
      const tv_window_view known = moved(truth, w, by);
      std::copy(known.R, known.R + 9, prior.R);
      std::copy(known.t, known.t + 3, prior.t);
      for (int i = 0; i < 6; ++i) prior.information[7 * i] = i < 3 ? 1e4 : 400;
      prior.information[3] = prior.information[18] = 300;  // correlated
      s->pose_priors.push_back(prior);
    }
    if (o.gravity_priors) {
      tv_gravity_prior prior{};
      prior.idx_view = v;
      prior.sigma_rad = 0.02;
      for (int i = 0; i < 3; ++i) {
        prior.down[i] = 9.81 * (truth.R[3 * i + 1] + 0.02 * random->normal());
      }
      s->gravity_priors.push_back(prior);
    }
    if (o.distance_priors && v > 0) {
      tv_distance_prior prior{};
      prior.idx_view0 = v;
      prior.idx_view1 = v / 2;
      double C0[3], C1[3];
      centre(s->true_views[v], C0), centre(s->true_views[v / 2], C1);
      const double d[3] = {C1[0] - C0[0], C1[1] - C0[1], C1[2] - C0[2]};
      prior.sigma = 0.03;
      prior.distance = std::fabs(std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) +
                                 prior.sigma * random->normal());
      s->distance_priors.push_back(prior);
    }
  }
}

inline void make(const Options& options, Scene* s) {
  *s = Scene{};
  s->options = options;
  s->cameras.assign(1, options.camera);
  Random random(options.seed);
  for (int k = 0; k < options.num_views; ++k) {
    s->true_views.push_back(view_on_path(options, k, &random));
  }
  for (int tries = 0; static_cast<int>(s->true_points.size()) < 3 * options.num_points; ++tries) {
    if (tries > 100000) std::abort();
    add_point(s, &random);
  }
  add_priors(s, &random);
  for (int v = 0; v < options.num_views; ++v) {
    double w[3], by[3];
    for (int i = 0; i < 3; ++i) {
      w[i] = options.off_rad * random.normal();
      by[i] = options.off_position * random.normal();
    }
    const bool fixed = v < options.num_fixed;
    s->views.push_back(fixed ? s->true_views[v] : moved(s->true_views[v], w, by));
    s->views.back().fixed = fixed;
  }
  for (double x : s->true_points) s->points.push_back(x + options.off_point * random.normal());
}

}  // namespace window_scene

#endif
