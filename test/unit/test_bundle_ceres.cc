// Two-view bundle adjustment compared with Ceres: the same cost, written independently with
// homogeneous points and automatic derivatives, must reach the same minimum from the same start.
#include <ceres/ceres.h>
#include <ceres/manifold.h>
#include <ceres/rotation.h>

#include <chrono>
#include <cstdlib>
#include <vector>

#include "support/bundle_scene.h"
#include "support/calls.h"
#include "twoview/alloc.h"

using bundle_scene::Geometry;
using bundle_scene::Options;
using bundle_scene::Scene;

static Scene pair;
static tv_point points[bundle_scene::kMaxPoints];

void setUp() {}
void tearDown() {}

namespace {

double now_ms() {
  using namespace std::chrono;
  return duration<double, std::milli>(steady_clock::now().time_since_epoch()).count();
}

template <typename T>
void project(const tv_camera& camera, const T X[3], T pixel[2]) {
  using std::atan2;
  using std::sqrt;
  const double* k = camera.k;
  T x = X[0] / X[2], y = X[1] / X[2];
  if (camera.model == TV_CAMERA_BROWN_CONRADY) {
    const T u = x * x + y * y;
    const T radial =
        (1.0 + u * (k[0] + u * (k[1] + u * k[4]))) / (1.0 + u * (k[5] + u * (k[6] + u * k[7])));
    const T xx = x * radial + 2.0 * k[2] * x * y + k[3] * (u + 2.0 * x * x);
    const T yy = y * radial + k[2] * (u + 2.0 * y * y) + 2.0 * k[3] * x * y;
    x = xx, y = yy;
  } else if (camera.model == TV_CAMERA_KANNALA_BRANDT) {
    const T r = sqrt(X[0] * X[0] + X[1] * X[1]);
    const T theta = atan2(r, X[2]);
    const T u = theta * theta;
    const T d = theta * (1.0 + u * (k[0] + u * (k[1] + u * (k[2] + u * k[3]))));
    x = X[0] * d / r, y = X[1] * d / r;
  }
  pixel[0] = camera.fx * x + camera.cx;
  pixel[1] = camera.fy * y + camera.cy;
}

// Only a fisheye sees points behind the camera; with the other lenses these would be projected as
// mirror images.
template <typename T>
bool is_ahead(const tv_camera& camera, const T& z) {
  return camera.model == TV_CAMERA_KANNALA_BRANDT || z > 0.0;
}

// Whether point i takes part in the adjustment: its status is OK and both cameras see it at the
// start.
bool is_seen(const Scene& s, int i) {
  if (s.start[i].status != TV_POINT_OK) return false;
  const double* X = s.start[i].position;
  double pixel[2];
  double moved[3];
  for (int r = 0; r < 3; ++r) {
    moved[r] = s.start_R[3 * r] * X[0] + s.start_R[3 * r + 1] * X[1] + s.start_R[3 * r + 2] * X[2] +
               s.start_t[r];
  }
  return tv_camera_project(&s.options.camera[0], X, pixel, nullptr) == TV_OK &&
         tv_camera_project(&s.options.camera[1], moved, pixel, nullptr) == TV_OK;
}

// The four residuals of one match, in pixels.
struct MatchError {
  const tv_camera* camera;
  const double *pixel0, *pixel1;
  template <typename T>
  bool operator()(const T* q, const T* t, const T* X, T* e) const {
    T rotated[3], seen0[2], seen1[2];
    const T direction[3] = {X[0], X[1], X[2]};
    ceres::UnitQuaternionRotatePoint(q, direction, rotated);
    for (int i = 0; i < 3; ++i) rotated[i] += X[3] * t[i];
    if (!is_ahead(camera[0], direction[2]) || !is_ahead(camera[1], rotated[2])) return false;
    project(camera[0], direction, seen0);
    project(camera[1], rotated, seen1);
    for (int i = 0; i < 2; ++i) {
      e[i] = seen0[i] - pixel0[i];
      e[2 + i] = seen1[i] - pixel1[i];
    }
    return true;
  }
};

struct Answer {
  double initial_cost, cost, ms;
  int num_points, iterations;
};

// The pose and points at which a solver starts.
struct Start {
  double R[9], t[3];
  const tv_point* points;
};

Start start_of(const Scene& s) {
  Start start;
  std::memcpy(start.R, s.start_R, sizeof start.R);
  std::memcpy(start.t, s.start_t, sizeof start.t);
  start.points = s.start;
  return start;
}

// The point as a unit vector of four, in front of the cameras; beyond infinity its last entry is
// negative.
void append_homogeneous(const tv_point& point, double baseline, std::vector<double>* X) {
  const double* p = point.position;
  const double last = point.status == TV_POINT_INFINITE ? 0 : baseline;
  const double sign = point.status == TV_POINT_BEHIND ? -1 : 1;
  const double norm = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + last * last);
  for (int i = 0; i < 3; ++i) X->push_back(sign * p[i] / norm);
  X->push_back(sign * last / norm);
}

ceres::LossFunction* loss_of(const tv_bundle_options& options) {
  if (options.loss == TV_LOSS_HUBER) return new ceres::HuberLoss(options.loss_scale_px);
  if (options.loss == TV_LOSS_CAUCHY) return new ceres::CauchyLoss(options.loss_scale_px);
  return nullptr;
}

// With `tight`, Ceres converges to rounding error; else it uses its default tolerances, for a fair
// comparison of times.
Answer solve_ceres(const Scene& s, const Start& start, const tv_bundle_options& options,
                   bool tight) {
  double q[4], t[3], R[9];
  for (int i = 0; i < 9; ++i) R[3 * (i % 3) + i / 3] = start.R[i];  // for Ceres R is column-major
  ceres::RotationMatrixToQuaternion(R, q);
  const double length =
      std::sqrt(start.t[0] * start.t[0] + start.t[1] * start.t[1] + start.t[2] * start.t[2]);
  for (int i = 0; i < 3; ++i) t[i] = start.t[i] / length;
  std::vector<double> X;
  std::vector<int> index;
  for (int i = 0; i < s.options.num; ++i) {
    if (!is_seen(s, i)) continue;
    index.push_back(i);
    append_homogeneous(start.points[i], length, &X);
  }
  const double begin = now_ms();
  ceres::Problem problem;
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (size_t k = 0; k < index.size(); ++k) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<MatchError, 4, 4, 3, 4>(new MatchError{
            s.options.camera, s.pixels[0] + 2 * index[k], s.pixels[1] + 2 * index[k]}),
        loss_of(options), q, t, &X[4 * k]);
    problem.SetManifold(&X[4 * k], new ceres::SphereManifold<4>);
    ordering->AddElementToGroup(&X[4 * k], 0);
  }
  problem.SetManifold(q, new ceres::QuaternionManifold);
  problem.SetManifold(t, new ceres::SphereManifold<3>);
  ordering->AddElementToGroup(q, 1);
  ordering->AddElementToGroup(t, 1);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering.reset(ordering);
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  if (tight) {
    solver.max_num_iterations = 500;
    solver.max_num_consecutive_invalid_steps = 100;
    solver.function_tolerance = 1e-16;
    solver.gradient_tolerance = 1e-16;
    solver.parameter_tolerance = 1e-16;
  }
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  return Answer{2 * summary.initial_cost, 2 * summary.final_cost, now_ms() - begin,
                static_cast<int>(index.size()), static_cast<int>(summary.iterations.size()) - 1};
}

// Leaves the pose in `end` and the points in `points`.
Answer solve_ours(const Scene& s, const tv_bundle_options& options, Start* end,
                  tv_bundle_result* result) {
  static tv_context* context = nullptr;
  if (context == nullptr) {
    tv_limits limits;
    tv_limits_init(&limits);
    limits.max_matches = bundle_scene::kMaxPoints;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_new(&context, &limits));
  }
  *end = start_of(s);
  std::memcpy(points, s.start, sizeof points);
  end->points = points;
  tv_bundle_result_init(result);
  tv_camera_pair cameras = pair_of(&s.options.camera[0], &s.options.camera[1], end->R, end->t);
  const double begin = now_ms();
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust_pixels(context, s.pixels[0], s.pixels[1], s.options.num,
                                             &options, &cameras, points, result));
  const double ms = now_ms() - begin;
  std::memcpy(end->R, cameras.cam1_from_cam0_R, sizeof cameras.cam1_from_cam0_R);
  std::memcpy(end->t, cameras.cam1_from_cam0_t, sizeof cameras.cam1_from_cam0_t);
  return Answer{result->initial_cost, result->final_cost, ms, result->num_points,
                result->num_iterations};
}

// Where Ceres ends at a higher cost, ours must be a minimum: Ceres, started there, must not lower
// it.
void expect_same_minimum(const Options& options, const tv_bundle_options& bundle, int* num_lower) {
  bundle_scene::make(options, &pair);
  tv_bundle_result result;
  Start end;
  const Answer ours = solve_ours(pair, bundle, &end, &result);
  Answer theirs = solve_ceres(pair, start_of(pair), bundle, true);
  const double gap = (ours.cost - theirs.cost) / theirs.cost;
  char text[200];
  std::snprintf(text, sizeof text,
                "seed %d, %d points, noise %g px, outliers %g, loss %d: cost %.12g against %.12g, "
                "relative %.2g; %d and %d iterations",
                static_cast<int>(options.seed), options.num, options.noise_px,
                options.outlier_share, bundle.loss, ours.cost, theirs.cost, gap, ours.iterations,
                theirs.iterations);
  if (std::getenv("TWOVIEW_VERBOSE") != nullptr) std::printf("%s\n", text);
  TEST_ASSERT_EQUAL_INT_MESSAGE(theirs.num_points, ours.num_points, text);
  TEST_ASSERT_TRUE_MESSAGE(
      std::fabs(ours.initial_cost - theirs.initial_cost) <= 1e-9 * theirs.initial_cost, text);
  TEST_ASSERT_TRUE_MESSAGE(result.converged, text);
  if (gap < -1e-8) {
    ++*num_lower;
    theirs = solve_ceres(pair, end, bundle, true);
  }
  TEST_ASSERT_TRUE_MESSAGE(std::fabs(ours.cost - theirs.cost) <= 1e-8 * theirs.cost, text);
}

tv_bundle_options options_of(tv_loss loss, double scale_px) {
  tv_bundle_options options;
  tv_bundle_options_init(&options);
  options.loss = loss;
  options.loss_scale_px = scale_px;
  return options;
}

void test_reaches_the_minimum_that_ceres_finds() {
  uint64_t seed = 0;
  int num_lower = 0;
  for (int num : {50, 500, 5000}) {
    for (double noise_px : {0.1, 0.5, 2.0}) {
      for (Geometry geometry : {Geometry::kGeneral, Geometry::kSideways, Geometry::kForward}) {
        Options options;
        options.num = num;
        options.noise_px = noise_px;
        options.geometry = geometry;
        options.seed = ++seed;
        expect_same_minimum(options, options_of(TV_LOSS_NONE, 1), &num_lower);
        options.outlier_share = 0.2;
        options.seed = ++seed;
        expect_same_minimum(options, options_of(TV_LOSS_CAUCHY, 1), &num_lower);
      }
    }
  }
  TEST_ASSERT_TRUE(num_lower <= 2);
}

void test_reaches_it_with_the_other_losses_and_lenses() {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  uint64_t seed = 1000;
  int num_lower = 0;
  for (const tv_camera& lens : lenses) {
    for (tv_loss loss : {TV_LOSS_NONE, TV_LOSS_HUBER, TV_LOSS_CAUCHY}) {
      Options options;
      options.camera[0] = lens;
      options.outlier_share = loss == TV_LOSS_NONE ? 0 : 0.2;
      options.baseline = 0.37;
      options.seed = ++seed;
      expect_same_minimum(options, options_of(loss, 1.5), &num_lower);
    }
  }
  TEST_ASSERT_EQUAL_INT(0, num_lower);
}

void print_times() {
  for (int num : {50, 500, 5000}) {
    for (double outliers : {0.0, 0.2}) {
      Options options;
      options.num = num;
      options.outlier_share = outliers;
      bundle_scene::make(options, &pair);
      const tv_bundle_options bundle = options_of(outliers > 0 ? TV_LOSS_CAUCHY : TV_LOSS_NONE, 1);
      tv_bundle_result result;
      Start end;
      Answer ours{}, theirs{};
      double ms = 1e9, ms_ceres = 1e9;
      for (int k = 0; k < 20; ++k) {
        ours = solve_ours(pair, bundle, &end, &result);
        ms = std::fmin(ms, ours.ms);
      }
      for (int k = 0; k < 5; ++k) {
        theirs = solve_ceres(pair, start_of(pair), bundle, false);
        ms_ceres = std::fmin(ms_ceres, theirs.ms);
      }
      std::printf(
          "%5d points, outliers %.1f: %.3f ms (%d iterations), Ceres %.2f ms (%d), "
          "ratio %.0f\n",
          num, outliers, ms, ours.iterations, ms_ceres, theirs.iterations, ms_ceres / ms);
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
  RUN_TEST(test_reaches_it_with_the_other_losses_and_lenses);
  return UNITY_END();
}
