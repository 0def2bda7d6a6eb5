// Tests of the dense cloud: the matcher against its definition, written out as plainly as it can
// be, and the points against scenes whose depth is known exactly, through every lens and for
// sideways, oblique, forward and backward motion.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>

#include "base/random.h"
#include "dense/fraction.h"
#include "support/ball_scene.h"
#include "support/scene.h"
#include "twoview/context.h"
#include "twoview/twoview.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using ball_scene::distance_to_scene;
using ball_scene::render;
using scene::uniform;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

// The memory outlives a failing test, which leaves by longjmp.
alignas(64) uint8_t memory[24 << 20];
uint8_t pixels[2][640 * 640];
tv_dense_point points[400000];

// ---- The definition of the matcher.

struct Plain {
  int width, height, steps;
  std::vector<uint8_t> a, b;

  int width1() const { return width + steps - 1; }
  int range() const { return steps - width % 7; }
  int at0(int x, int y) const { return a[static_cast<size_t>(y * width + x)]; }
  int at1(int x, int y) const { return b[static_cast<size_t>(y * width1() + x)]; }

  // Two bits for each of eight pairs of opposite pixels: the first is brighter by more than two
  // grey levels, or darker. The rows beyond the image are its first and its last.
  template <typename At>
  std::vector<int> census(const At& at, int wide, int x, int y) const {
    std::vector<int> bits(16, 0);
    if (x < 2 || x + 2 >= wide) return bits;
    if (at(x, y) == 0) {  // outside the image
      for (size_t n = 0; n < 16; n += 2) bits[n] = 1;
      return bits;
    }
    const int pairs[8][2] = {{-1, -1}, {0, -1},  {1, -1}, {-1, 0},
                             {-2, 0},  {-2, -2}, {0, -2}, {2, -2}};
    const auto row = [&](int v) { return std::min(std::max(v, 0), height - 1); };
    for (size_t n = 0; n < 8; ++n) {
      const int change =
          at(x + pairs[n][0], row(y + pairs[n][1])) - at(x - pairs[n][0], row(y - pairs[n][1]));
      bits[2 * n] = change > 2;
      bits[2 * n + 1] = change < -2;
    }
    return bits;
  }

  int cost(int x, int y, int k) const {
    if (at0(x, y) == 0) return 0;
    const auto p = census([&](int u, int v) { return at0(u, v); }, width, x, y);
    const auto q = census([&](int u, int v) { return at1(u, v); }, width1(), x + k, y);
    int different = 0;
    for (size_t n = 0; n < p.size(); ++n) different += p[n] != q[n];
    return different;
  }

  std::vector<int> winners() const {
    const int directions[3][2] = {{-1, 0}, {1, 0}, {0, -1}};
    std::vector<int> sums(static_cast<size_t>(width * height * steps), 0), costs = sums;
    const auto index = [&](int x, int y, int k) {
      return static_cast<size_t>((y * width + x) * steps + k);
    };
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int k = 0; k < steps; ++k) costs[index(x, y, k)] = cost(x, y, k);
    for (const auto& d : directions) {
      std::vector<int> path(sums.size(), 0);
      for (int y = 0; y < height; ++y) {
        for (int i = 0; i < width; ++i) {
          const int x = d[0] > 0 ? width - 1 - i : i, u = x + d[0], v = y + d[1];
          const bool begins = v < 0 || u < 0 || u >= width;
          int least = 1 << 20;
          for (int k = 0; k < steps && !begins; ++k) least = std::min(least, path[index(u, v, k)]);
          const int large = begins ? 0 : std::max(4, 32 - std::abs(at0(x, y) - at0(u, v)));
          for (int k = 0; k < steps; ++k) {
            int way = 0;
            if (!begins) {
              way = std::min(path[index(u, v, k)], least + large);
              if (k > 0) way = std::min(way, path[index(u, v, k - 1)] + 4);
              if (k + 1 < steps) way = std::min(way, path[index(u, v, k + 1)] + 4);
              way -= least;
            }
            path[index(x, y, k)] = costs[index(x, y, k)] + way;
            sums[index(x, y, k)] += path[index(x, y, k)];
          }
        }
      }
    }
    std::vector<int> found;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        int best = 0, next = 1 << 20;
        for (int k = 1; k < steps; ++k)
          if (sums[index(x, y, k)] < sums[index(x, y, best)]) best = k;
        for (int k = 0; k < steps; ++k)
          if (std::abs(k - best) > 1) next = std::min(next, sums[index(x, y, k)]);
        int least1 = 1 << 20;  // over all pixels of image 0 that may be at this one of image 1
        for (int u = 0; u < width; ++u) {
          const int k = x + best - u;
          if (k >= 0 && k < steps && at0(u, y) != 0)
            least1 = std::min(least1, sums[index(u, y, k)]);
        }
        bool agrees = false;  // one of those within a step has it
        for (int k = best - 1; k <= best + 1; ++k) {
          const int u = x + best - k;
          if (k >= 0 && k < steps && u >= 0 && u < width)
            agrees = agrees || sums[index(u, y, k)] == least1;
        }
        const bool good = at0(x, y) != 0 && at1(x + best, y) != 0 && best > 0 &&
                          best < range() - 1 && agrees && next - sums[index(x, y, best)] >= 2;
        found.push_back(good ? best : -1);
      }
    }
    return found;
  }
};

void test_the_matcher_is_its_definition() {
  tv::Random random = tv::random_seeded(20260101);
  int believed = 0;
  for (int n = 0; tvk_nth(n) != nullptr; ++n) {
    const tvk_dense_table& kernels = *tvk_dense_of(tvk_nth(n));
    for (int trial = 0; trial < 8; ++trial) {
      Plain plain;
      plain.width = 16 + static_cast<int>(uniform(&random, 0, 30));
      plain.height = 9 + static_cast<int>(uniform(&random, 0, 14));
      plain.steps = 32 * (1 + trial % 2);
      plain.a.resize(static_cast<size_t>(plain.width * plain.height));
      plain.b.resize(static_cast<size_t>(plain.width1() * plain.height));
      // Grey levels that differ little at first glance have no noise to smooth: each row repeats.
      for (int y = 0; y < plain.height; ++y) {
        for (int x = 0; x < plain.width; ++x) {
          const double value = uniform(&random, trial % 2 ? 0 : 1, 256);
          plain.a[static_cast<size_t>(y * plain.width + x)] =
              y % 3 == 0 ? static_cast<uint8_t>(value)
                         : plain.a[static_cast<size_t>((y - 1) * plain.width + x)];
        }
        for (int x = 0; x < plain.width1(); ++x) {
          const double value = uniform(&random, 0, 256);
          plain.b[static_cast<size_t>(y * plain.width1() + x)] =
              y % 3 == 0 ? static_cast<uint8_t>(value)
                         : plain.b[static_cast<size_t>((y - 1) * plain.width1() + x)];
        }
      }
      // A part of image 1 is image 0 at two parallaxes, so that there is something to find.
      for (int y = 0; y < plain.height; ++y)
        for (int x = 0; x < plain.width; ++x)
          plain.b[static_cast<size_t>(y * plain.width1() + x + (y < 6 ? 2 : 4))] =
              plain.a[static_cast<size_t>(y * plain.width + x)];
      const size_t cells = plain.a.size();
      tv::Arena images = tv::arena_over(pixels, sizeof pixels);
      uint8_t* const a = tv::pixels_alloc(cells, images);
      uint8_t* const b = tv::pixels_alloc(plain.b.size(), images);
      std::copy(plain.a.begin(), plain.a.end(), a);
      std::copy(plain.b.begin(), plain.b.end(), b);
      const tv::RowPair rows = {a, b, plain.width, plain.height, plain.steps, plain.range()};
      tv::Arena arena = tv::arena_over(memory, sizeof memory);
      std::vector<int16_t> entries(tv::steps_entries(static_cast<int32_t>(cells), 64));
      const tv::Steps steps = {entries.data(), plain.width, plain.height};
      tv::match_rows(rows, kernels, arena, steps);
      const std::vector<int> expected = plain.winners();
      for (int y = 0; y < plain.height; ++y) {
        for (int x = 0; x < plain.width; ++x) {
          const int own = expected[static_cast<size_t>(y * plain.width + x)];
          TEST_ASSERT_EQUAL_INT_MESSAGE(own, steps.row(y)[x], "winner");
          believed += own >= 0;
        }
      }
      TEST_ASSERT_TRUE(arena.high_water_bytes <=
                       tv::match_rows_bytes(plain.width, plain.steps, cells));
    }
  }
  TEST_ASSERT_GREATER_THAN(200, believed);
}

// Of two images that are the same at a parallax that is no whole step, the fraction is found, and
// sigma is small; where both are plain, the step is the neighbours', and sigma says so.
void test_windows_find_the_fraction_of_a_step() {
  constexpr int kWidth = 96, kHeight = 40, kSteps = 32, kStep = 9;
  constexpr double kFraction = 0.3;
  tv::Arena images = tv::arena_over(pixels, sizeof pixels);
  uint8_t* const a = tv::pixels_alloc(kWidth * kHeight, images);
  uint8_t* const b = tv::pixels_alloc((kWidth + kSteps - 1) * kHeight, images);
  const auto grey = [](double x, int y) {
    return static_cast<uint8_t>(x >= 60 ? 128
                                        : 128 + 60 * std::sin(0.55 * x + 0.3 * y) +
                                              30 * std::sin(0.23 * x - 0.5 * y));
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) a[y * kWidth + x] = grey(x, y);
    for (int x = 0; x < kWidth + kSteps - 1; ++x)
      b[y * (kWidth + kSteps - 1) + x] = grey(x - kStep - kFraction, y);
  }
  const tv::RowPair rows = {a, b, kWidth, kHeight, kSteps, kSteps};
  const tvk_dense_table& kernels = *tvk_dense_of(tvk_select(TV_KERNELS_AUTO));
  std::vector<int16_t> entries(tv::steps_entries(kWidth * kHeight, kWidth), -1);
  const tv::Steps steps = {entries.data(), kWidth, kHeight};
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) steps.row(y)[x] = kStep;
  steps.row(20)[30] = kStep + 12;  // alone among others: it has no support
  std::vector<float> parallax(tv::cells_entries(kWidth * kHeight)), sigma = parallax;
  std::vector<uint8_t> similarity(parallax.size());
  tv::Arena arena = tv::arena_over(memory, tv::refine_rows_bytes(kWidth));
  tv::refine_rows(rows, steps, kernels, arena, {parallax.data(), sigma.data(), similarity.data()});
  TEST_ASSERT_EQUAL_UINT64(arena.size_bytes, arena.high_water_bytes);  // and no byte more
  for (int y = 4; y < kHeight - 4; ++y) {
    for (int x = 4; x < kWidth - 4; ++x) {
      const size_t at = static_cast<size_t>(y * kWidth + x);
      if (x == 30 && y == 20) {
        TEST_ASSERT_TRUE(parallax[at] < 0);
      } else if (x < 50) {
        TEST_ASSERT_FLOAT_WITHIN(0.1f, static_cast<float>(kStep + kFraction), parallax[at]);
        TEST_ASSERT_TRUE(sigma[at] < 0.2f && similarity[at] > 240);
      } else if (x > 66) {
        TEST_ASSERT_FLOAT_WITHIN(0.001f, static_cast<float>(kStep), parallax[at]);
        TEST_ASSERT_TRUE(sigma[at] > 0.3f);
      }
    }
  }
}

struct Expected {
  int least_points;
  double median_percent, outlier_share;
};

Mat3 rotation_about(const Vec3& axis, double angle) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

void check_scene(const char* name, const tv_camera& camera0, const tv_camera& camera1,
                 const Mat3& R, const Vec3& t, const Expected& expected) {
  tv::Random random = tv::random_seeded(5);
  render(camera0, Mat3::Identity(), Vec3::Zero(), &random, pixels[0]);
  render(camera1, R, t, &random, pixels[1]);
  // What the sparse points of a pair would tell: some points of the scene, as a user has them.
  std::vector<tv_point> sparse;
  const tv::Camera prepared0 = tv::prepare_camera(camera0), prepared1 = tv::prepare_camera(camera1);
  const Vec3 centre1 = -(R.transpose() * t);
  for (int i = 0; i < 200; ++i) {
    const Vec2 pixel(uniform(&random, 0, camera0.width - 1),
                     uniform(&random, 0, camera0.height - 1));
    Vec3 ray;
    Vec2 other;
    if (!tv::unproject(prepared0, pixel, &ray, nullptr)) continue;
    const Vec3 at = distance_to_scene(Vec3::Zero(), ray) * ray;
    if (at.norm() > 100 || !tv::project(prepared1, R * at + t, &other, nullptr)) continue;
    if (other[0] < 0 || other[1] < 0 || other[0] >= camera1.width || other[1] >= camera1.height)
      continue;
    tv_point point = {};
    for (int k = 0; k < 3; ++k) point.position[k] = at[k];
    const double cosine = at.normalized().dot((at - centre1).normalized());
    point.angle_rad = static_cast<float>(std::acos(std::min(1.0, cosine)));
    sparse.push_back(point);
  }
  size_t bytes = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_dense_size(&camera0, &camera1, nullptr, &bytes));
  TEST_ASSERT_TRUE(bytes <= sizeof memory);
  const tv_image images[2] = {{pixels[0], camera0.width, camera0.height, camera0.width},
                              {pixels[1], camera1.width, camera1.height, camera1.width}};
  tv_camera_pair cameras{camera0, camera1, {}, {}};
  for (int i = 0; i < 9; ++i) cameras.cam1_from_cam0_R[i] = R(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) cameras.cam1_from_cam0_t[i] = t[i];
  tv_dense_options options;
  tv_dense_options_init(&options);
  options.sparse = sparse.data();
  options.num_sparse = static_cast<int32_t>(sparse.size());
  int32_t num = 0;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_densify(memory, bytes, &cameras, images, &options, points, 400000, &num));
  std::vector<double> errors, pulls;
  double worst_pixel = 0, worst_ray = 0;
  for (int32_t i = 0; i < num; ++i) {
    const tv_dense_point& p = points[i];
    const Vec3 at(p.position[0], p.position[1], p.position[2]);
    Vec2 pixel0, pixel1;
    Vec3 ray;
    TEST_ASSERT_TRUE(tv::project(prepared0, at, &pixel0, nullptr));
    TEST_ASSERT_TRUE(tv::project(prepared1, R * at + t, &pixel1, nullptr));
    for (int k = 0; k < 2; ++k) {
      worst_pixel = std::max(worst_pixel, std::fabs(pixel0[k] - p.pixel0[k]));
      worst_pixel = std::max(worst_pixel, std::fabs(pixel1[k] - p.pixel1[k]));
    }
    TEST_ASSERT_TRUE(tv::unproject(prepared0, Vec2(p.pixel0[0], p.pixel0[1]), &ray, nullptr));
    worst_ray = std::max(worst_ray, (at.normalized() - ray).norm());
    const double known = distance_to_scene(Vec3::Zero(), ray);
    errors.push_back(100 * std::fabs(at.norm() - known) / known);
    pulls.push_back(std::fabs(at.norm() - known) / p.sigma);
    TEST_ASSERT_TRUE(p.similarity > 0 && p.similarity <= 1);
    const int x = static_cast<int>(p.pixel0[0] + 0.5f), y = static_cast<int>(p.pixel0[1] + 0.5f);
    TEST_ASSERT_EQUAL_INT(pixels[0][y * camera0.width + x], p.grey);
  }
  TEST_ASSERT_GREATER_OR_EQUAL_INT_MESSAGE(expected.least_points, num, name);
  const auto outliers = std::count_if(errors.begin(), errors.end(), [](double e) { return e > 5; });
  const auto beyond = std::count_if(pulls.begin(), pulls.end(), [](double p) { return p > 3; });
  std::nth_element(errors.begin(), errors.begin() + num / 2, errors.end());
  std::nth_element(pulls.begin(), pulls.begin() + num / 2, pulls.end());
  const double median = errors[static_cast<size_t>(num / 2)];
  std::printf(
      "%s: %d points, distance off by %.3f %% (median), %.2f %% by more than 5 %%; error / "
      "sigma %.2f (median), %.2f %% above 3\n",
      name, num, median, 100.0 * static_cast<double>(outliers) / num,
      pulls[static_cast<size_t>(num / 2)], 100.0 * static_cast<double>(beyond) / num);
  // A point is where its pixels say, but for the rounding of floats.
  TEST_ASSERT_TRUE(worst_pixel < 2e-3);
  TEST_ASSERT_TRUE(worst_ray < 1e-5);
  TEST_ASSERT_TRUE_MESSAGE(median < expected.median_percent, name);
  TEST_ASSERT_TRUE_MESSAGE(static_cast<double>(outliers) <= expected.outlier_share * num, name);
  TEST_ASSERT_TRUE_MESSAGE(pulls[static_cast<size_t>(num / 2)] < 1, name);
  TEST_ASSERT_TRUE_MESSAGE(static_cast<double>(beyond) <= 0.03 * num, name);
}

tv_camera small_pinhole() {
  return tv_camera{TV_CAMERA_PINHOLE, 320, 240, 0, 260, 262, 161, 118, {}};
}

tv_camera small_distorted() {
  tv_camera camera;
  const tv_camera whole = scene::distorted();
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_scale(&whole, 0.5, &camera));
  return camera;
}

tv_camera small_fisheye() {
  tv_camera camera;
  const tv_camera whole = scene::fisheye();
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_scale(&whole, 0.5, &camera));
  return camera;
}

void test_sideways_motion_gives_the_scenes_depth() {
  check_scene("sideways", small_pinhole(), small_pinhole(), Mat3::Identity(), Vec3(-0.3, 0, 0),
              {40000, 0.5, 0.01});
}

void test_an_oblique_and_turned_camera_of_another_focal_length() {
  tv_camera other = small_pinhole();
  other.fx = other.fy = 230;
  other.cx = 150;
  const Mat3 R = rotation_about(Vec3(0.2, 1, 0.3), 0.12);
  check_scene("oblique", small_pinhole(), other, R, R * Vec3(-0.35, 0.2, -0.1), {25000, 0.6, 0.01});
}

void test_upward_motion_through_a_distorting_lens() {
  check_scene("distorted", small_distorted(), small_distorted(),
              rotation_about(Vec3(1, 0, 0), -0.05), Vec3(0.02, 0.35, 0.03), {35000, 0.8, 0.01});
}

void test_a_fisheye_lens() {
  check_scene("fisheye", small_fisheye(), small_fisheye(), rotation_about(Vec3(0, 1, 0), 0.04),
              Vec3(-0.4, 0.05, 0.1), {12000, 1.6, 0.03});
}

void test_forward_motion() {
  check_scene("forward", small_pinhole(), small_pinhole(), Mat3::Identity(), Vec3(0.02, 0, -0.5),
              {80000, 1.2, 0.08});
}

void test_backward_motion() {
  check_scene("backward", small_pinhole(), small_pinhole(), Mat3::Identity(), Vec3(0, 0.03, 0.5),
              {80000, 1.6, 0.08});
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_matcher_is_its_definition);
  RUN_TEST(test_windows_find_the_fraction_of_a_step);
  RUN_TEST(test_sideways_motion_gives_the_scenes_depth);
  RUN_TEST(test_an_oblique_and_turned_camera_of_another_focal_length);
  RUN_TEST(test_upward_motion_through_a_distorting_lens);
  RUN_TEST(test_a_fisheye_lens);
  RUN_TEST(test_forward_motion);
  RUN_TEST(test_backward_motion);
  return UNITY_END();
}
