// The views of the rungs of effort: their budgets, how keypoints map back to the image, and the
// shape of a patch.

#include "feature/tilts.h"

#include <unity.h>

#include <cmath>

#include "base/math.h"
#include "support/random.h"

namespace {

void test_a_rung_has_no_more_keypoints_than_its_budget() {
  uint64_t seed = 5310;
  for (int round = 0; round < 2000; ++round) {
    const int max_keypoints = random_int(&seed, 1, round % 2 == 0 ? 65535 : 4096);
    for (int rung = 0; rung <= tv::kMaxEffort; ++rung) {
      const int budget = tv::rung_budget(rung, max_keypoints);
      int sum = 0;
      for (int tilt = 0; tilt < tv::tilts_of_rung(rung); ++tilt) {
        sum += tv::view_budget(rung, tilt, max_keypoints);
      }
      TEST_ASSERT_LESS_OR_EQUAL(budget, sum);
      TEST_ASSERT_LESS_OR_EQUAL(65535, budget);
      // A context that is made for more keypoints has room for fewer.
      const int fewer = random_int(&seed, 1, max_keypoints);
      TEST_ASSERT_LESS_OR_EQUAL(budget, tv::rung_budget(rung, fewer));
    }
  }
  TEST_ASSERT_EQUAL_INT(2048, tv::rung_budget(0, 2048));
  TEST_ASSERT_EQUAL_INT(8192, tv::rung_budget(1, 2048));
  TEST_ASSERT_EQUAL_INT(6144, tv::rung_budget(2, 2048));
  TEST_ASSERT_LESS_OR_EQUAL(6.5 * 2048, tv::rung_budget(3, 2048));
}

// The tilts differ from each other: no two maps have the same entries.
void test_no_view_is_made_twice() {
  for (int a = 1; a < tv::kNumTilts; ++a) {
    for (int b = a + 1; b < tv::kNumTilts; ++b) {
      const tv::Squeeze s = tv::squeeze_of(a, 640, 480), t = tv::squeeze_of(b, 640, 480);
      TEST_ASSERT_TRUE(s.step_x != t.step_x || s.step_y != t.step_y || s.shear != t.shear);
    }
  }
}

tv_keypoint random_keypoint(uint64_t* seed) {
  tv_keypoint p{};
  p.x = static_cast<float>(random_int(seed, 0, 6000)) / 10;
  p.y = static_cast<float>(random_int(seed, 0, 4000)) / 10;
  p.size = static_cast<float>(random_int(seed, 40, 400)) / 10;
  p.angle_rad = static_cast<float>(random_int(seed, -314, 314)) / 100;
  return p;
}

// The shape of a mapped keypoint is the derivative of the map, times the patch's axes in the view.
void test_a_shape_is_how_the_patch_of_the_view_lies_in_the_image() {
  uint64_t seed = 5311;
  for (int tilt = 0; tilt < tv::kNumTilts; ++tilt) {
    for (int round = 0; round < 50; ++round) {
      const tv_keypoint in_view = random_keypoint(&seed);
      tv_keypoint in_image = in_view;
      tv::Squeeze s{};
      if (tilt > 0) {
        s = tv::squeeze_of(tilt, 640, 480);
        tv::map_keypoints(s, &in_image, 1);
      }
      double shape[4];
      tv::patch_shape(in_image, tilt, shape);
      for (int axis = 0; axis < 2; ++axis) {
        const double angle = static_cast<double>(in_view.angle_rad) + axis * tv::kPi / 2;
        const double u = static_cast<double>(in_view.x), v = static_cast<double>(in_view.y);
        const double du = static_cast<double>(in_view.size) * std::cos(angle);
        const double dv = static_cast<double>(in_view.size) * std::sin(angle);
        double from[2] = {u, v}, to[2] = {u + du, v + dv};
        if (tilt > 0) {
          tv::to_image(s, u, v, &from[0], &from[1]);
          tv::to_image(s, u + du, v + dv, &to[0], &to[1]);
        }
        const double within = 1e-5 * static_cast<double>(in_view.size) + 1e-4;
        TEST_ASSERT_DOUBLE_WITHIN(within, to[0] - from[0], shape[axis]);
        TEST_ASSERT_DOUBLE_WITHIN(within, to[1] - from[1], shape[2 + axis]);
      }
      const double area = shape[0] * shape[3] - shape[1] * shape[2];
      const double size = static_cast<double>(in_image.size);
      TEST_ASSERT_DOUBLE_WITHIN(1e-4 * area, size * size, area);
      const double along = std::atan2(shape[2], shape[0]);
      TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, std::sin(along - static_cast<double>(in_image.angle_rad)));
    }
  }
}

// So two views of the same patch compare upright, whatever rotation the squeezed rows add.
void test_upright_patches_are_squeezed_and_not_turned() {
  for (int tilt = 1; tilt < tv::kNumTilts; ++tilt) {
    tv_keypoint p{};
    p.x = p.y = 100;
    p.size = 8;
    p.angle_rad = tv::upright_angle_rad(tilt);
    tv::map_keypoints(tv::squeeze_of(tilt, 640, 480), &p, 1);
    double shape[4];
    tv::patch_shape(p, tilt, shape);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, shape[1], shape[2]);
    TEST_ASSERT_GREATER_THAN(0.0, shape[0]);
    TEST_ASSERT_GREATER_THAN(0.0, shape[3]);
  }
}

void test_a_keypoint_is_never_larger_than_matching_takes() {
  tv_keypoint p{};
  p.size = 4000;
  tv::map_keypoints(tv::squeeze_of(9, 640, 480), &p, 1);
  TEST_ASSERT_TRUE(p.size == tv::kMostKeypointSize);
}

void test_too_small_and_too_large_views_are_left_out() {
  TEST_ASSERT_FALSE(tv::is_usable(tv::squeeze_of(1, 40, 30)));  // 20 x 30
  TEST_ASSERT_FALSE(tv::is_usable(tv::squeeze_of(3, 40, 30)));  // 40 x 15
  TEST_ASSERT_TRUE(tv::is_usable(tv::squeeze_of(5, 40, 30)));   // 28 x 30
  TEST_ASSERT_TRUE(tv::is_usable(tv::squeeze_of(2, 640, 480)));
  TEST_ASSERT_FALSE(tv::is_usable(tv::squeeze_of(2, 16384, 16384)));
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_rung_has_no_more_keypoints_than_its_budget);
  RUN_TEST(test_no_view_is_made_twice);
  RUN_TEST(test_a_shape_is_how_the_patch_of_the_view_lies_in_the_image);
  RUN_TEST(test_upright_patches_are_squeezed_and_not_turned);
  RUN_TEST(test_a_keypoint_is_never_larger_than_matching_takes);
  RUN_TEST(test_too_small_and_too_large_views_are_left_out);
  return UNITY_END();
}
