// The window's bundle adjustment compared with Ceres: the same cost, written independently with
// quaternions and automatic derivatives, must reach the same minimum from the same start.
#include <ceres/ceres.h>
#include <ceres/manifold.h>
#include <ceres/rotation.h>

#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>

#include "support/window_scene.h"
#include "unity.h"

using window_scene::Options;
using window_scene::Path;
using window_scene::Scene;

static Scene scene;

void setUp() {}
void tearDown() {}

namespace {

// Of this process's CPU, so that other processes disturb less.
double now_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// A pose is a quaternion (w x y z) and t.
template <typename T>
void to_camera(const T* pose, const T* X, T x[3]) {
  ceres::QuaternionRotatePoint(pose, X, x);
  for (int i = 0; i < 3; ++i) x[i] += pose[4 + i];
}

// A pinhole's residual is that of the textbook. Of the other lenses, it is the projection
// linearised at the pixel's ray, with the derivative of tv_camera_project.
struct ObservationError {
  const tv_camera* camera;
  double pixel[2], sigma, ray[3], J[6];
  bool sphere;
  template <typename T>
  bool operator()(const T* pose, const T* X, T* e) const {
    T x[3];
    to_camera(pose, X, x);
    if (camera->model == TV_CAMERA_PINHOLE) {
      if (!(x[2] > 0.0)) return false;
      e[0] = (camera->fx * x[0] / x[2] + camera->cx - pixel[0]) / sigma;
      e[1] = (camera->fy * x[1] / x[2] + camera->cy - pixel[1]) / sigma;
      return true;
    }
    // Where the point meets the plane z = ray_z, or that which touches the sphere at the ray.
    const T depth = sphere ? ray[0] * x[0] + ray[1] * x[1] + ray[2] * x[2] : x[2] / ray[2];
    if (!(depth > 0.0)) return false;
    for (int r = 0; r < 2; ++r) {
      e[r] = T(0);
      for (int i = 0; i < 3; ++i) e[r] += J[3 * r + i] * (x[i] / depth - ray[i]) / sigma;
    }
    return true;
  }
};

struct PoseError {
  const tv_pose_prior* prior;
  double root[36];  // its transpose times itself is the information
  template <typename T>
  bool operator()(const T* pose, T* e) const {
    T R[9], known_t[3], turn[9], w[3], r[6];
    ceres::QuaternionToRotation(pose, R);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        turn[i + 3 * j] = T(0);  // column-major, R R0'
        for (int k = 0; k < 3; ++k) turn[i + 3 * j] += R[3 * i + k] * prior->R[3 * j + k];
      }
    }
    ceres::RotationMatrixToAngleAxis(turn, w);
    for (int i = 0; i < 3; ++i) {
      known_t[i] = turn[i] * prior->t[0] + turn[i + 3] * prior->t[1] + turn[i + 6] * prior->t[2];
      r[i] = w[i];
      r[3 + i] = pose[4 + i] - known_t[i];
    }
    for (int i = 0; i < 6; ++i) {
      e[i] = T(0);
      for (int j = 0; j < 6; ++j) e[i] += root[6 * i + j] * r[j];
    }
    return true;
  }
};

struct GravityError {
  const tv_gravity_prior* prior;
  double world[3], factor;
  template <typename T>
  bool operator()(const T* pose, T* e) const {
    const T down[3] = {T(world[0]), T(world[1]), T(world[2])};
    T h[3];
    ceres::QuaternionRotatePoint(pose, down, h);
    const double* g = prior->down;
    const double length = std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
    for (int i = 0; i < 3; ++i) e[i] = factor / prior->sigma_rad * (h[i] - g[i] / length);
    return true;
  }
};

struct DistanceError {
  const tv_distance_prior* prior;
  double factor;
  template <typename T>
  bool operator()(const T* pose0, const T* pose1, T* e) const {
    using std::sqrt;
    T sum(0), C[2][3];
    const T* poses[2] = {pose0, pose1};
    for (int v = 0; v < 2; ++v) {
      const T inverse[4] = {poses[v][0], -poses[v][1], -poses[v][2], -poses[v][3]};
      ceres::QuaternionRotatePoint(inverse, poses[v] + 4, C[v]);
    }
    for (int i = 0; i < 3; ++i) sum += (C[1][i] - C[0][i]) * (C[1][i] - C[0][i]);
    e[0] = factor / prior->sigma * (sqrt(sum) - prior->distance);
    return true;
  }
};

// The upper Cholesky factor.
void root_of(const double M[36], double factor, double root[36]) {
  std::fill(root, root + 36, 0.0);
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) {
      double value = M[6 * i + j];
      for (int k = 0; k < i; ++k) value -= root[6 * k + i] * root[6 * k + j];
      root[6 * i + j] = i == j ? std::sqrt(value) : value / root[7 * i];
    }
  }
  for (int i = 0; i < 36; ++i) root[i] *= factor;
}

struct Answer {
  double initial_cost, cost, ms;
  int iterations;
};

ceres::LossFunction* loss_of(const tv_window_options& options) {
  if (options.loss == TV_LOSS_HUBER) return new ceres::HuberLoss(options.loss_scale_px);
  if (options.loss == TV_LOSS_CAUCHY) return new ceres::CauchyLoss(options.loss_scale_px);
  return nullptr;
}

// Adjusts the views and points of the scene. With `tight`, Ceres converges to rounding error; else
// it uses its default tolerances.
Answer solve_ceres(Scene* s, const tv_window_options& options, bool tight) {
  const double begin = now_ms();
  std::vector<double> poses;
  for (const tv_window_view& view : s->views) {
    double columns[9], q[4];
    for (int i = 0; i < 9; ++i) columns[3 * (i % 3) + i / 3] = view.R[i];
    ceres::RotationMatrixToQuaternion(columns, q);
    poses.insert(poses.end(), q, q + 4);
    poses.insert(poses.end(), view.t, view.t + 3);
  }
  ceres::Problem problem;
  auto* ordering = new ceres::ParameterBlockOrdering;
  using Manifold = ceres::ProductManifold<ceres::QuaternionManifold, ceres::EuclideanManifold<3>>;
  for (size_t v = 0; v < s->views.size(); ++v) {
    problem.AddParameterBlock(&poses[7 * v], 7, new Manifold);
    ordering->AddElementToGroup(&poses[7 * v], 1);
    if (s->views[v].fixed != 0) problem.SetParameterBlockConstant(&poses[7 * v]);
  }
  for (const tv_observation& o : s->observations) {
    auto* error = new ObservationError;
    error->camera = &s->cameras[0];
    error->sphere = error->camera->model == TV_CAMERA_KANNALA_BRANDT;
    error->sigma = o.sigma == 0 ? 1 : static_cast<double>(o.sigma);
    double seen[2];
    std::copy(o.pixel, o.pixel + 2, error->pixel);
    if (tv_camera_unproject(error->camera, o.pixel, error->ray, nullptr) != TV_OK ||
        tv_camera_project(error->camera, error->ray, seen, error->J) != TV_OK) {
      delete error;
      continue;
    }
    double* X = &s->points[3 * static_cast<size_t>(o.idx_point)];
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ObservationError, 2, 7, 3>(error),
                             loss_of(options), &poses[7 * static_cast<size_t>(o.idx_view)], X);
    ordering->AddElementToGroup(X, 0);
  }
  for (const tv_pose_prior& prior : s->pose_priors) {
    auto* error = new PoseError{&prior, {}};
    root_of(prior.information, options.noise_px, error->root);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseError, 6, 7>(error), nullptr,
                             &poses[7 * static_cast<size_t>(prior.idx_view)]);
  }
  for (const tv_gravity_prior& prior : s->gravity_priors) {
    auto* error = new GravityError{&prior, {0, 1, 0}, options.noise_px};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<GravityError, 3, 7>(error), nullptr,
                             &poses[7 * static_cast<size_t>(prior.idx_view)]);
  }
  for (const tv_distance_prior& prior : s->distance_priors) {
    auto* error = new DistanceError{&prior, options.noise_px};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<DistanceError, 1, 7, 7>(error),
                             nullptr, &poses[7 * static_cast<size_t>(prior.idx_view0)],
                             &poses[7 * static_cast<size_t>(prior.idx_view1)]);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering.reset(ordering);
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  if (tight) {
    solver.max_num_iterations = 500;
    solver.max_num_consecutive_invalid_steps = 100;
    solver.function_tolerance = 1e-14;
    solver.gradient_tolerance = 1e-16;
    solver.parameter_tolerance = 1e-16;
  }
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  for (size_t v = 0; v < s->views.size(); ++v) {
    ceres::QuaternionToRotation(&poses[7 * v], s->views[v].R);
    std::copy(&poses[7 * v + 4], &poses[7 * v + 7], s->views[v].t);
  }
  return Answer{2 * summary.initial_cost, 2 * summary.final_cost, now_ms() - begin,
                static_cast<int>(summary.iterations.size()) - 1};
}

Answer solve_ours(Scene* s, const tv_window_options& options, tv_window_result* result) {
  static std::vector<uint8_t> memory;
  const tv_window window = s->window();
  size_t size = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_adjust_window_size(&window, &size));
  if (memory.size() < size + 64) memory.resize(size + 64);
  void* aligned = memory.data() + (64 - reinterpret_cast<uintptr_t>(memory.data()) % 64) % 64;
  tv_window_result_init(result);
  const double begin = now_ms();
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_adjust_window(aligned, size, &window, &options, nullptr, nullptr, result));
  return Answer{result->initial_cost, result->final_cost, now_ms() - begin, result->num_iterations};
}

tv_window_options options_of(tv_loss loss, double scale_px) {
  tv_window_options options;
  tv_window_options_init(&options);
  options.loss = loss;
  options.loss_scale_px = scale_px;
  return options;
}

// How often ours ended in another minimum than Ceres, with a lower or a higher cost.
struct Others {
  int lower, higher;
};

// Where ours is another minimum, it must be one: Ceres, started there, must not lower it. Only with
// Cauchy's loss may it be the higher one.
void expect_same_minimum(const Options& options, const tv_window_options& adjust, Others* others) {
  window_scene::make(options, &scene);
  tv_window_options tight = adjust;
  tight.tolerance = 1e-9;
  tight.max_iterations = 200;
  tv_window_result result;
  Scene theirs = scene;
  const Answer our = solve_ours(&scene, tight, &result);
  Answer their = solve_ceres(&theirs, adjust, true);
  double gap = (our.cost - their.cost) / their.cost;
  char text[240];
  std::snprintf(text, sizeof text,
                "seed %d: %d views, %d points, %d observations, outliers %g, loss %d: cost %.12g "
                "against %.12g, relative %.2g; %d and %d iterations",
                static_cast<int>(options.seed), options.num_views, options.num_points,
                result.num_observations, options.outlier_share, adjust.loss, our.cost, their.cost,
                gap, our.iterations, their.iterations);
  if (std::getenv("TWOVIEW_VERBOSE") != nullptr) std::printf("%s\n", text);
  TEST_ASSERT_EQUAL_INT_MESSAGE(static_cast<int>(scene.observations.size()),
                                result.num_observations, text);
  TEST_ASSERT_TRUE_MESSAGE(
      std::fabs(our.initial_cost - their.initial_cost) <= 1e-9 * their.initial_cost, text);
  TEST_ASSERT_TRUE_MESSAGE(result.converged, text);
  if (gap < -1e-6 || (gap > 1e-6 && adjust.loss == TV_LOSS_CAUCHY)) {
    ++(gap < 0 ? others->lower : others->higher);
    their = solve_ceres(&scene, adjust, true);
    gap = (our.cost - their.cost) / their.cost;
  }
  TEST_ASSERT_TRUE_MESSAGE(std::fabs(gap) <= 1e-6, text);
}

void test_reaches_the_minimum_that_ceres_finds() {
  Others others{0, 0};
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    window_scene::Random random(seed + 1000);
    Options o;
    o.seed = seed;
    o.path = static_cast<Path>(seed % 3);
    o.num_views = 5 + static_cast<int>(random.uniform(0, 16));
    o.num_points = 15 * o.num_views + static_cast<int>(random.uniform(0, 300));
    o.shortest_track = 2;
    o.longest_track = 5 + static_cast<int>(random.uniform(0, 15));
    o.noise_px = random.uniform(0.1, 1.5);
    o.num_fixed = static_cast<int>(seed / 3 % 3);
    o.sigmas = seed % 2 == 0;
    o.pose_priors = seed % 5 == 1;
    o.gravity_priors = seed % 5 == 2 || seed % 10 == 3;
    o.distance_priors = seed % 5 == 4 || seed % 10 == 3;
    const tv_loss loss = static_cast<tv_loss>(seed / 2 % 3);
    if (loss != TV_LOSS_NONE) {  // a point with three views and a wrong one has several minima
      o.outlier_share = random.uniform(0, 0.2);
      o.shortest_track = 5;
    }
    if (loss == TV_LOSS_CAUCHY) {
      // Its minima are many: the start and the steps decide which one is found.
      o.off_rad = 0.001, o.off_position = 0.005, o.off_point = 0.005;
    }
    tv_window_options options = options_of(loss, random.uniform(1, 3));
    options.noise_px = o.noise_px;
    expect_same_minimum(o, options, &others);
  }
  std::printf("of 100 windows ours ended lower in %d, higher in %d\n", others.lower, others.higher);
  TEST_ASSERT_TRUE(others.lower + others.higher <= 2);
}

void print_times() {
  for (int num_views : {7, 10, 20}) {
    for (int num_points : {1000, 3000}) {
      for (double outliers : {0.0, 0.1}) {
        Options o;
        o.num_views = num_views;
        o.num_points = num_points;
        o.longest_track = num_views;
        o.outlier_share = outliers;
        const tv_window_options options =
            options_of(outliers > 0 ? TV_LOSS_CAUCHY : TV_LOSS_NONE, 2);
        window_scene::make(o, &scene);
        const Scene start = scene;
        Answer our{}, their{};
        double ms = 1e9, ms_ceres = 1e9;
        tv_window_result result;
        for (int k = 0; k < 10; ++k) {
          scene = start;
          our = solve_ours(&scene, options, &result);
          ms = std::min(ms, our.ms);
        }
        for (int k = 0; k < 3; ++k) {
          scene = start;
          their = solve_ceres(&scene, options, false);
          ms_ceres = std::min(ms_ceres, their.ms);
        }
        std::printf(
            "%2d views, %4d points, %5d observations, outliers %.1f: %.2f ms (%d steps, "
            "%.9g), Ceres %.1f ms (%d steps, %.9g), ratio %.1f\n",
            num_views, num_points, result.num_observations, outliers, ms, our.iterations, our.cost,
            ms_ceres, their.iterations, their.cost, ms_ceres / ms);
      }
    }
  }
}

}  // namespace

// With --time the program prints times instead of testing.
int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--time") == 0) {
    print_times();
    return 0;
  }
  UNITY_BEGIN();
  RUN_TEST(test_reaches_the_minimum_that_ceres_finds);
  return UNITY_END();
}
