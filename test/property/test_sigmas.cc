// Matches whose pixels differ in precision (tv_pixel_pairs.sigmas0, sigmas1): residuals against
// their definitions, poses and covariances against the truth and against the bound that no estimate
// can beat, and the symmetries that the sigmas must not break. TWOVIEW_PAIRS, TWOVIEW_SEED: how
// many pairs the statistics take (200, or 20 under sanitizers), and which.
#include <Eigen/Cholesky>
#include <utility>

#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/chance.h"
#include "robust/matches.h"
#include "robust/models.h"
#include "support/bundle_scene.h"
#include "support/calls.h"
#include "support/estimator.h"
#include "support/pair_kinds.h"
#include "support/sanitized.h"

namespace {

using scene::uniform;
using scene::Vec5;
using tv::Mat3;
using tv::Vec3;
using Mat5 = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;

tv_context* context;
alignas(64) uint8_t arena_memory[1 << 21];
scene::Scene pair;
pair_kinds::Pair drawn;
bundle_scene::Scene bundle;
float sigmas[2][scene::kMaxMatches];
int num_pairs = kSanitized ? 20 : 200;
uint64_t base_seed = 1;

tv::Matches prepared(const tv_camera camera[2], const double* const pixels[2], int num,
                     const float* sigmas0, const float* sigmas1) {
  tv::TwoViewProblem problem{};
  problem.calibrated = true;
  for (int v = 0; v < 2; ++v) {
    problem.camera[v] = tv::prepare_camera(camera[v]);
    problem.pixels[v] = pixels[v];
  }
  problem.sigmas[0] = sigmas0;
  problem.sigmas[1] = sigmas1;
  problem.num = num;
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  tv::Matches matches;
  tv::prepare_matches(problem, arena, &matches);
  return matches;
}

tv::Matches prepared_pair() {
  const double* const pixels[2] = {pair.pixels[0], pair.pixels[1]};
  return prepared(pair.options.camera, pixels, pair.options.num, sigmas[0], sigmas[1]);
}

void draw_sigmas(uint64_t seed, double least, double most) {
  tv::Random random = tv::random_seeded(seed);
  for (auto& view : sigmas) {
    for (float& sigma : view) sigma = static_cast<float>(uniform(&random, least, most));
  }
}

void make_pair(uint64_t seed, const tv_camera& first, const tv_camera& second) {
  scene::Options options;
  options.camera[0] = first;
  options.camera[1] = second;
  options.num = 200;
  options.seed = seed;
  scene::make(options, &pair);
}

using Quad = long double;

// x' M y in extended precision.
struct Line {
  Quad a[3];
};
Line line_of(const Quad M[3][3], const Quad x[3], bool transposed) {
  Line line{};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) line.a[r] += (transposed ? M[c][r] : M[r][c]) * x[c];
  }
  return line;
}

struct PinholePair {
  Quad F[3][3];
};
PinholePair fundamental_of(const tv_camera camera[2], const Mat3& E) {
  PinholePair result{};
  Quad inverse[2][3][3] = {};
  for (int v = 0; v < 2; ++v) {
    inverse[v][0][0] = 1 / Quad{camera[v].fx};
    inverse[v][1][1] = 1 / Quad{camera[v].fy};
    inverse[v][0][2] = -Quad{camera[v].cx} / camera[v].fx;
    inverse[v][1][2] = -Quad{camera[v].cy} / camera[v].fy;
    inverse[v][2][2] = 1;
  }
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          result.F[r][c] += inverse[1][i][r] * Quad{E(i, j)} * inverse[0][j][c];
        }
      }
    }
  }
  return result;
}

// Sampson's distance over sigmas, by its definition: c / |gradient of c by the four coordinates,
// each in units of its sigma|.
Quad defined_sampson(const PinholePair& p, const Quad x0[3], const Quad x1[3], Quad sigma0,
                     Quad sigma1) {
  const Line line1 = line_of(p.F, x0, false), line0 = line_of(p.F, x1, true);
  Quad c = 0, gradient_sq = 0;
  for (int k = 0; k < 3; ++k) c += x1[k] * line1.a[k];
  for (int k = 0; k < 2; ++k) {
    gradient_sq += sigma0 * sigma0 * line0.a[k] * line0.a[k];
    gradient_sq += sigma1 * sigma1 * line1.a[k] * line1.a[k];
  }
  return c / sqrtl(gradient_sq);
}

// The least sum of |e0|^2 / sigma0^2 + |e1|^2 / sigma1^2 of corrections e that make the pixels meet
// the epipolar constraint: Newton steps on the constraint, each onto the nearest point of its
// linearisation.
Quad optimum(const PinholePair& p, const Quad x0[3], const Quad x1[3], Quad sigma0, Quad sigma1) {
  Quad e0[2] = {}, e1[2] = {};
  for (int step = 0; step < 20; ++step) {
    const Quad y0[3] = {x0[0] + e0[0], x0[1] + e0[1], 1}, y1[3] = {x1[0] + e1[0], x1[1] + e1[1], 1};
    const Line line1 = line_of(p.F, y0, false), line0 = line_of(p.F, y1, true);
    Quad c = 0, gradient_sq = 0;
    for (int k = 0; k < 3; ++k) c += y1[k] * line1.a[k];
    for (int k = 0; k < 2; ++k) {
      c -= line0.a[k] * e0[k] + line1.a[k] * e1[k];
      gradient_sq += sigma0 * sigma0 * line0.a[k] * line0.a[k];
      gradient_sq += sigma1 * sigma1 * line1.a[k] * line1.a[k];
    }
    for (int k = 0; k < 2; ++k) {
      e0[k] = -c * sigma0 * sigma0 * line0.a[k] / gradient_sq;
      e1[k] = -c * sigma1 * sigma1 * line1.a[k] / gradient_sq;
    }
  }
  Quad sum = 0;
  for (int k = 0; k < 2; ++k) {
    sum += e0[k] * e0[k] / (sigma0 * sigma0) + e1[k] * e1[k] / (sigma1 * sigma1);
  }
  return sum;
}

void test_the_residual_is_the_definition_and_the_optimum(void) {
  tv_camera second = scene::pinhole();
  second.fx = 420, second.fy = 480, second.cx = 300;
  make_pair(1, scene::pinhole(), second);
  draw_sigmas(2, 0.2, 8);
  const tv::Matches matches = prepared_pair();
  // A pose that is a little off, so that residuals are of a few pixels.
  const Mat3 E =
      tv::essential_from_pose({tv::rotation_about(Vec3(0, 1, 0), 0.003) * pair.R, pair.t});
  const PinholePair p = fundamental_of(pair.options.camera, E);
  double squares[200];
  tv::sampson_squares(matches.pairs, 0, 200, E, squares);
  double largest = 0;
  for (int k = 0; k < 200; ++k) {
    const int i = matches.order[k];
    const Quad x0[3] = {pair.pixels[0][2 * i], pair.pixels[0][2 * i + 1], 1};
    const Quad x1[3] = {pair.pixels[1][2 * i], pair.pixels[1][2 * i + 1], 1};
    const Quad sigma0 = sigmas[0][i], sigma1 = sigmas[1][i];
    const Quad r = defined_sampson(p, x0, x1, sigma0, sigma1);
    const double expected = static_cast<double>(r * r);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * expected + 1e-12, expected, squares[k]);
    TEST_ASSERT_DOUBLE_WITHIN(0.03 * expected + 1e-6,
                              static_cast<double>(optimum(p, x0, x1, sigma0, sigma1)), squares[k]);
    largest = std::fmax(largest, expected);
  }
  TEST_ASSERT_TRUE(largest > 1);
}

// r^2 = d' (s1^2 I + s0^2 D D')^-1 d, with d the displacement in pixels of image 1 and D the
// prediction's slope, here by differences through the cameras.
void test_the_transfer_residual_is_weighted_by_both_sigmas(void) {
  const tv_camera lenses[3] = {scene::pinhole(), scene::distorted(), scene::fisheye()};
  for (int a = 0; a < 3; ++a) {
    scene::Options options;
    options.kind = scene::Kind::kRotation;
    options.num = 100;
    options.seed = 5 + static_cast<uint64_t>(a);
    options.camera[0] = lenses[a];
    options.camera[1] = lenses[(a + 1) % 3];
    scene::make(options, &pair);
    draw_sigmas(6, 0.2, 8);
    const tv::Matches matches = prepared_pair();
    const tv::Camera cameras[2] = {tv::prepare_camera(options.camera[0]),
                                   tv::prepare_camera(options.camera[1])};
    const auto predicted = [&](double x, double y) {
      Vec3 ray;
      tv::Vec2 seen(0, 0);
      TEST_ASSERT_TRUE(tv::unproject(cameras[0], tv::Vec2(x, y), &ray, nullptr));
      TEST_ASSERT_TRUE(tv::project(cameras[1], pair.R * ray, &seen, nullptr));
      return seen;
    };
    for (int k = 0; k < matches.pairs.num; ++k) {
      const int i = matches.order[k];
      const double x = pair.pixels[0][2 * i], y = pair.pixels[0][2 * i + 1], h = 1e-4;
      const double s0 = sigmas[0][i], s1 = sigmas[1][i];
      const tv::Vec2 d =
          predicted(x, y) - tv::Vec2(pair.pixels[1][2 * i], pair.pixels[1][2 * i + 1]);
      Eigen::Matrix2d D;
      D.col(0) = (predicted(x + h, y) - predicted(x - h, y)) / (2 * h);
      D.col(1) = (predicted(x, y + h) - predicted(x, y - h)) / (2 * h);
      const Eigen::Matrix2d C = s1 * s1 * Eigen::Matrix2d::Identity() + s0 * s0 * D * D.transpose();
      const double expected = d.dot(C.inverse() * d);
      TEST_ASSERT_DOUBLE_WITHIN(0.02 * expected + 1e-6, expected,
                                tv::transfer_residual(matches.pairs, k, pair.R).r_sq);
    }
  }
}

// The share of the image that a wrong match's band or disc covers grows with its sigma.
void test_chance_grows_with_the_sigmas(void) {
  make_pair(3, scene::pinhole(), scene::pinhole());
  const Mat3 E = tv::essential_from_pose({pair.R, pair.t});
  double of[3];
  for (int k = 0; k < 3; ++k) {
    const double least = k == 1 ? 4 : 1, most = k == 0 ? 1 : 4;
    for (int i = 0; i < scene::kMaxMatches; ++i) {
      sigmas[0][i] = sigmas[1][i] = static_cast<float>(i % 2 == 0 ? least : most);
    }
    const tv::Matches matches = prepared_pair();
    const tv::SigmaMeans means = tv::sigma_means(matches);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * (least + most), means.s);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * (least * least + most * most), means.s_sq);
    of[k] = tv::chance_of_agreement(matches, E, 1, 1);
  }
  // Sigmas of 4 are a threshold four times as large.
  for (float& sigma : sigmas[0]) sigma = 1;
  for (float& sigma : sigmas[1]) sigma = 1;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, of[1], tv::chance_of_agreement(prepared_pair(), E, 4, 1));
  TEST_ASSERT_TRUE(of[0] < of[2] && of[2] < of[1]);
}

tv_two_view estimate(const tv_camera& c0, const tv_camera& c1, const double* pixels0,
                     const double* pixels1, int num, const float* sigmas0, const float* sigmas1,
                     const tv_estimate_options* options, uint8_t* mask) {
  tv_two_view result;
  tv_two_view_init(&result);
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, nullptr, num);
  pairs.sigmas0 = sigmas0;
  pairs.sigmas1 = sigmas1;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_estimate_two_view(context, &c0, &c1, &pairs, options, &result, nullptr, mask));
  return result;
}

// Draws a pair of one of the kinds that a verdict names.
void draw_kind(int kind, uint64_t seed) {
  pair_kinds::Ranges ranges;
  pair_kinds::make(static_cast<pair_kinds::Kind>(kind), ranges, seed, &drawn);
}

// A power of two, so that not even rounding differs.
void test_sigmas_in_another_unit_give_the_same_bits(void) {
  int with_pose = 0;
  for (int k = 0; k < 48; ++k) {
    draw_kind(k % pair_kinds::kNumKinds, 700 + static_cast<uint64_t>(k));
    draw_sigmas(800 + static_cast<uint64_t>(k), 0.5, 4);
    tv_estimate_options options;
    tv_estimate_options_init(&options);
    tv_two_view found[2];
    static uint8_t mask[2][pair_kinds::kMaxMatches];
    for (int unit = 0; unit < 2; ++unit) {
      options.max_error_px = unit == 0 ? 1 : 0.125;
      found[unit] = estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1],
                             drawn.num, sigmas[0], sigmas[1], &options, mask[unit]);
      for (auto& view : sigmas) {
        for (float& sigma : view) sigma *= 8;
      }
    }
    with_pose += found[0].has_covariance;
    TEST_ASSERT_TRUE(found[0].rms_error_px == 8 * found[1].rms_error_px);
    TEST_ASSERT_TRUE(found[0].noise_px == 8 * found[1].noise_px);
    found[1].rms_error_px = found[0].rms_error_px;
    found[1].noise_px = found[0].noise_px;
    TEST_ASSERT_EQUAL_MEMORY(&found[0], &found[1], sizeof found[0]);
    TEST_ASSERT_EQUAL_MEMORY(mask[0], mask[1], static_cast<size_t>(drawn.num) + 1);
  }
  TEST_ASSERT_TRUE(with_pose > 15);
}

void test_sigmas_of_one_are_no_sigmas(void) {
  for (int k = 0; k < 16; ++k) {
    draw_kind(k % pair_kinds::kNumKinds, 900 + static_cast<uint64_t>(k));
    for (auto& view : sigmas) {
      for (float& sigma : view) sigma = 1;
    }
    const tv_two_view with =
        estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1], drawn.num,
                 sigmas[0], nullptr, nullptr, nullptr);
    const tv_two_view without =
        estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1], drawn.num,
                 nullptr, nullptr, nullptr, nullptr);
    TEST_ASSERT_EQUAL_MEMORY(&with, &without, sizeof with);
  }
}

// R is the transpose bit for bit, and kind, verdict and counts are the same.
void expect_inverse(const tv_two_view& a, const tv_two_view& b) {
  TEST_ASSERT_EQUAL_INT(a.kind, b.kind);
  TEST_ASSERT_EQUAL_INT(a.verdict, b.verdict);
  TEST_ASSERT_EQUAL_UINT32(a.reasons, b.reasons);
  TEST_ASSERT_EQUAL_INT(a.num_inliers, b.num_inliers);
  TEST_ASSERT_TRUE(a.rms_error_px == b.rms_error_px && a.noise_px == b.noise_px);
  for (int k = 0; k < 9; ++k) TEST_ASSERT_TRUE(a.R[k] == b.R[3 * (k % 3) + k / 3]);
  for (int k = 0; k < 3 && a.has_t; ++k) {
    double t = 0;
    for (int r = 0; r < 3; ++r) t -= a.R[3 * r + k] * a.t[r];
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, t, b.t[k]);
  }
}

void test_exchanged_views_with_exchanged_sigmas_give_the_inverse(void) {
  int num_poses = 0;
  for (int k = 0; k < 32; ++k) {
    draw_kind(k % pair_kinds::kNumKinds, 1000 + static_cast<uint64_t>(k));
    draw_sigmas(1100 + static_cast<uint64_t>(k), 0.5, 4);
    static uint8_t mask[2][pair_kinds::kMaxMatches];
    const tv_two_view forth =
        estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1], drawn.num,
                 sigmas[0], sigmas[1], nullptr, mask[0]);
    const tv_two_view back =
        estimate(drawn.camera[1], drawn.camera[0], drawn.pixels[1], drawn.pixels[0], drawn.num,
                 sigmas[1], sigmas[0], nullptr, mask[1]);
    expect_inverse(forth, back);
    TEST_ASSERT_EQUAL_MEMORY(mask[0], mask[1], static_cast<size_t>(drawn.num) + 1);
    num_poses += forth.has_t;
  }
  TEST_ASSERT_TRUE(num_poses >= 12);
}

// Every match in both directions and one camera: only the sigmas tell the views apart.
void test_sigmas_alone_decide_the_order_of_the_views(void) {
  make_pair(31, scene::pinhole(), scene::pinhole());
  static double both[2][800];
  constexpr int kHalf = 200;
  for (int i = 0; i < kHalf; ++i) {
    for (int d = 0; d < 2; ++d) {
      both[0][2 * i + d] = both[1][2 * (kHalf + i) + d] = pair.pixels[0][2 * i + d];
      both[1][2 * i + d] = both[0][2 * (kHalf + i) + d] = pair.pixels[1][2 * i + d];
    }
  }
  for (int seed = 0; seed < 8; ++seed) {
    draw_sigmas(32 + static_cast<uint64_t>(seed), 1, 2);
    // The matches of one direction are the precise ones.
    for (int i = kHalf; i < 2 * kHalf; ++i) sigmas[0][i] += 20, sigmas[1][i] += 20;
    const tv_camera c = scene::pinhole();
    const tv_two_view forth =
        estimate(c, c, both[0], both[1], 2 * kHalf, sigmas[0], sigmas[1], nullptr, nullptr);
    const tv_two_view back =
        estimate(c, c, both[1], both[0], 2 * kHalf, sigmas[1], sigmas[0], nullptr, nullptr);
    TEST_ASSERT_TRUE(forth.has_t);
    expect_inverse(forth, back);
  }
}

// A match that is given several times counts once, as its most precise copy, in any order.
void test_of_equal_matches_the_most_precise_counts(void) {
  const double pixels0[12] = {5, 5, 5, 5, 5, 5, 9, 9, 9, 9, 5, 5};
  const double pixels1[12] = {6, 6, 6, 6, 6, 6, 7, 7, 7, 7, 6, 6};
  const float sigmas0[6] = {2, 1, 3, 2, 1, 1}, sigmas1[6] = {2, 2, 0.5f, 1, 2, 3};
  const tv_camera cameras[2] = {scene::pinhole(), scene::pinhole()};
  const int orders[4][6] = {
      {0, 1, 2, 3, 4, 5}, {5, 4, 3, 2, 1, 0}, {2, 3, 0, 5, 1, 4}, {1, 4, 5, 0, 3, 2}};
  for (const int* order : orders) {
    double p0[12], p1[12];
    float s0[6], s1[6], ratios[6];
    for (int i = 0; i < 6; ++i) {
      for (int d = 0; d < 2; ++d) {
        p0[2 * i + d] = pixels0[2 * order[i] + d];
        p1[2 * i + d] = pixels1[2 * order[i] + d];
      }
      s0[i] = sigmas0[order[i]];
      s1[i] = sigmas1[order[i]];
      ratios[i] = 0.1f * static_cast<float>(order[i]);
    }
    for (const bool with_ratios : {false, true}) {
      tv::TwoViewProblem problem{};
      problem.calibrated = true;
      problem.camera[0] = problem.camera[1] = tv::prepare_camera(cameras[0]);
      problem.pixels[0] = p0;
      problem.pixels[1] = p1;
      problem.sigmas[0] = s0;
      problem.sigmas[1] = s1;
      problem.ratios = with_ratios ? ratios : nullptr;
      problem.num = 6;
      tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
      tv::Matches matches;
      tv::prepare_matches(problem, arena, &matches);
      TEST_ASSERT_EQUAL_INT(2, matches.num_unique());
      TEST_ASSERT_EQUAL_INT(6, matches.num_all);
      // Sums of 3 in both places: of equal sums, the lower sigma of view 0.
      TEST_ASSERT_EQUAL_INT(1, order[matches.order[0]]);
      TEST_ASSERT_EQUAL_INT(4, order[matches.order[1]]);
      for (int v = 0; v < 2; ++v) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, (v == 0 ? 1.0 : 2.0) / cameras[0].fx,
                                  matches.pairs.jacobian[v][0][0]);
      }
    }
  }
}

// Each match three times, with three pairs of sigmas, in any order: the same bytes.
void test_the_order_of_repeated_matches_has_no_influence(void) {
  make_pair(71, scene::pinhole(), scene::pinhole());
  constexpr int kNum = 600;
  static double pixels[2][2 * kNum];
  static float shuffled[2][kNum];
  int order[kNum], first_order[kNum];
  draw_sigmas(72, 0.5, 3);
  for (int i = 0; i < kNum; ++i) order[i] = i;
  tv::Random random = tv::random_seeded(73);
  tv_two_view first;
  for (int round = 0; round < 10; ++round) {
    for (int i = 0; i < kNum; ++i) {
      for (int v = 0; v < 2; ++v) {
        for (int d = 0; d < 2; ++d) {
          pixels[v][2 * i + d] = pair.pixels[v][2 * (order[i] % 200) + d];
        }
        shuffled[v][i] = sigmas[v][order[i]];
      }
    }
    const tv_camera c = scene::pinhole();
    const tv_two_view found =
        estimate(c, c, pixels[0], pixels[1], kNum, shuffled[0], shuffled[1], nullptr, nullptr);
    TEST_ASSERT_TRUE(found.has_t);
    // Their own order, too: sums over all matches are formed in it.
    const double* const given[2] = {pixels[0], pixels[1]};
    const tv::Matches matches =
        prepared(pair.options.camera, given, kNum, shuffled[0], shuffled[1]);
    TEST_ASSERT_EQUAL_INT(200, matches.num_unique());
    for (int k = 0; k < kNum; ++k) {
      if (round == 0) first_order[k] = order[matches.order[k]];
      TEST_ASSERT_EQUAL_INT(first_order[k], order[matches.order[k]]);
    }
    if (round == 0) first = found;
    TEST_ASSERT_EQUAL_MEMORY(&first, &found, sizeof first);
    for (int i = kNum - 1; i > 0; --i) {
      std::swap(order[i], order[tv::random_below(random, static_cast<uint32_t>(i + 1))]);
    }
  }
}

// Half of the matches have four times the noise of the others.
bool draw_mixed_pair(uint64_t seed, double wrong) {
  pair_kinds::Maker maker{tv::random_seeded(seed), {}, &drawn};
  drawn.num = 0;
  drawn.kind = pair_kinds::kGeneral;
  const tv_camera camera = pair_kinds::draw_camera(&maker.random);
  for (int v = 0; v < 2; ++v) {
    drawn.camera[v] = camera;
    maker.cameras[v] = tv::prepare_camera(camera);
  }
  maker.draw_motion(pair_kinds::Ranges());
  const int half = 50 + static_cast<int>(tv::random_below(maker.random, 101));
  drawn.noise_px = 0.3;
  if (!maker.put_general(half, 1)) return false;
  drawn.noise_px = 1.2;
  if (!maker.put_general(half, 1)) return false;
  const int num_wrong = static_cast<int>(2 * half * uniform(&maker.random, 0, wrong));
  maker.put_wrong(num_wrong);
  for (int i = 0; i < drawn.num; ++i) {
    const bool coarse = i >= 2 * half ? i % 2 == 0 : i >= half;
    sigmas[0][i] = sigmas[1][i] = coarse ? 4 : 1;
  }
  return true;
}

// The information of all true matches about the pose at the truth, by differences of Sampson's
// distance over sigma, which is computed here from the cameras alone.
Mat5 information(int num_true, double noise_px) {
  const tv::Camera cameras[2] = {tv::prepare_camera(drawn.camera[0]),
                                 tv::prepare_camera(drawn.camera[1])};
  Mat5 sum = Mat5::Zero();
  Vec3 b1, b2;
  tv::tangent_basis(drawn.t, &b1, &b2);
  const auto residual = [&](int i, const double step[5]) {
    Vec3 w(step[0], step[1], step[2]);
    Mat3 R = drawn.R;
    if (w.norm() > 0) R = Mat3(tv::rotation_about(w.normalized(), w.norm()) * drawn.R);
    const Vec3 t = (drawn.t + step[3] * b1 + step[4] * b2).normalized();
    const Mat3 E = tv::cross_matrix(t) * R;
    Vec3 f[2];
    tv::Mat32 J[2];
    for (int v = 0; v < 2; ++v) {
      const tv::Vec2 pixel(drawn.pixels[v][2 * i], drawn.pixels[v][2 * i + 1]);
      TEST_ASSERT_TRUE(tv::unproject(cameras[v], pixel, &f[v], &J[v]));
    }
    const double n = (J[0].transpose() * (E.transpose() * f[1])).squaredNorm() +
                     (J[1].transpose() * (E * f[0])).squaredNorm();
    return f[1].dot(E * f[0]) / std::sqrt(n) / sigmas[0][i];
  };
  for (int i = 0; i < num_true; ++i) {
    Vec5 slope;
    for (int k = 0; k < 5; ++k) {
      double plus[5] = {}, minus[5] = {};
      plus[k] = 1e-6;
      minus[k] = -1e-6;
      slope[k] = (residual(i, plus) - residual(i, minus)) / 2e-6;
    }
    sum += slope * slope.transpose();
  }
  return sum / (noise_px * noise_px);
}

void test_true_sigmas_give_the_pose_its_accuracy_and_its_covariance(void) {
  int within = 0, total = 0;
  double sum_with = 0, sum_without = 0, sum_bound = 0, noise = 0;
  for (int k = 0; k < num_pairs; ++k) {
    uint64_t seed = base_seed * 1000003 + static_cast<uint64_t>(k);
    while (!draw_mixed_pair(seed, 0.3)) seed += 1000000007;
    int num_true = drawn.num;
    tv_two_view found[2];
    for (int with = 0; with < 2; ++with) {
      found[with] =
          estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1], drawn.num,
                   with ? sigmas[0] : nullptr, with ? sigmas[1] : nullptr, nullptr, nullptr);
    }
    if (!found[0].has_covariance || !found[1].has_covariance) continue;
    // Wrong matches follow the two halves, whose first coarse one shows their length.
    int half = 0;
    while (sigmas[0][half] == 1) ++half;
    num_true = 2 * half;
    const Vec5 without = scene::pose_error(found[0].R, found[0].t, drawn.R, drawn.t);
    const Vec5 with = scene::pose_error(found[1].R, found[1].t, drawn.R, drawn.t);
    const Mat5 I = information(num_true, 0.3);
    const Mat5 C = Eigen::Map<const Mat5>(found[1].covariance);
    within += with.dot(C.ldlt().solve(with)) <= 11.070;
    sum_bound += std::fmin(with.dot(I * with), 50.0);
    sum_with += std::fmin(with.dot(I * with), 1000.0);
    sum_without += std::fmin(without.dot(I * without), 1000.0);
    noise += found[1].noise_px;
    ++total;
  }
  const double share = static_cast<double>(within) / total, mean = sum_bound / total;
  std::printf(
      "%d pairs: %.1f %% within, squared error over the bound %.3f, without sigmas %.2f, "
      "noise %.3f px\n",
      total, 100 * share, mean / 5, sum_without / total / 5, noise / total);
  TEST_ASSERT_TRUE(20 * total >= 19 * num_pairs);
  if (kSanitized) return;
  const double spread = 3 * std::sqrt(0.95 * 0.05 / total);
  TEST_ASSERT_TRUE(share >= 0.93 - spread && share <= 0.97 + spread);
  // Of the bound of Cramer and Rao the loss takes about 15 %; 5 components a pair, chi-square.
  const double of_mean = 3 * std::sqrt(2.0 / (5.0 * total));
  TEST_ASSERT_TRUE(mean / 5 > 1 - of_mean && mean / 5 < 1.25 + of_mean);
  TEST_ASSERT_TRUE(sum_without > 1.5 * sum_with);
  TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.3, noise / total);
}

// Draws a pair with pixels of these sigmas: noise of 0.2 px times the sigma. Sigmas of view 0 are
// up to `most` times those of view 1.
void draw_noisy_kind(int kind, uint64_t seed, double most) {
  pair_kinds::Ranges ranges;
  ranges.least_noise_px = ranges.most_noise_px = 0;
  ranges.most_wrong = 0.4;
  pair_kinds::make(static_cast<pair_kinds::Kind>(kind), ranges, seed, &drawn);
  tv::Random random = tv::random_seeded(seed + 1);
  for (int i = 0; i < drawn.num; ++i) {
    sigmas[0][i] = static_cast<float>(i % 2 == 0 ? most : uniform(&random, 1, most));
    sigmas[1][i] = static_cast<float>(i % 3 == 0 ? 1 : uniform(&random, 0.5, 1));
    for (int v = 0; v < 2; ++v) {
      for (int d = 0; d < 2; ++d) {
        drawn.pixels[v][2 * i + d] += 0.2 * sigmas[v][i] * scene::normal(&random);
      }
    }
  }
}

void test_kinds_are_named_right_where_one_view_is_noisier(void) {
  const struct {
    pair_kinds::Kind kind;
    tv_kind named;
    double most;
  } rows[5] = {{pair_kinds::kGeneral, TV_KIND_CALIBRATED, 6},
               {pair_kinds::kPlanar, TV_KIND_PLANAR, 6},
               {pair_kinds::kPureRotation, TV_KIND_PANORAMIC, 6},
               {pair_kinds::kPureRotation, TV_KIND_PANORAMIC, 30},
               {pair_kinds::kNoMotion, TV_KIND_NO_MOTION, 6}};
  for (const auto& row : rows) {
    int right = 0;
    for (int k = 0; k < num_pairs; ++k) {
      draw_noisy_kind(row.kind, base_seed * 7001 + static_cast<uint64_t>(1000 * row.kind + k),
                      row.most);
      const tv_two_view found =
          estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1], drawn.num,
                   sigmas[0], sigmas[1], nullptr, nullptr);
      right += found.kind == row.named;
    }
    std::printf("%s, sigmas up to %.0f: %d of %d named right\n", pair_kinds::name_of(row.kind),
                row.most, right, num_pairs);
    TEST_ASSERT_TRUE(kSanitized || 50 * right >= 49 * num_pairs);
  }
}

// With a sigma of 100 a threshold of 1 px is one of 100 px: any model explains most random matches.
void test_random_matches_of_large_sigmas_are_no_geometry(void) {
  tv::Random random = tv::random_seeded(41);
  const tv_camera c = scene::pinhole();
  for (int k = 0; k < (kSanitized ? 4 : 40); ++k) {
    static double pixels[2][2 * 200];
    const double sigma = k % 2 == 0 ? 100 : 30;
    for (int i = 0; i < 200; ++i) {
      for (int v = 0; v < 2; ++v) {
        const tv::Vec2 p = scene::random_pixel(&random, c);
        pixels[v][2 * i] = p[0];
        pixels[v][2 * i + 1] = p[1];
        sigmas[v][i] = static_cast<float>(sigma);
      }
    }
    const tv_two_view found =
        estimate(c, c, pixels[0], pixels[1], 200, sigmas[0], sigmas[1], nullptr, nullptr);
    TEST_ASSERT_EQUAL_INT(TV_KIND_DEGENERATE, found.kind);
  }
}

// Matches that are too noisy to say anything are no evidence against a pose that is determined.
void test_coarse_matches_do_not_spoil_a_verdict(void) {
  int num_ok = 0;
  for (int k = 0; k < 60; ++k) {
    pair_kinds::Ranges ranges;
    ranges.most_wrong = 0.1;
    ranges.most = 300;
    pair_kinds::make(pair_kinds::kGeneral, ranges, 4000 + static_cast<uint64_t>(k), &drawn);
    const int n = drawn.num;
    const tv_two_view fine = estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0],
                                      drawn.pixels[1], n, nullptr, nullptr, nullptr, nullptr);
    tv::Random random = tv::random_seeded(4100 + static_cast<uint64_t>(k));
    for (int i = 0; i < n; ++i) {
      for (int v = 0; v < 2; ++v) {
        sigmas[v][i] = 1;
        sigmas[v][n + i] = 40;
        for (int d = 0; d < 2; ++d) {
          drawn.pixels[v][2 * (n + i) + d] =
              drawn.pixels[v][2 * i + d] + 12 * scene::normal(&random);
        }
      }
    }
    const tv_two_view all =
        estimate(drawn.camera[0], drawn.camera[1], drawn.pixels[0], drawn.pixels[1], 2 * n,
                 sigmas[0], sigmas[1], nullptr, nullptr);
    if (fine.verdict != TV_VERDICT_OK) continue;
    ++num_ok;
    TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, all.verdict);
  }
  TEST_ASSERT_TRUE(num_ok > 50);
}

// ---- bundle adjustment ----

void make_bundle(uint64_t seed) {
  bundle_scene::Options options;
  options.num = 120;
  options.seed = seed;
  options.start_off_rad = 0.002;
  bundle_scene::make(options, &bundle);
}

struct Adjusted {
  double R[9], t[3];
  tv_point points[480];
  tv_bundle_result result;
};

void adjust(const double* pixels0, const double* pixels1, int num, const float* sigmas0,
            const float* sigmas1, const tv_point* points, const tv_bundle_options& options,
            Adjusted* out) {
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, nullptr, num);
  pairs.sigmas0 = sigmas0;
  pairs.sigmas1 = sigmas1;
  std::memcpy(out->points, points, static_cast<size_t>(num) * sizeof points[0]);
  tv_bundle_result_init(&out->result);
  const bundle_scene::Options& o = bundle.options;
  tv_camera_pair cameras = pair_of(&o.camera[0], &o.camera[1], bundle.start_R, bundle.start_t);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_adjust_two_view(context, &pairs, &options, &cameras, out->points, &out->result));
  std::memcpy(out->R, cameras.cam1_from_cam0_R, sizeof out->R);
  std::memcpy(out->t, cameras.cam1_from_cam0_t, sizeof out->t);
}

// By least squares a match of sigma 1/2 counts as four equal ones of sigma 1. Bundle adjustment
// counts each copy.
void test_a_sigma_of_a_half_is_four_copies(void) {
  make_bundle(50);
  const int n = bundle.options.num;
  static double pixels[2][2 * 480];
  static tv_point points[480];
  int num = 0;
  for (int i = 0; i < n; ++i) {
    const bool precise = i % 3 == 0;
    sigmas[0][i] = sigmas[1][i] = precise ? 0.5f : 1;
    for (int copy = 0; copy < (precise ? 4 : 1); ++copy, ++num) {
      for (int v = 0; v < 2; ++v) {
        for (int d = 0; d < 2; ++d) pixels[v][2 * num + d] = bundle.pixels[v][2 * i + d];
      }
      points[num] = bundle.start[i];
    }
  }
  tv_bundle_options options;
  tv_bundle_options_init(&options);
  options.loss = TV_LOSS_NONE;
  static Adjusted weighted, copied;
  adjust(bundle.pixels[0], bundle.pixels[1], n, sigmas[0], sigmas[1], bundle.start, options,
         &weighted);
  adjust(pixels[0], pixels[1], num, nullptr, nullptr, points, options, &copied);
  TEST_ASSERT_TRUE(weighted.result.converged && copied.result.converged);
  const double least = copied.result.final_cost;
  TEST_ASSERT_DOUBLE_WITHIN(1e-9 * least, least, weighted.result.final_cost);
  for (int k = 0; k < 9; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-7, copied.R[k], weighted.R[k]);
  for (int k = 0; k < 3; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-6, copied.t[k], weighted.t[k]);
  // The point's error stays in pixels of the images.
  for (int i = 0, at = 0; i < n; at += i % 3 == 0 ? 4 : 1, ++i) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-4 + 1e-3 * copied.points[at].error_px, copied.points[at].error_px,
                              weighted.points[i].error_px);
  }
}

// The least sum of squared errors over sigma that Newton steps on the constraint find at the
// adjusted pose is what the adjustment reports, for sigmas that differ between the two images.
void test_the_adjusted_cost_is_the_weighted_optimum(void) {
  make_bundle(60);
  draw_sigmas(61, 0.5, 3);
  tv_bundle_options options;
  tv_bundle_options_init(&options);
  options.loss = TV_LOSS_NONE;
  static Adjusted out;
  adjust(bundle.pixels[0], bundle.pixels[1], bundle.options.num, sigmas[0], sigmas[1], bundle.start,
         options, &out);
  const auto cost_at = [](const Mat3& R, const Vec3& t) {
    const PinholePair p = fundamental_of(bundle.options.camera, tv::cross_matrix(t) * R);
    double sum = 0;
    for (int i = 0; i < bundle.options.num; ++i) {
      const Quad x0[3] = {bundle.pixels[0][2 * i], bundle.pixels[0][2 * i + 1], 1};
      const Quad x1[3] = {bundle.pixels[1][2 * i], bundle.pixels[1][2 * i + 1], 1};
      sum += static_cast<double>(optimum(p, x0, x1, sigmas[0][i], sigmas[1][i]));
    }
    return sum;
  };
  Mat3 R;
  for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = out.R[k];
  const Vec3 t = Vec3(out.t[0], out.t[1], out.t[2]).normalized();
  TEST_ASSERT_TRUE(out.result.converged);
  const double least = cost_at(R, t);
  TEST_ASSERT_DOUBLE_WITHIN(1e-4 * least, least, out.result.final_cost);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, out.result.rms_px,
                            std::sqrt(out.result.final_cost / (2 * bundle.options.num)));
  Vec3 b1, b2;
  tv::tangent_basis(t, &b1, &b2);
  for (int k = 0; k < 5; ++k) {
    for (const double step : {-1e-3, 1e-3}) {
      const Mat3 turn = k < 3 ? tv::rotation_about(Vec3::Unit(k), step) : Mat3::Identity();
      const Vec3 moved = (t + (k == 3 ? step : 0) * b1 + (k == 4 ? step : 0) * b2).normalized();
      TEST_ASSERT_TRUE(cost_at(turn * R, moved) > least);
    }
  }
}

void test_the_adjusted_covariance_holds_the_truth(void) {
  int within = 0;
  const int num = num_pairs;
  for (int k = 0; k < num; ++k) {
    bundle_scene::Options options;
    options.num = 150;
    options.seed = base_seed * 5003 + static_cast<uint64_t>(k);
    options.noise_px = 0;
    options.start_off_rad = 0.002;
    bundle_scene::make(options, &bundle);
    tv::Random random = tv::random_seeded(options.seed + 77);
    for (int i = 0; i < options.num; ++i) {
      for (int v = 0; v < 2; ++v) {
        sigmas[v][i] = i % 2 == 0 ? 4 : 1;
        for (int d = 0; d < 2; ++d) {
          bundle.pixels[v][2 * i + d] += 0.3 * sigmas[v][i] * scene::normal(&random);
        }
      }
    }
    bundle_scene::triangulate(options, &bundle);
    tv_bundle_options bundle_options;
    tv_bundle_options_init(&bundle_options);
    static Adjusted out;
    adjust(bundle.pixels[0], bundle.pixels[1], options.num, sigmas[0], sigmas[1], bundle.start,
           bundle_options, &out);
    TEST_ASSERT_TRUE(out.result.has_covariance);
    const Vec5 e = scene::pose_error(out.R, out.t, bundle.R, bundle.t);
    const Mat5 C = Eigen::Map<const Mat5>(out.result.covariance);
    within += e.dot(C.ldlt().solve(e)) <= 11.070;
  }
  const double share = static_cast<double>(within) / num;
  std::printf("adjusted: %.1f %% of %d pairs within\n", 100 * share, num);
  if (kSanitized) return;
  const double spread = 3 * std::sqrt(0.95 * 0.05 / num);
  TEST_ASSERT_TRUE(share >= 0.93 - spread && share <= 0.97 + spread);
}

}  // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
  estimator::read_environment(20, &num_pairs, &base_seed);
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 1;
  limits.max_matches = scene::kMaxMatches;
  context = nullptr;
  alignas(TV_CONTEXT_ALIGNMENT) static uint8_t memory[8 << 20];
  if (tv_context_init(&context, &limits, memory, sizeof memory) != TV_OK) return 1;
  UNITY_BEGIN();
  RUN_TEST(test_the_residual_is_the_definition_and_the_optimum);
  RUN_TEST(test_the_transfer_residual_is_weighted_by_both_sigmas);
  RUN_TEST(test_chance_grows_with_the_sigmas);
  RUN_TEST(test_sigmas_in_another_unit_give_the_same_bits);
  RUN_TEST(test_sigmas_of_one_are_no_sigmas);
  RUN_TEST(test_exchanged_views_with_exchanged_sigmas_give_the_inverse);
  RUN_TEST(test_sigmas_alone_decide_the_order_of_the_views);
  RUN_TEST(test_of_equal_matches_the_most_precise_counts);
  RUN_TEST(test_the_order_of_repeated_matches_has_no_influence);
  RUN_TEST(test_true_sigmas_give_the_pose_its_accuracy_and_its_covariance);
  RUN_TEST(test_kinds_are_named_right_where_one_view_is_noisier);
  RUN_TEST(test_random_matches_of_large_sigmas_are_no_geometry);
  RUN_TEST(test_coarse_matches_do_not_spoil_a_verdict);
  RUN_TEST(test_a_sigma_of_a_half_is_four_copies);
  RUN_TEST(test_the_adjusted_cost_is_the_weighted_optimum);
  RUN_TEST(test_the_adjusted_covariance_holds_the_truth);
  return UNITY_END();
}
