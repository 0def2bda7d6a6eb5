// The parts of the window's bundle adjustment: derivatives against differences, the factorisation
// and the covariances against dense matrices, and what must not change the result.
#ifdef EIGEN_NO_MALLOC
#undef EIGEN_NO_MALLOC  // the dense references take the heap
#endif
#include <Eigen/Dense>
#include <cstdio>
#include <cstring>

#include "adjust/block_cholesky.h"
#include "adjust/window_observation.h"
#include "adjust/window_prior.h"
#include "support/window_scene.h"
#include "unity.h"

using window_scene::Options;
using window_scene::Path;
using window_scene::Random;
using window_scene::Scene;

static Scene scene;
static std::vector<uint8_t> memory;

void setUp() {}
void tearDown() {}

namespace {

constexpr double kStep = 1e-6;

tv_camera brown() {
  return tv_camera{TV_CAMERA_BROWN_CONRADY,
                   752,
                   480,
                   0,
                   458.654,
                   457.296,
                   367.215,
                   248.375,
                   {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}};
}

tv_camera fisheye() {
  return tv_camera{TV_CAMERA_KANNALA_BRANDT, 640, 640, 0, 190, 190, 319.5, 319.5,
                   {0.01, -0.003, 0.0002, 0}};
}

tv_window_options options_of(tv_loss loss, double scale_px) {
  tv_window_options options;
  tv_window_options_init(&options);
  options.loss = loss;
  options.loss_scale_px = scale_px;
  options.tolerance = 1e-12;
  options.max_iterations = 200;
  return options;
}

tv_status adjust(Scene* s, const tv_window_options& options, double* covariances,
                 tv_window_result* result) {
  const tv_window window = s->window();
  size_t size = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_adjust_window_size(&window, &size));
  if (memory.size() < size + 64) memory.resize(size + 64);
  void* aligned = memory.data() + (64 - reinterpret_cast<uintptr_t>(memory.data()) % 64) % 64;
  tv_window_result_init(result);
  return tv_adjust_window(aligned, size, &window, &options, covariances, nullptr, result);
}

tv::WindowPose pose_of(const tv_window_view& view) {
  tv::WindowPose pose;
  std::memcpy(pose.R, view.R, sizeof pose.R);
  std::memcpy(pose.t, view.t, sizeof pose.t);
  tv::set_centre(&pose);
  return pose;
}

tv::WindowObservation random_observation(Random* random, const tv_camera& model, double ray[3]) {
  const tv::Camera camera = tv::prepare_camera(model);
  tv_observation given{};
  for (;;) {
    given.pixel[0] = random->uniform(5, model.width - 6);
    given.pixel[1] = random->uniform(5, model.height - 6);
    given.sigma = static_cast<float>(random->uniform(0.5, 2));
    tv::WindowObservation o{};
    if (tv_camera_unproject(&model, given.pixel, ray, nullptr) == TV_OK &&
        tv::make_observation(camera, given, nullptr, &o)) {
      return o;
    }
  }
}

// Where the ray is known, the lens is not inverted again, and the bytes are the same.
void test_a_known_ray_gives_the_same_observation() {
  Random random(7);
  for (const tv_camera& model : {window_scene::pinhole(), brown(), fisheye()}) {
    const tv::Camera camera = tv::prepare_camera(model);
    for (int k = 0; k < 200; ++k) {
      tv_observation given{};
      given.pixel[0] = random.uniform(5, model.width - 6);
      given.pixel[1] = random.uniform(5, model.height - 6);
      given.sigma = 1.5f;
      tv::Vec2 plane(0, 0);
      const bool known = tv::undistort(camera, tv::Vec2(given.pixel[0], given.pixel[1]), &plane);
      TEST_ASSERT_EQUAL(model.model != TV_CAMERA_KANNALA_BRANDT, known);
      if (!known) continue;
      tv::WindowObservation o{}, from_plane{};
      TEST_ASSERT_TRUE(tv::make_observation(camera, given, nullptr, &o));
      TEST_ASSERT_TRUE(tv::make_observation(camera, given, plane.data(), &from_plane));
      TEST_ASSERT_EQUAL_MEMORY(&o, &from_plane, sizeof o);
      if (model.model != TV_CAMERA_BROWN_CONRADY) continue;
      plane[0] += 1e-3;  // it is the plane that is read
      TEST_ASSERT_TRUE(tv::make_observation(camera, given, plane.data(), &from_plane));
      TEST_ASSERT_TRUE(std::memcmp(&o, &from_plane, sizeof o) != 0);
    }
  }
}

double error_sq(const tv::WindowObservation& o, const double x[3], double e[2]) {
  tv::Residual r{};
  TEST_ASSERT_TRUE(tv::residual_at(o, x, &r));
  std::memcpy(e, r.e, sizeof r.e);
  return tv::norm_sq(r);
}

// A residual is that of the projection to first order: the ray's is 0, and around it the
// derivatives agree.
void test_a_residual_is_the_projection_near_its_pixel() {
  Random random(1);
  for (const tv_camera& model : {window_scene::pinhole(), brown(), fisheye()}) {
    for (int k = 0; k < 200; ++k) {
      double ray[3], e[2], x[3], pixel[2], J[6], at[2];
      const tv::WindowObservation o = random_observation(&random, model, ray);
      const double depth = random.uniform(0.5, 20);
      for (int i = 0; i < 3; ++i) x[i] = depth * ray[i];
      TEST_ASSERT_TRUE(error_sq(o, x, e) < 1e-18);
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&model, x, pixel, J));
      double moved[3], size = 0;
      for (int i = 0; i < 3; ++i) moved[i] = x[i] + depth * 1e-5 * random.normal();
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&model, moved, at, nullptr));
      error_sq(o, moved, e);
      for (int i = 0; i < 2; ++i) size += std::fabs(at[i] - pixel[i]);
      const double sigma = (at[0] - pixel[0]) / e[0];
      TEST_ASSERT_TRUE(std::fabs(sigma * e[1] - (at[1] - pixel[1])) <= 1e-3 * size);
      TEST_ASSERT_TRUE(sigma > 0.49 && sigma < 2.01);
    }
  }
}

// What an observation adds to its point and to its view, the second one of two.
struct Terms {
  double sums[9], entries[36 + 72], diagonal[12], gradient[12], columns[3][6];
};

Terms terms_of(const tv::WindowObservation& o, const double R[9],
               const tv::LinearObservation& linear) {
  Terms terms{};
  const tvk_reduced_system system = {terms.entries, terms.diagonal, terms.gradient};
  tvk_odometry_of(tvk_select(TV_KERNELS_AUTO))
      ->add_observation(reinterpret_cast<const double*>(&o), R,
                        reinterpret_cast<const double*>(&linear), terms.sums, &system, 1,
                        terms.columns[0], 6);
  return terms;
}

void test_derivatives_of_an_observation_agree_with_differences() {
  Random random(2);
  for (const tv_camera& model : {window_scene::pinhole(), brown(), fisheye()}) {
    for (int k = 0; k < 300; ++k) {
      const tv_loss loss = static_cast<tv_loss>(k % 3);
      const tv_window_options options = options_of(loss, random.uniform(1, 30));
      double ray[3], e[2], slope[2][3], gradient[3];
      const tv::WindowObservation o = random_observation(&random, model, ray);
      tv::LinearObservation at{};
      const double depth = random.uniform(1, 10);
      for (int i = 0; i < 3; ++i) at.x[i] = depth * (ray[i] + 0.02 * random.normal());
      for (int i = 0; i < 3; ++i) {
        double e_of[2][2], cost[2];
        for (int side = 0; side < 2; ++side) {
          double x[3] = {at.x[0], at.x[1], at.x[2]};
          x[i] += (side == 0 ? -1 : 1) * kStep * depth;
          tv::LossSum sum(options);
          sum.add(error_sq(o, x, e_of[side]));
          cost[side] = sum.value();
        }
        for (int r = 0; r < 2; ++r) slope[r][i] = (e_of[1][r] - e_of[0][r]) / (2 * kStep * depth);
        gradient[i] = 0.5 * (cost[1] - cost[0]) / (2 * kStep * depth);
      }
      const double s = error_sq(o, at.x, e);
      const tv::LossSlope bent = tv::slope_of(options, s);
      if (std::fabs(s - options.loss_scale_px * options.loss_scale_px) < 1e-2) continue;
      double R[9], turn[3];
      for (double& w : turn) w = random.normal();
      window_scene::rotation(turn, R);
      tv::linearise(options, {1.0, false}, o, &at);
      const Terms weighed = terms_of(o, R, at);
      double scale = 0;
      for (int i = 0; i < 3; ++i) scale += std::fabs(slope[0][i]) + std::fabs(slope[1][i]);
      // By the point in the frame of the world: x = R X + t.
      double by_point[2][3] = {}, of_point[3] = {};
      for (int i = 0; i < 3; ++i) {
        for (int c = 0; c < 3; ++c) {
          for (int r = 0; r < 2; ++r) by_point[r][c] += slope[r][i] * R[3 * i + c];
          of_point[c] += gradient[i] * R[3 * i + c];
        }
      }
      for (int i = 0, slot = 0; i < 3; ++i) {
        TEST_ASSERT_TRUE(std::fabs(weighed.sums[6 + i] - of_point[i]) <=
                         1e-5 * scale * (1 + bent.weight * std::sqrt(s)));
        for (int j = i; j < 3; ++j, ++slot) {
          // rho' (J'J + bend J'e e'J / s), of which nothing negative is kept.
          double H = 0, along[2] = {0, 0};
          for (int r = 0; r < 2; ++r) {
            H += by_point[r][i] * by_point[r][j];
            along[0] += e[r] * by_point[r][i], along[1] += e[r] * by_point[r][j];
          }
          H += std::max(bent.bend, -1.0) * along[0] * along[1] / s;
          TEST_ASSERT_TRUE(std::fabs(weighed.sums[slot] - bent.weight * H) <= 1e-5 * scale * scale);
        }
      }
      // By the pose: x -> exp([w]x) x + v.
      tv::linearise(options_of(TV_LOSS_NONE, 1), {0.0, false}, o, &at);
      const Terms terms = terms_of(o, R, at);
      double by_pose[2][6];
      for (int i = 0; i < 6; ++i) {
        double e_of[2][2];
        for (int side = 0; side < 2; ++side) {
          const double step = (side == 0 ? -1 : 1) * kStep;
          double w[3] = {0, 0, 0}, v[3] = {0, 0, 0}, turned[9], x[3];
          (i < 3 ? w[i] : v[i - 3]) = step;
          window_scene::rotation(w, turned);
          window_scene::transform(turned, v, at.x, x);
          error_sq(o, x, e_of[side]);
        }
        for (int r = 0; r < 2; ++r) by_pose[r][i] = (e_of[1][r] - e_of[0][r]) / (2 * kStep);
      }
      error_sq(o, at.x, e);
      const double size = 1e-5 * scale * depth;  // of one derivative by the pose
      double largest = 0;
      for (int i = 0; i < 6; ++i) {
        largest = std::max(largest, std::fabs(by_pose[0][i]) + std::fabs(by_pose[1][i]));
      }
      const auto product = [](const double a[2], double b0, double b1) {
        return a[0] * b0 + a[1] * b1;
      };
      for (int i = 0; i < 36; ++i) TEST_ASSERT_EQUAL_DOUBLE(0, terms.entries[i]);
      for (int i = 0; i < 6; ++i) {
        const double of_i[2] = {by_pose[0][i], by_pose[1][i]};
        const double* row = terms.entries + 36 + 12 * i;  // of two blocks
        TEST_ASSERT_DOUBLE_WITHIN(size * (1 + std::sqrt(s)), product(of_i, e[0], e[1]),
                                  terms.gradient[6 + i]);
        TEST_ASSERT_DOUBLE_WITHIN(2 * size * largest, product(of_i, of_i[0], of_i[1]),
                                  terms.diagonal[6 + i]);
        for (int j = 0; j < 6; ++j) {
          TEST_ASSERT_DOUBLE_WITHIN(2 * size * largest, product(of_i, by_pose[0][j], by_pose[1][j]),
                                    row[6 + j]);
          TEST_ASSERT_EQUAL_DOUBLE(0, row[j]);
        }
        for (int c = 0; c < 3; ++c) {
          TEST_ASSERT_DOUBLE_WITHIN(2 * size * scale + 1e-5 * scale * largest,
                                    product(of_i, by_point[0][c], by_point[1][c]),
                                    terms.columns[c][i]);
        }
      }
    }
  }
}

// The half gradient of a term by differences, and its Hessian where the residual is 0.
template <typename Term>
void expect_derivatives(const Term& term_at, const tv::WindowPose poses[2], int num_views,
                        bool at_zero) {
  tv::PriorTerm term;
  term_at(poses, &term);
  for (int v = 0; v < num_views; ++v) {
    for (int i = 0; i < 6; ++i) {
      tv::PriorTerm side[2];
      for (int k = 0; k < 2; ++k) {
        tv::WindowPose moved[2] = {poses[0], poses[1]};
        double step[6] = {};
        step[i] = k == 0 ? -kStep : kStep;
        moved[v] = tv::stepped(poses[v], step);
        term_at(moved, &side[k]);
      }
      const double slope = 0.5 * (side[1].cost - side[0].cost) / (2 * kStep);
      const double scale = 1 + std::fabs(term.gradient[v][i]) + std::sqrt(term.H[v][v][7 * i]);
      TEST_ASSERT_TRUE(std::fabs(slope - term.gradient[v][i]) <= 1e-4 * scale);
      for (int u = 0; at_zero && u <= v; ++u) {
        for (int j = 0; j < 6; ++j) {
          // H[v][u] = d gradient[u] / d v, transposed.
          const double bend = (side[1].gradient[u][j] - side[0].gradient[u][j]) / (2 * kStep);
          const double size = 1 + std::fabs(term.H[v][v][7 * i]) + std::fabs(term.H[u][u][7 * j]);
          TEST_ASSERT_TRUE(std::fabs(bend - term.H[v][u][6 * i + j]) <= 1e-4 * size);
        }
      }
    }
  }
}

void test_derivatives_of_priors_agree_with_differences() {
  Random random(3);
  for (int k = 0; k < 100; ++k) {
    const bool at_zero = k % 2 == 0;
    tv_window_view views[2];
    tv::WindowPose poses[2];
    for (int v = 0; v < 2; ++v) {
      double w[3], C[3], R[9];
      for (int i = 0; i < 3; ++i) w[i] = random.normal(), C[i] = 2 * random.normal();
      window_scene::rotation(w, R);
      window_scene::set_pose(R, C, &views[v]);
      poses[v] = pose_of(views[v]);
    }
    tv_pose_prior pose{};
    double w[3], by[3];
    for (int i = 0; i < 3; ++i) {
      w[i] = at_zero ? 0 : 0.7 * random.normal(), by[i] = at_zero ? 0 : random.normal();
    }
    const tv_window_view known = window_scene::moved(views[0], w, by);
    std::memcpy(pose.R, known.R, sizeof pose.R);
    std::memcpy(pose.t, known.t, sizeof pose.t);
    Eigen::Matrix<double, 6, 6> root;
    for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = random.normal();
    const Eigen::Matrix<double, 6, 6> information = root * root.transpose();
    for (int i = 0; i < 36; ++i) pose.information[i] = information(i / 6, i % 6);
    expect_derivatives(
        [&](const tv::WindowPose* at, tv::PriorTerm* term) { tv::pose_term(pose, at[0], term); },
        poses, 1, at_zero);
    tv_gravity_prior gravity{};
    const double down[3] = {0.1, 2, -0.3};
    gravity.sigma_rad = 0.1;
    for (int i = 0; i < 3; ++i) {
      gravity.down[i] = at_zero
                            ? 3 * (views[0].R[3 * i] * down[0] + views[0].R[3 * i + 1] * down[1] +
                                   views[0].R[3 * i + 2] * down[2])
                            : random.normal();
    }
    expect_derivatives([&](const tv::WindowPose* at,
                           tv::PriorTerm* term) { tv::gravity_term(gravity, down, at[0], term); },
                       poses, 1, at_zero);
    tv_distance_prior distance{0, 1, random.uniform(0, 3), 0.2};
    if (at_zero) {
      double sum = 0;
      for (int i = 0; i < 3; ++i) {
        const double d = poses[1].centre[i] - poses[0].centre[i];
        sum += d * d;
      }
      distance.distance = std::sqrt(sum);
    }
    expect_derivatives(
        [&](const tv::WindowPose* at, tv::PriorTerm* term) {
          tv::distance_term(distance, at[0], at[1], term);
        },
        poses, 2, at_zero);
  }
}

void test_the_cost_of_a_pose_prior_of_half_a_turn_is_known() {
  const double axes[3][3] = {{1, 0, 0}, {0, 0.6, 0.8}, {0.48, -0.6, 0.64}};
  for (const double* axis : axes) {
    for (double angle : {1e-9, 1.0, 3.141, 3.14159, 3.14159265358979}) {
      const double w[3] = {angle * axis[0], angle * axis[1], angle * axis[2]}, C[3] = {0, 0, 0};
      tv_window_view view{};
      double R[9];
      window_scene::rotation(w, R);
      window_scene::set_pose(R, C, &view);
      tv_pose_prior prior{};
      for (int i = 0; i < 3; ++i) prior.R[4 * i] = prior.information[7 * i] = 1;
      tv::PriorTerm term;
      tv::pose_term(prior, pose_of(view), &term);
      TEST_ASSERT_TRUE(std::fabs(term.cost - angle * angle) <= 1e-6 * angle * angle);
    }
  }
}

void test_the_cost_of_an_exact_half_turn_is_not_zero() {
  for (int axis = 0; axis < 3; ++axis) {
    tv_pose_prior prior{};
    tv_window_view view{};
    for (int i = 0; i < 3; ++i) {
      prior.R[4 * i] = prior.information[7 * i] = 1;
      view.R[4 * i] = i == axis ? 1 : -1;
    }
    tv::PriorTerm term;
    tv::pose_term(prior, pose_of(view), &term);
    TEST_ASSERT_TRUE(std::fabs(term.cost - 9.869604401089358) <= 1e-9);
    for (double g : term.gradient[0]) TEST_ASSERT_TRUE(g - g == 0);
  }
}

Eigen::MatrixXd random_matrix(Random* random, int rows, int columns) {
  Eigen::MatrixXd matrix(rows, columns);
  for (int i = 0; i < matrix.size(); ++i) matrix.data()[i] = random->normal();
  return matrix;
}

// Solves with a matrix of blocks, and checks the solution with the whole matrix.
void expect_solution(const Eigen::MatrixXd& whole, int blocks, Random* random) {
  const int n = 6 * blocks;
  const Eigen::VectorXd b = random_matrix(random, n, 1);
  const tvk_odometry_table* kernels = tvk_odometry_of(tvk_select(TV_KERNELS_AUTO));
  tv::Arena measure = tv::measuring_arena();
  tv::block_matrix(blocks, kernels, measure);
  memory.resize(measure.used_bytes + 64);
  void* aligned = memory.data() + (64 - reinterpret_cast<uintptr_t>(memory.data()) % 64) % 64;
  tv::Arena arena = tv::arena_over(aligned, measure.used_bytes);
  const tv::BlockMatrix A = tv::block_matrix(blocks, kernels, arena);
  for (int i = 0; i < n; ++i) {
    A.diagonal[i] = whole(i, i);
    const int row = i / 6;  // the blocks of the diagonal are full
    double* entries = tv::block_at(A, row, 0) + i % 6 * tv::row_entries(row);
    for (int j = 0; j < 6 * (row + 1); ++j) entries[j] = whole(i, j);
    TEST_ASSERT_EQUAL_DOUBLE(whole(i, i), *tv::diagonal_at(A, i));
  }
  TEST_ASSERT_EQUAL_INT(0, tv::factorise(A, 1e-14));
  std::vector<double> x(b.data(), b.data() + n);
  tv::solve_lower(A, 0, x.data());
  tv::solve_upper(A, x.data());
  const Eigen::VectorXd difference = whole * Eigen::Map<Eigen::VectorXd>(x.data(), n) - b;
  TEST_ASSERT_TRUE(difference.norm() <= 1e-8 * b.norm());
}

void test_the_factorisation_solves_like_a_dense_one() {
  Random random(4);
  for (int blocks : {1, 2, 5, 20}) {
    const Eigen::MatrixXd root = random_matrix(&random, 6 * blocks, 6 * blocks + 3);
    expect_solution(root * root.transpose(), blocks, &random);
  }
}

// Each view shares points with the next one, and three pairs closed a loop: the other blocks are
// zero at first, and some of them stay so.
void test_blocks_of_zeros_change_no_solution() {
  constexpr int kBlocks = 30;
  Random random(5);
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(6 * kBlocks, 6 * kBlocks);
  const auto share = [&](int a, int b) {
    const Eigen::MatrixXd root = random_matrix(&random, 12, 15);
    const Eigen::MatrixXd part = root * root.transpose();
    whole.block<6, 6>(6 * a, 6 * a) += part.topLeftCorner<6, 6>();
    whole.block<6, 6>(6 * b, 6 * b) += part.bottomRightCorner<6, 6>();
    whole.block<6, 6>(6 * a, 6 * b) += part.topRightCorner<6, 6>();
    whole.block<6, 6>(6 * b, 6 * a) += part.bottomLeftCorner<6, 6>();
  };
  for (int k = 1; k < kBlocks; ++k) share(k - 1, k);
  share(2, 27);
  share(4, 15);
  share(15, 29);
  expect_solution(whole, kBlocks, &random);
}

// The covariances are those of the dense inverse, for least squares: variance (J'J + variance
// Lambda)^-1 over all views and points, with J by differences.
void expect_dense_covariances(const Options& o, int num_views_known) {
  window_scene::make(o, &scene);
  std::vector<double> covariances(36 * static_cast<size_t>(o.num_views));
  tv_window_result result;
  tv_window_options options = options_of(TV_LOSS_NONE, 1);
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, covariances.data(), &result));
  TEST_ASSERT_TRUE(result.converged && result.has_covariance);
  const int free_views = o.num_views - num_views_known;
  const int n = 6 * free_views + 3 * o.num_points;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  const double variance = result.noise_px * result.noise_px;
  const auto add = [&](const std::vector<int>& columns, const Eigen::MatrixXd& J, double weight) {
    for (size_t a = 0; a < columns.size(); ++a) {
      for (size_t b = 0; b < columns.size(); ++b) {
        if (columns[a] < 0 || columns[b] < 0) continue;
        H(columns[a], columns[b]) +=
            weight * J.col(static_cast<int>(a)).dot(J.col(static_cast<int>(b)));
      }
    }
  };
  double sum_sq = 0;
  for (const tv_observation& observation : scene.observations) {
    const tv_window_view& view = scene.views[static_cast<size_t>(observation.idx_view)];
    const double* X = &scene.points[3 * static_cast<size_t>(observation.idx_point)];
    Eigen::MatrixXd J(2, 9);
    std::vector<int> columns;
    const int block = observation.idx_view - num_views_known;
    for (int i = 0; i < 9; ++i) {
      double pixels[2][2];
      for (int side = 0; side < 2; ++side) {
        double w[3] = {0, 0, 0}, v[3] = {0, 0, 0}, Y[3] = {X[0], X[1], X[2]}, R[9], x[3], y[3];
        (i < 3 ? w[i] : i < 6 ? v[i - 3] : Y[i - 6]) += side == 0 ? -kStep : kStep;
        window_scene::rotation(w, R);
        window_scene::transform(view.R, view.t, Y, x);
        window_scene::transform(R, v, x, y);
        TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&o.camera, y, pixels[side], nullptr));
      }
      for (int r = 0; r < 2; ++r) J(r, i) = (pixels[1][r] - pixels[0][r]) / (2 * kStep);
      columns.push_back(i >= 6      ? 6 * free_views + 3 * observation.idx_point + i - 6
                        : block < 0 ? -1
                                    : 6 * block + i);
    }
    add(columns, J, 1);
    double x[3], pixel[2];
    window_scene::transform(view.R, view.t, X, x);
    tv_camera_project(&o.camera, x, pixel, nullptr);
    for (int r = 0; r < 2; ++r)
      sum_sq += (pixel[r] - observation.pixel[r]) * (pixel[r] - observation.pixel[r]);
  }
  for (const tv_distance_prior& prior : scene.distance_priors) {
    Eigen::MatrixXd J(1, 12);
    std::vector<int> columns;
    const int views[2] = {prior.idx_view0, prior.idx_view1};
    double C[2][3], length = 0;
    for (int v = 0; v < 2; ++v)
      window_scene::centre(scene.views[static_cast<size_t>(views[v])], C[v]);
    for (int i = 0; i < 3; ++i) length += (C[1][i] - C[0][i]) * (C[1][i] - C[0][i]);
    length = std::sqrt(length);
    for (int v = 0; v < 2; ++v) {
      for (int i = 0; i < 6; ++i) {
        J(0, 6 * v + i) = 0;
        const double* R = scene.views[static_cast<size_t>(views[v])].R;
        for (int k = 0; i >= 3 && k < 3; ++k) {  // d centre = -R' v
          J(0, 6 * v + i) -= (v == 0 ? -1 : 1) * (C[1][k] - C[0][k]) / length * R[3 * (i - 3) + k];
        }
        const int block = views[v] - num_views_known;
        columns.push_back(block < 0 ? -1 : 6 * block + i);
      }
    }
    add(columns, J, variance / (prior.sigma * prior.sigma));
  }
  const int freedom = static_cast<int>(2 * scene.observations.size() - static_cast<size_t>(n) +
                                       scene.distance_priors.size());
  TEST_ASSERT_TRUE(std::fabs(variance * freedom - sum_sq) <= 1e-6 * sum_sq);
  const Eigen::MatrixXd inverse = variance * H.inverse();
  for (int v = 0; v < o.num_views; ++v) {
    for (int i = 0; i < 36; ++i) {
      const double ours = covariances[static_cast<size_t>(36 * v + i)];
      const int b = 6 * (v - num_views_known);
      if (b < 0) {
        TEST_ASSERT_TRUE(ours == 0);
        continue;
      }
      const double size = std::sqrt(inverse(b + i / 6, b + i / 6) * inverse(b + i % 6, b + i % 6));
      TEST_ASSERT_TRUE(std::fabs(ours - inverse(b + i / 6, b + i % 6)) <= 1e-4 * size);
    }
  }
}

void test_covariances_are_those_of_the_dense_inverse() {
  Options o;
  o.num_views = 5;
  o.num_points = 40;
  o.longest_track = 5;
  expect_dense_covariances(o, 2);
  o.num_fixed = 1;
  o.distance_priors = true;
  expect_dense_covariances(o, 1);
}

// Without a fixed view the covariances are relative to the first one and to the distance to the
// farthest: as if the first were fixed and that distance known.
void test_covariances_without_a_fixed_view_are_relative() {
  Options o;
  o.num_views = 5;
  o.num_points = 60;
  o.longest_track = 5;
  o.num_fixed = 0;
  window_scene::make(o, &scene);
  std::vector<double> relative(36 * 5), known(36 * 5);
  tv_window_result result;
  const tv_window_options options = options_of(TV_LOSS_NONE, 1);
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, relative.data(), &result));
  TEST_ASSERT_TRUE(result.has_covariance && result.held_first_view && result.scale_is_free);
  double C[2][3], length = 0;
  window_scene::centre(scene.views[0], C[0]), window_scene::centre(scene.views[4], C[1]);
  for (int i = 0; i < 3; ++i) length += (C[1][i] - C[0][i]) * (C[1][i] - C[0][i]);
  scene.views[0].fixed = 1;
  scene.distance_priors.push_back({0, 4, std::sqrt(length), 1e-7});
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, known.data(), &result));
  TEST_ASSERT_TRUE(result.has_covariance && !result.held_first_view && !result.scale_is_free);
  for (size_t i = 0; i < relative.size(); ++i) {
    const size_t row = i / 36 * 36 + i % 36 / 6 * 7, column = i / 36 * 36 + i % 6 * 7;
    const double size = std::sqrt(known[row] * known[column]);
    TEST_ASSERT_TRUE(std::fabs(relative[i] - known[i]) <= 1e-3 * size);
  }
}

// The noise that the residuals give, with and without wrong observations, and the share of views in
// their 95 % ellipsoids: chi-square of 6 degrees of freedom, 12.592.
void test_covariances_hold_the_truth() {
  for (double outliers : {0.0, 0.1}) {
    int inside = 0, total = 0;
    double noise = 0;
    for (uint64_t seed = 1; seed <= 60; ++seed) {
      Options o;
      o.num_views = 8;
      o.num_points = 80;
      o.outlier_share = outliers;
      o.off_rad = 0.001, o.off_position = 0.005, o.off_point = 0.005;
      o.shortest_track = outliers > 0 ? 5 : 2;
      o.seed = seed;
      window_scene::make(o, &scene);
      std::vector<double> covariances(36 * 8);
      tv_window_result result;
      tv_window_options options = options_of(outliers > 0 ? TV_LOSS_CAUCHY : TV_LOSS_NONE, 2);
      TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, covariances.data(), &result));
      TEST_ASSERT_TRUE(result.has_covariance);
      noise += result.noise_px / 60;
      for (size_t v = 2; v < 8; ++v) {
        // x_true = exp([w]x) x + v for each point x of the camera's frame.
        const tv_window_view &truth = scene.true_views[v], &found = scene.views[v];
        double turn[9], Rt[9];
        for (int i = 0; i < 9; ++i) Rt[i] = found.R[i % 3 * 3 + i / 3];
        window_scene::multiply(truth.R, Rt, turn);
        Eigen::Matrix<double, 6, 1> off;
        off << 0.5 * (turn[7] - turn[5]), 0.5 * (turn[2] - turn[6]), 0.5 * (turn[3] - turn[1]), 0,
            0, 0;
        for (int i = 0; i < 3; ++i) {
          off[3 + i] = truth.t[i] - (turn[3 * i] * found.t[0] + turn[3 * i + 1] * found.t[1] +
                                     turn[3 * i + 2] * found.t[2]);
        }
        const Eigen::Map<Eigen::Matrix<double, 6, 6>> C(&covariances[36 * v]);
        inside += off.dot(C.ldlt().solve(off)) < 12.592;
        ++total;
      }
    }
    std::printf("outliers %g: %d of %d in their ellipsoids, noise %.3f px\n", outliers, inside,
                total, noise);
    TEST_ASSERT_TRUE(inside >= 0.90 * total && inside <= 0.985 * total);
    TEST_ASSERT_TRUE(noise > 0.46 && noise < 0.54);
  }
}

void test_the_order_of_observations_does_not_matter() {
  Options o;
  o.outlier_share = 0.1;
  o.sigmas = true;
  window_scene::make(o, &scene);
  Scene shuffled = scene;
  Random random(5);
  for (size_t i = shuffled.observations.size() - 1; i > 0; --i) {
    std::swap(shuffled.observations[i],
              shuffled.observations[static_cast<size_t>(random.uniform(0, 1.0 * (i + 1)))]);
  }
  tv_window_result results[2];
  const tv_window_options options = options_of(TV_LOSS_CAUCHY, 2);
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, nullptr, &results[0]));
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&shuffled, options, nullptr, &results[1]));
  TEST_ASSERT_EQUAL_MEMORY(&results[0], &results[1], sizeof results[0]);
  TEST_ASSERT_EQUAL_MEMORY(scene.views.data(), shuffled.views.data(),
                           scene.views.size() * sizeof(tv_window_view));
  TEST_ASSERT_EQUAL_MEMORY(scene.points.data(), shuffled.points.data(),
                           scene.points.size() * sizeof(double));
}

// A similarity of the world changes nothing but the coordinates.
void test_the_minimum_does_not_depend_on_the_frame_or_the_scale() {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Options o;
    o.num_fixed = 0;
    o.num_points = 200;
    o.seed = seed;
    window_scene::make(o, &scene);
    Scene other = scene;
    Random random(seed);
    double w[3], R[9], t[3];
    for (int i = 0; i < 3; ++i) w[i] = random.normal(), t[i] = 100 * random.normal();
    const double scale = std::exp(3 * random.normal());
    window_scene::rotation(w, R);
    for (size_t p = 0; p < other.points.size(); p += 3) {
      double X[3] = {scale * scene.points[p], scale * scene.points[p + 1],
                     scale * scene.points[p + 2]};
      window_scene::transform(R, t, X, &other.points[p]);
    }
    for (size_t v = 0; v < other.views.size(); ++v) {
      double C[3], moved[3], back[9], turned[9];
      window_scene::centre(scene.views[v], C);
      for (double& c : C) c *= scale;
      window_scene::transform(R, t, C, moved);
      for (int i = 0; i < 9; ++i) back[i] = R[i % 3 * 3 + i / 3];
      window_scene::multiply(scene.views[v].R, back, turned);
      window_scene::set_pose(turned, moved, &other.views[v]);
    }
    const tv_window_view first = other.views[0];
    tv_window_result results[2];
    const tv_window_options options = options_of(TV_LOSS_HUBER, 1);
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, nullptr, &results[0]));
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&other, options, nullptr, &results[1]));
    TEST_ASSERT_TRUE(results[0].held_first_view && results[0].scale_is_free);
    TEST_ASSERT_EQUAL_MEMORY(&first, &other.views[0], sizeof first);
    TEST_ASSERT_TRUE(std::fabs(results[0].initial_cost - results[1].initial_cost) <=
                     1e-8 * results[0].initial_cost);
    TEST_ASSERT_TRUE(std::fabs(results[0].final_cost - results[1].final_cost) <=
                     1e-8 * results[0].final_cost);
  }
}

// The widest distance between two of the views that see a point, and that between the first of them
// and the point.
void distances_of(const Scene& s, int32_t idx_point, double* baseline, double* distance) {
  std::vector<double> centres;
  for (const tv_observation& o : s.observations) {
    if (o.idx_point != idx_point) continue;
    double C[3];
    window_scene::centre(s.views[static_cast<size_t>(o.idx_view)], C);
    centres.insert(centres.end(), C, C + 3);
  }
  const auto between = [](const double* a, const double* b) {
    return std::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                     (a[2] - b[2]) * (a[2] - b[2]));
  };
  *baseline = 0;
  for (size_t i = 0; i < centres.size(); i += 3) {
    for (size_t j = 0; j < i; j += 3) {
      *baseline = std::max(*baseline, between(&centres[i], &centres[j]));
    }
  }
  *distance = between(&centres[0], &s.points[3 * static_cast<size_t>(idx_point)]);
}

// Tracks whose pixels move as if their points lay beyond infinity: without a limit such points go
// on by a factor of ten in each step.
void test_points_stay_within_a_million_baselines() {
  for (tv_loss loss : {TV_LOSS_NONE, TV_LOSS_HUBER, TV_LOSS_CAUCHY}) {
    Options o;
    o.num_views = 8;
    o.num_points = 400;
    o.shortest_track = 4;
    o.off_rad = 0.001, o.off_position = 0.005, o.off_point = 0.005;
    window_scene::make(o, &scene);
    double first[2] = {0, 0};
    int32_t previous = -1;
    for (tv_observation& observation : scene.observations) {
      if (observation.idx_point % 20 != 0) continue;
      for (int i = 0; i < 2; ++i) {
        if (observation.idx_point != previous) first[i] = observation.pixel[i];
        observation.pixel[i] = 2 * first[i] - observation.pixel[i];
      }
      previous = observation.idx_point;
    }
    tv_window_result result;
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options_of(loss, 2), nullptr, &result));
    TEST_ASSERT_TRUE(result.converged);
    int num_far = 0;
    double farthest = 0;
    for (int32_t p = 0; p < o.num_points; ++p) {
      double baseline, distance;
      distances_of(scene, p, &baseline, &distance);
      farthest = std::max(farthest, distance / baseline);
      num_far += distance > 1e5 * baseline;
    }
    std::printf("loss %d: %d points are far, the farthest at %.3g baselines, %d steps\n", loss,
                num_far, farthest, result.num_iterations);
    TEST_ASSERT_TRUE(farthest <= 1.1e6);  // the views still move when a point is there
    TEST_ASSERT_TRUE(num_far >= 5);
  }
}

// A tenth of the observations is wrong, and so points of short tracks are far: the steps must not
// go on expecting what moving these away would gain.
void test_far_points_do_not_keep_the_steps_from_ending() {
  Options o;
  o.num_views = o.longest_track = 7;
  o.num_points = 2000;
  o.outlier_share = 0.1;
  window_scene::make(o, &scene);
  tv_window_options options;
  tv_window_options_init(&options);
  tv_window_result result;
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, nullptr, &result));
  TEST_ASSERT_TRUE(result.converged);
  TEST_ASSERT_LESS_OR_EQUAL_INT(15, result.num_iterations);
}

// Points that start far away, half of them about as far as points may go, are brought back by their
// pixels; the minimum is that from a near start.
void test_far_points_come_back() {
  for (tv_loss loss : {TV_LOSS_NONE, TV_LOSS_CAUCHY}) {
    Options o;
    o.num_views = 8;
    o.num_points = 200;
    o.shortest_track = 4;
    window_scene::make(o, &scene);
    const Scene start = scene;
    tv_window_result near, far;
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options_of(loss, 2), nullptr, &near));
    const std::vector<double> expected = scene.points;
    scene = start;
    for (size_t p = 0; p < 20; ++p) {
      const double times = p % 2 == 0 ? 1e4 : 3e5;  // of 1 to 13 baselines
      for (size_t k = 3 * p; k < 3 * p + 3; ++k) scene.points[k] *= times;
    }
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options_of(loss, 2), nullptr, &far));
    std::printf("loss %d: cost %.12g from a near start, %.12g from far points, %d steps\n", loss,
                near.final_cost, far.final_cost, far.num_iterations);
    TEST_ASSERT_TRUE(far.converged && far.initial_cost > 2 * near.final_cost);
    TEST_ASSERT_TRUE(std::fabs(far.final_cost - near.final_cost) <= 1e-6 * near.final_cost);
    for (size_t k = 0; k < expected.size(); ++k) {
      TEST_ASSERT_TRUE(std::fabs(scene.points[k] - expected[k]) <=
                       1e-3 * (1 + std::fabs(expected[k])));
    }
  }
}

// The lens model linearised at the pixels gives the poses of the lens itself: the differences are
// far below the noise of the poses.
void test_a_linearised_lens_gives_the_poses_of_the_lens() {
  for (const tv_camera& camera : {brown(), fisheye()}) {
    Options o;
    o.camera = camera;
    o.num_points = 300;
    window_scene::make(o, &scene);
    tv_window_result result;
    const tv_window_options options = options_of(TV_LOSS_NONE, 1);
    TEST_ASSERT_EQUAL_INT(TV_OK, adjust(&scene, options, nullptr, &result));
    double sum_sq = 0;
    for (const tv_observation& observation : scene.observations) {
      const tv_window_view& view = scene.views[static_cast<size_t>(observation.idx_view)];
      double x[3], pixel[2];
      window_scene::transform(view.R, view.t,
                              &scene.points[3 * static_cast<size_t>(observation.idx_point)], x);
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, x, pixel, nullptr));
      for (int i = 0; i < 2; ++i)
        sum_sq += (pixel[i] - observation.pixel[i]) * (pixel[i] - observation.pixel[i]);
    }
    std::printf("cost %.9g linearised, %.9g through the lens\n", result.final_cost, sum_sq);
    TEST_ASSERT_TRUE(std::fabs(sum_sq - result.final_cost) <= 1e-4 * sum_sq);
  }
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_known_ray_gives_the_same_observation);
  RUN_TEST(test_a_residual_is_the_projection_near_its_pixel);
  RUN_TEST(test_derivatives_of_an_observation_agree_with_differences);
  RUN_TEST(test_derivatives_of_priors_agree_with_differences);
  RUN_TEST(test_the_cost_of_a_pose_prior_of_half_a_turn_is_known);
  RUN_TEST(test_the_cost_of_an_exact_half_turn_is_not_zero);
  RUN_TEST(test_the_factorisation_solves_like_a_dense_one);
  RUN_TEST(test_blocks_of_zeros_change_no_solution);
  RUN_TEST(test_covariances_are_those_of_the_dense_inverse);
  RUN_TEST(test_covariances_without_a_fixed_view_are_relative);
  RUN_TEST(test_covariances_hold_the_truth);
  RUN_TEST(test_the_order_of_observations_does_not_matter);
  RUN_TEST(test_the_minimum_does_not_depend_on_the_frame_or_the_scale);
  RUN_TEST(test_a_linearised_lens_gives_the_poses_of_the_lens);
  RUN_TEST(test_points_stay_within_a_million_baselines);
  RUN_TEST(test_far_points_do_not_keep_the_steps_from_ending);
  RUN_TEST(test_far_points_come_back);
  return UNITY_END();
}
