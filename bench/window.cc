// Bundle adjustment of windows of 7, 10 and 20 views, by tv_adjust_window and by Ceres
// (DENSE_SCHUR, one thread, its default tolerances), from the same start. Ceres has two rows: with
// automatic derivatives, and with derivatives written by hand and poses of six parameters, for
// which Ceres has a Schur eliminator of fixed size. Both build their problem within the timed work,
// as ours does. The counter "cost" is what each ends at.
#include <algorithm>
#include <memory>

#include "bench.h"
#include "support/window_scene.h"
#ifdef BENCH_HAS_CERES
#include <ceres/ceres.h>
#include <ceres/manifold.h>
#include <ceres/rotation.h>
#endif

namespace {

using bench::Counters;
using window_scene::Scene;

struct Case {
  Scene start, scene;
  tv_window_options options;
  std::vector<uint8_t> memory;
  double cost = 0, steps = 0;
};

void solve_ours(Case* c) {
  c->scene.views = c->start.views;
  c->scene.points = c->start.points;
  const tv_window window = c->scene.window();
  tv_window_result result;
  tv_window_result_init(&result);
  uint8_t* memory = c->memory.data();
  memory += (64 - reinterpret_cast<uintptr_t>(memory) % 64) % 64;
  bench::require(tv_adjust_window(memory, c->memory.size() - 64, &window, &c->options, nullptr,
                                  nullptr, &result),
                 "tv_adjust_window");
  c->cost = result.final_cost;
  c->steps = result.num_iterations;
}

#ifdef BENCH_HAS_CERES
struct AutomaticError {
  double fx, fy, u, v;  // the focal lengths, and the principal point less the pixel
  template <typename T>
  bool operator()(const T* pose, const T* X, T* e) const {
    T x[3];
    ceres::QuaternionRotatePoint(pose, X, x);
    for (int i = 0; i < 3; ++i) x[i] += pose[4 + i];
    e[0] = fx * x[0] / x[2] + u;
    e[1] = fy * x[1] / x[2] + v;
    return true;
  }
};

// A pose is a quaternion (w x y z) and t; its step is x -> exp([w]x) x + v. The cost functions give
// the derivatives by the step in the first six columns.
class PoseSteps : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* pose, const double* step, double* moved) const override {
    double turn[4];
    ceres::AngleAxisToQuaternion(step, turn);
    ceres::QuaternionProduct(turn, pose, moved);
    ceres::QuaternionRotatePoint(turn, pose + 4, moved + 4);
    for (int i = 0; i < 3; ++i) moved[4 + i] += step[3 + i];
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    for (int i = 0; i < 42; ++i) jacobian[i] = i / 6 == i % 6;
    return true;
  }
  bool Minus(const double*, const double*, double*) const override { return false; }
  bool MinusJacobian(const double*, double*) const override { return false; }
};

class WrittenError : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  explicit WrittenError(const AutomaticError& error) : error_(error) {}
  bool Evaluate(double const* const* blocks, double* e, double** jacobians) const override {
    double R[9], x[3];
    ceres::QuaternionToRotation(blocks[0], R);
    window_scene::transform(R, blocks[0] + 4, blocks[1], x);
    const double inverse = 1 / x[2], a = x[0] * inverse, b = x[1] * inverse;
    e[0] = error_.fx * a + error_.u;
    e[1] = error_.fy * b + error_.v;
    if (jacobians == nullptr) return true;
    const double h[2][3] = {{error_.fx * inverse, 0, -error_.fx * inverse * a},
                            {0, error_.fy * inverse, -error_.fy * inverse * b}};
    for (int r = 0; r < 2; ++r) {
      if (jacobians[0] != nullptr) {
        double* row = jacobians[0] + 7 * r;
        for (int i = 0; i < 3; ++i) {
          const int j = (i + 1) % 3, k = (i + 2) % 3;
          row[i] = x[j] * h[r][k] - x[k] * h[r][j];
          row[3 + i] = h[r][i];
        }
        row[6] = 0;
      }
      for (int i = 0; jacobians[1] != nullptr && i < 3; ++i) {
        jacobians[1][3 * r + i] = h[r][0] * R[i] + h[r][1] * R[3 + i] + h[r][2] * R[6 + i];
      }
    }
    return true;
  }

 private:
  AutomaticError error_;
};

void solve_ceres(Case* c, bool automatic) {
  using Quaternion = ceres::ProductManifold<ceres::QuaternionManifold, ceres::EuclideanManifold<3>>;
  Scene& s = c->scene;
  s.points = c->start.points;
  std::vector<double> poses;
  for (const tv_window_view& view : c->start.views) {
    double columns[9], q[4];
    for (int i = 0; i < 9; ++i) columns[3 * (i % 3) + i / 3] = view.R[i];
    ceres::RotationMatrixToQuaternion(columns, q);
    poses.insert(poses.end(), q, q + 4);
    poses.insert(poses.end(), view.t, view.t + 3);
  }
  ceres::Problem problem;
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (size_t v = 0; v < s.views.size(); ++v) {
    ceres::Manifold* manifold = new PoseSteps;
    if (automatic) {
      delete manifold;
      manifold = new Quaternion;
    }
    problem.AddParameterBlock(&poses[7 * v], 7, manifold);
    ordering->AddElementToGroup(&poses[7 * v], 1);
    if (s.views[v].fixed != 0) problem.SetParameterBlockConstant(&poses[7 * v]);
  }
  for (size_t p = 0; p < s.points.size(); p += 3) ordering->AddElementToGroup(&s.points[p], 0);
  for (const tv_observation& o : s.observations) {
    const tv_camera& camera = s.cameras[0];
    const AutomaticError error{camera.fx, camera.fy, camera.cx - o.pixel[0],
                               camera.cy - o.pixel[1]};
    ceres::CostFunction* cost;
    if (automatic) {
      cost = new ceres::AutoDiffCostFunction<AutomaticError, 2, 7, 3>(new AutomaticError(error));
    } else {
      cost = new WrittenError(error);
    }
    ceres::LossFunction* loss = nullptr;
    if (c->options.loss == TV_LOSS_CAUCHY) loss = new ceres::CauchyLoss(c->options.loss_scale_px);
    problem.AddResidualBlock(cost, loss, &poses[7 * static_cast<size_t>(o.idx_view)],
                             &s.points[3 * static_cast<size_t>(o.idx_point)]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering.reset(ordering);
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  c->cost = 2 * summary.final_cost;
  c->steps = static_cast<double>(summary.iterations.size()) - 1;
}
#endif

void add_rows(int num_views, int num_points, double outliers) {
  window_scene::Options o;
  o.num_views = num_views;
  o.num_points = num_points;
  o.longest_track = num_views;
  o.outlier_share = outliers;
  const auto c = std::make_shared<Case>();
  window_scene::make(o, &c->start);
  c->scene = c->start;
  tv_window_options_init(&c->options);
  if (outliers == 0) c->options.loss = TV_LOSS_NONE;
  const tv_window window = c->scene.window();
  size_t size = 0;
  bench::require(tv_adjust_window_size(&window, &size), "tv_adjust_window_size");
  c->memory.resize(size + 64);
  const std::string name = "window/" + std::to_string(num_views) + " views, " +
                           std::to_string(num_points) + " points, " +
                           (outliers > 0 ? "10 % wrong, Cauchy" : "least squares");
  const auto add = [&](const std::string& system, const std::function<void()>& work) {
    bench::add({system, work, [=] {
                  work();
                  return Counters{{"cost", c->cost}, {"steps", c->steps}};
                }});
  };
  add(bench::ours(name), [=] { solve_ours(c.get()); });
#ifdef BENCH_HAS_CERES
  const std::string ceres = name + "/Ceres " CERES_VERSION_STRING;
  add(ceres + " automatic derivatives", [=] { solve_ceres(c.get(), true); });
  add(ceres + " written derivatives", [=] { solve_ceres(c.get(), false); });
#else
  bench::add_missing(name + "/Ceres");
#endif
}

}  // namespace

int main(int argc, char** argv) {
  for (int num_views : {7, 10, 20}) {
    for (double outliers : {0.0, 0.1}) add_rows(num_views, 2000, outliers);
  }
  return bench::run(argc, argv);
}
