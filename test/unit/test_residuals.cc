// Residuals in pixels, compared with textbook formulas and with each other; their derivatives
// compared with finite differences.
#include <cmath>
#include <cstdlib>

#include "geometry/normal_equations.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/matches.h"
#include "robust/models.h"
#include "robust/refine.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Loss;
using tv::Mat3;
using tv::RobustLoss;
using tv::Vec3;

alignas(64) uint8_t arena_memory[1 << 21];
scene::Scene pair;
tv::Matches matches;

// The matches of a scene, prepared as the library does it.
void prepare(const scene::Options& options) {
  scene::make(options, &pair);
  tv::TwoViewProblem problem{};
  problem.calibrated = true;
  for (int v = 0; v < 2; ++v) {
    problem.camera[v] = tv::prepare_camera(options.camera[v]);
    problem.pixels[v] = pair.pixels[v];
  }
  problem.ratios = pair.ratios;
  problem.num = options.num;
  TEST_ASSERT_TRUE(tv::matches_bytes(options.num) <= sizeof arena_memory);
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  matches = tv::Matches{};
  tv::prepare_matches(problem, arena, &matches);
}

scene::Options with_cameras(const tv_camera& a, const tv_camera& b, uint64_t seed) {
  scene::Options options;
  options.camera[0] = a;
  options.camera[1] = b;
  options.num = 200;
  options.inlier_share = 0.7;
  options.seed = seed;
  return options;
}

Mat3 inverse_intrinsics(const tv_camera& c) { return tv::inverse_intrinsics(tv::intrinsics_of(c)); }

void test_sampson_of_a_pinhole_is_the_textbooks(void) {
  tv_camera second = scene::pinhole();
  second.fx = 420, second.fy = 480, second.cx = 300;
  prepare(with_cameras(scene::pinhole(), second, 1));
  const Mat3 E = tv::essential_from_pose({pair.R, pair.t});
  const Mat3 F = inverse_intrinsics(second).transpose() * E * inverse_intrinsics(scene::pinhole());
  for (int i = 0; i < matches.pairs.num; ++i) {
    const int k = matches.order[i];
    const Vec3 x0(pair.pixels[0][2 * k], pair.pixels[0][2 * k + 1], 1);
    const Vec3 x1(pair.pixels[1][2 * k], pair.pixels[1][2 * k + 1], 1);
    const Vec3 line1 = F * x0, line0 = F.transpose() * x1;
    const double c = x1.dot(line1);
    const double expected = c * c / (line1.head<2>().squaredNorm() + line0.head<2>().squaredNorm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 + expected), expected, tv::sampson_sq(matches.pairs, i, E));
  }
}

// The reference is |c| / |gradient of c|, where c = f1' E f0, and the gradient by the pixels comes
// from central differences through the camera model.
void test_sampson_is_in_pixels_of_the_image_for_every_lens(void) {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (int a = 0; a < 3; ++a) {
    const tv_camera model[2] = {lenses[a], lenses[(a + 1) % 3]};
    prepare(with_cameras(model[0], model[1], 2 + a));
    const tv::Camera cameras[2] = {tv::prepare_camera(model[0]), tv::prepare_camera(model[1])};
    const Mat3 E = tv::essential_from_pose({pair.R, pair.t});
    TEST_ASSERT_TRUE(matches.pairs.num > 150);
    for (int i = 0; i < matches.pairs.num; ++i) {
      const int k = matches.order[i];
      // Wrong matches are skipped: far from the model the residual depends on the scale of the
      // rays.
      if (!pair.inlier[k]) continue;
      double gradient_sq = 0, c = 0;
      for (int v = 0; v < 2; ++v) {
        for (int d = 0; d < 2; ++d) {
          double value[2];
          for (int side = 0; side < 2; ++side) {
            tv::Vec2 p[2] = {tv::Vec2(pair.pixels[0] + 2 * k), tv::Vec2(pair.pixels[1] + 2 * k)};
            Vec3 f0, f1;
            p[v][d] += side == 0 ? -1e-3 : 1e-3;
            TEST_ASSERT_TRUE(tv::unproject(cameras[0], p[0], &f0, nullptr));
            TEST_ASSERT_TRUE(tv::unproject(cameras[1], p[1], &f1, nullptr));
            value[side] = f1.dot(E * f0);
          }
          const double slope = (value[1] - value[0]) / 2e-3;
          gradient_sq += slope * slope;
          c = 0.5 * (value[0] + value[1]);
        }
      }
      const double expected = std::sqrt(c * c / gradient_sq);
      TEST_ASSERT_DOUBLE_WITHIN(1e-3 + 0.01 * expected, expected,
                                std::sqrt(tv::sampson_sq(matches.pairs, i, E)));
    }
  }
}

void test_fast_score_is_the_sum_of_the_capped_residuals(void) {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (int a = 0; a < 3; ++a) {
    for (int num : {1, 31, 32, 33, 200}) {
      scene::Options options = with_cameras(lenses[a], lenses[a], 20 + a);
      options.num = num;
      prepare(options);
      const Mat3 E = tv::essential_from_pose({pair.R, pair.t});
      for (double threshold : {0.1, 1.0, 10.0}) {
        double expected = 0;
        for (int i = 0; i < matches.pairs.num; ++i) {
          const double q = tv::sampson_sq(matches.pairs, i, E) / (threshold * threshold);
          expected += q < 1 ? q : 1;
        }
        const double cost =
            static_cast<double>(tv::msac_cost_fast(matches.pairs, E, threshold, INT64_MAX));
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * num + 0.01, expected, cost / tv::kCostOne);
      }
    }
  }
}

void test_fast_score_gives_up_above_the_bound_only(void) {
  int kept = 0;
  constexpr int kRounds = 200;
  for (int round = 0; round < kRounds; ++round) {
    scene::Options options =
        with_cameras(scene::pinhole(), scene::pinhole(), 300 + static_cast<uint64_t>(round));
    options.inlier_share = 0.3 + 0.5 * round / kRounds;
    prepare(options);
    const Mat3 E = tv::essential_from_pose({pair.R, pair.t});
    const int64_t full = tv::msac_cost_fast(matches.pairs, E, 1, INT64_MAX);
    TEST_ASSERT_TRUE(tv::msac_cost_fast(matches.pairs, E, 1, full / 2) > full / 2);
    const int64_t cost = tv::msac_cost_fast(matches.pairs, E, 1, full);
    TEST_ASSERT_TRUE(cost >= full);
    kept += cost == full;
  }
  TEST_ASSERT_TRUE(kept >= kRounds - 2);
}

void test_squares_of_many_are_those_of_each(void) {
  const tv_camera lenses[] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (int lens = 0; lens < 3; ++lens) {
    prepare(with_cameras(lenses[lens], lenses[lens], 40 + static_cast<uint64_t>(lens)));
    const Mat3 E = tv::cross_matrix(pair.t) * pair.R;
    double squares[200];
    tv::sampson_squares(matches.pairs, 3, 101, E, squares);
    for (int k = 0; k < 101; ++k) {
      TEST_ASSERT_TRUE(squares[k] == tv::sampson_sq(matches.pairs, 3 + k, E));
    }
    const tv::Pose poses[2] = {{pair.R, pair.t}, {pair.R, -pair.t}};
    int behind[2] = {};
    for (int p = 0; p < 2; ++p) {
      tv::pose_squares(matches.pairs, 3, 101, poses[p], 1.5, squares);
      for (int k = 0; k < 101; ++k) {
        const int i = 3 + k;
        const bool in_front =
            tv::depth_vote(tv::depth_signs(poses[p], tv::ray_of(matches.pairs, 0, i),
                                           tv::ray_of(matches.pairs, 1, i),
                                           1.5 * matches.pairs.pixel_angle[i])) >= 0;
        behind[p] += !in_front;
        TEST_ASSERT_TRUE(squares[k] == (in_front ? tv::sampson_sq(matches.pairs, i,
                                                                  tv::essential_from_pose(poses[p]))
                                                 : INFINITY));
      }
    }
    TEST_ASSERT_TRUE(behind[0] < 30 && behind[1] > 60);
    tv::transfer_squares(matches.pairs, 3, 101, pair.R, squares);
    for (int k = 0; k < 101; ++k) {
      TEST_ASSERT_TRUE(squares[k] == tv::transfer_residual(matches.pairs, 3 + k, pair.R).r_sq);
    }
    const int32_t listed[5] = {7, 7, 150, 0, 12};
    tv::sampson_squares(matches.pairs, listed, 5, E, squares);
    for (int k = 0; k < 5; ++k) {
      TEST_ASSERT_TRUE(squares[k] == tv::sampson_sq(matches.pairs, listed[k], E));
    }
  }
}

void test_matrices_that_say_nothing_cost_the_most(void) {
  prepare(with_cameras(scene::pinhole(), scene::distorted(), 31));
  const int64_t most = static_cast<int64_t>(matches.pairs.num) * tv::kCostOne;
  Mat3 M = Mat3::Zero();
  TEST_ASSERT_TRUE(tv::msac_cost_fast(matches.pairs, M, 1, INT64_MAX) == most);
  TEST_ASSERT_FALSE(tv::sampson_sq(matches.pairs, 0, M) < 1e300);
  M(1, 1) = NAN;
  TEST_ASSERT_TRUE(tv::msac_cost_fast(matches.pairs, M, 1, INT64_MAX) == most);
  TEST_ASSERT_FALSE(tv::sampson_sq(matches.pairs, 0, M) < 1e300);
  TEST_ASSERT_FALSE(tv::transfer_residual(matches.pairs, 0, M).r_sq < 1e300);
}

void test_transfer_residual_of_a_pinhole_is_the_textbooks(void) {
  prepare(with_cameras(scene::pinhole(), scene::pinhole(), 32));
  const Mat3 H = pair.R;  // H may be any matrix that keeps the points in front of the camera
  const Mat3 Ki = inverse_intrinsics(scene::pinhole());
  const Mat3 G = Ki.inverse() * H * Ki;
  for (int i = 0; i < matches.pairs.num; ++i) {
    const int k = matches.order[i];
    const Vec3 x0(pair.pixels[0][2 * k], pair.pixels[0][2 * k + 1], 1);
    const tv::Vec2 x1(pair.pixels[1] + 2 * k);
    const Vec3 g = G * x0;
    const tv::Vec2 d = g.head<2>() / g[2] - x1;
    Eigen::Matrix2d D;
    for (int r = 0; r < 2; ++r) {
      for (int c = 0; c < 2; ++c) D(r, c) = (G(r, c) - g[r] / g[2] * G(2, c)) / g[2];
    }
    const Eigen::Matrix2d S = Eigen::Matrix2d::Identity() + D * D.transpose();
    const tv::TransferResidual r = tv::transfer_residual(matches.pairs, i, H);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8 * (1 + d.squaredNorm()), d.squaredNorm(), r.d_sq);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8 * (1 + d.squaredNorm()), d.dot(S.inverse() * d), r.r_sq);
  }
}

// The gradient is half the derivative of scale^2 * cost; it is compared along each parameter with
// central differences.
template <typename Model>
void check_gradient(const Model& model, const RobustLoss& loss, const double* steps) {
  constexpr int P = Model::kParameters;
  double upper[P * (P + 1) / 2], gradient[P], unused_upper[P * (P + 1) / 2], unused[P];
  const int n = matches.pairs.num;
  model.normal_equations(matches.pairs, nullptr, n, loss, upper, gradient);
  double size = 0;
  for (int p = 0; p < P; ++p) size = std::fmax(size, std::fabs(gradient[p]));
  for (int p = 0; p < P; ++p) {
    double cost[2];
    for (int side = 0; side < 2; ++side) {
      double step[P] = {};
      step[p] = side == 0 ? -steps[p] : steps[p];
      cost[side] = model.stepped(step).normal_equations(matches.pairs, nullptr, n, loss,
                                                        unused_upper, unused);
    }
    const double slope = 0.5 * loss.scale_px * loss.scale_px * (cost[1] - cost[0]) / (2 * steps[p]);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4 * size, slope, gradient[p]);
  }
}

const double kSteps[7] = {1e-7, 1e-7, 1e-7, 1e-7, 1e-7, 1e-7, 1e-7};

tv::Pose nearby_pose() {
  return tv::Pose{tv::rotation_step(Vec3(1e-3, -2e-3, 1e-3)) * pair.R,
                  (pair.t + Vec3(0.01, 0.02, -0.01)).normalized()};
}

void test_slopes_of_a_pose_agree_with_differences(void) {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (int a = 0; a < 3; ++a) {
    scene::Options options = with_cameras(lenses[a], lenses[(a + 1) % 3], 40 + a);
    options.inlier_share = 1;
    prepare(options);
    check_gradient(tv::PoseModel{nearby_pose()}, RobustLoss{Loss::kCauchy, 1.5}, kSteps);
    check_gradient(tv::PoseModel{nearby_pose()}, RobustLoss{Loss::kTruncated, 1e4}, kSteps);
  }
}

void test_slopes_of_a_fundamental_matrix_agree_with_differences(void) {
  scene::Options options = with_cameras(scene::pinhole(), scene::pinhole(), 50);
  options.inlier_share = 1;
  prepare(options);
  tv::FundamentalModel model = tv::fundamental_model(tv::essential_from_pose(nearby_pose()));
  model.s = 0.8;
  check_gradient(model, RobustLoss{Loss::kCauchy, 5}, kSteps);
}

void test_slopes_of_a_rotation_agree_with_differences(void) {
  const tv_camera lenses[2] = {scene::distorted(), scene::fisheye()};
  for (int a = 0; a < 2; ++a) {
    scene::Options options = with_cameras(lenses[a], lenses[1 - a], 60 + a);
    options.kind = scene::Kind::kRotation;
    options.inlier_share = 1;
    // The slopes take the weights (I + DD')^-1 as constant, which is exact only at residual 0.
    options.noise_px = 0;
    prepare(options);
    const Mat3 R = tv::rotation_step(Vec3(1e-4, -2e-4, 1e-4)) * pair.R;
    check_gradient(tv::RotationModel{R}, RobustLoss{Loss::kTruncated, 1e4}, kSteps);
  }
}

void test_refinement_finds_the_exact_pose_from_nearby(void) {
  scene::Options options = with_cameras(scene::distorted(), scene::pinhole(), 70);
  options.inlier_share = 1;
  options.noise_px = 0;
  prepare(options);
  tv::PoseModel model{nearby_pose()};
  tv::refine(matches.pairs, nullptr, matches.pairs.num, RobustLoss{Loss::kCauchy, 1}, 30, &model);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, (model.pose.R - pair.R).norm());
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, (model.pose.t - pair.t).norm());
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_sampson_of_a_pinhole_is_the_textbooks);
  RUN_TEST(test_sampson_is_in_pixels_of_the_image_for_every_lens);
  RUN_TEST(test_fast_score_is_the_sum_of_the_capped_residuals);
  RUN_TEST(test_fast_score_gives_up_above_the_bound_only);
  RUN_TEST(test_squares_of_many_are_those_of_each);
  RUN_TEST(test_matrices_that_say_nothing_cost_the_most);
  RUN_TEST(test_transfer_residual_of_a_pinhole_is_the_textbooks);
  RUN_TEST(test_slopes_of_a_pose_agree_with_differences);
  RUN_TEST(test_slopes_of_a_fundamental_matrix_agree_with_differences);
  RUN_TEST(test_slopes_of_a_rotation_agree_with_differences);
  RUN_TEST(test_refinement_finds_the_exact_pose_from_nearby);
  return UNITY_END();
}
