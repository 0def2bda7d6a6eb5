// What stands still in the picture (robust/still.h): on-screen text and the like is left out of a
// pair, and far scenery, a forward flight, an orbit and a camera at rest are not. TWOVIEW_SEED
// selects other pairs.
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "support/calls.h"
#include "support/estimator.h"
#include "support/scene.h"
#include "twoview/two_view.h"

namespace {

using scene::Kind;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr int kTrials = 12;
tv_context* context;
scene::Scene pair;
uint8_t mask[scene::kMaxMatches];
uint64_t base_seed = 1000;
tv::Random noise;

tv_two_view estimate(int num, bool swapped = false, bool calibrated = true) {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  options.method = calibrated ? TV_SOLVER_FIVE_POINT : TV_SOLVER_SEVEN_POINT;
  tv_two_view result;
  tv_two_view_init(&result);
  const tv_camera* cameras = calibrated ? pair.options.camera : nullptr;
  const int first = swapped ? 1 : 0;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, estimate_pixels(context, calibrated ? cameras + first : nullptr,
                             calibrated ? cameras + 1 - first : nullptr, pair.pixels[first],
                             pair.pixels[1 - first], pair.ratios, num, &options, &result, mask));
  return result;
}

void add(int* num, const Vec2& p0, const Vec2& p1) {
  TEST_ASSERT_TRUE(*num < scene::kMaxMatches);
  for (int k = 0; k < 2; ++k) {
    pair.pixels[0][2 * *num + k] = p0[k];
    pair.pixels[1][2 * *num + k] = p1[k];
  }
  pair.ratios[*num] = static_cast<float>(scene::uniform(&noise, 0.3, 0.7));
  ++*num;
}

// Lines of text in the picture, or legs at its lower edge that vibrate by so many pixels.
void add_overlay(int num_overlay, double vibration_px, int* num) {
  const tv_camera& camera = pair.options.camera[0];
  for (int k = 0; k < num_overlay; ++k) {
    const double x = scene::uniform(&noise, 0.05, 0.3) * camera.width;
    const double y = (0.1 + 0.1 * (k % 4)) * camera.height + scene::uniform(&noise, 0, 10);
    const Vec2 moved = scene::uniform2(&noise, vibration_px, vibration_px);
    add(num, Vec2(x, y), Vec2(x, y) + moved);
  }
}

void make(Kind kind, int trial, const tv_camera& camera = scene::pinhole()) {
  scene::Options options;
  options.kind = kind;
  options.num = 250;
  options.inlier_share = 0.8;
  options.seed = base_seed + static_cast<uint64_t>(trial);
  options.camera[0] = options.camera[1] = camera;
  scene::make(options, &pair);
  noise = tv::random_seeded(options.seed);
}

double turn_error_deg(const tv_two_view& found) {
  return scene::rotation_error_deg(found.R, pair.R);
}

// Whether what follows the matches of the scene is left out. It is not where it lies on the curve
// on which the motion keeps points at their pixel, or where the motion is too uncertain to say:
// then the pose is right with it, or "doubtful".
bool is_left_out(int num_scene, int num) {
  const tv_two_view found = estimate(num);
  TEST_ASSERT_EQUAL_INT(num, found.num_matches);
  if (found.num_still == 0) {
    TEST_ASSERT_TRUE(found.verdict != TV_VERDICT_OK || turn_error_deg(found) < 0.5);
    return false;
  }
  TEST_ASSERT_INT_WITHIN(20, num - num_scene, found.num_still);  // or near where nothing moves
  TEST_ASSERT_TRUE(found.has_R);
  TEST_ASSERT_TRUE(turn_error_deg(found) < 0.3);
  int inliers = 0;
  for (int k = num_scene; k < num; ++k) inliers += mask[k];
  TEST_ASSERT_EQUAL_INT(0, inliers);
  const tv_two_view back = estimate(num, true);
  TEST_ASSERT_EQUAL_INT(found.num_still, back.num_still);
  for (int k = 0; k < 9; ++k) {
    TEST_ASSERT_TRUE(found.R[k] == back.R[3 * (k % 3) + k / 3]);
  }
  return true;
}

void test_text_is_left_out_of_every_kind_of_pair(void) {
  for (Kind kind : {Kind::kGeneral, Kind::kForward, Kind::kRotation}) {
    int num_found = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      make(kind, trial);
      int num = pair.options.num;
      add_overlay(120, 0.1, &num);
      num_found += is_left_out(pair.options.num, num);
    }
    TEST_ASSERT_GREATER_OR_EQUAL_INT(2 * kTrials / 3, num_found);
  }
}

void test_text_is_left_out_through_lenses_that_distort(void) {
  for (const tv_camera& camera : {scene::distorted(), scene::fisheye()}) {
    int num_found = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      make(Kind::kGeneral, trial, camera);
      int num = pair.options.num;
      add_overlay(80, 0.1, &num);
      num_found += is_left_out(pair.options.num, num);
    }
    TEST_ASSERT_GREATER_OR_EQUAL_INT(kTrials / 2, num_found);
  }
}

void test_legs_that_vibrate_are_left_out(void) {
  int num_found = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    make(Kind::kGeneral, trial);
    int num = pair.options.num;
    add_overlay(40, 1, &num);
    num_found += is_left_out(pair.options.num, num);
  }
  TEST_ASSERT_GREATER_OR_EQUAL_INT(2 * kTrials / 3, num_found);
}

// A point of the scene, where both cameras see it.
void add_point(const Vec3& X, int* num) {
  const tv::Camera camera = tv::prepare_camera(pair.options.camera[0]);
  Vec2 p0, p1;
  if (!tv::project(camera, X, &p0, nullptr) ||
      !tv::project(camera, pair.R * X + pair.t, &p1, nullptr)) {
    return;
  }
  const Vec2 d0(0.3 * scene::normal(&noise), 0.3 * scene::normal(&noise));
  if (p1[0] > 0 && p1[1] > 0 && p1[0] < 639 && p1[1] < 479) add(num, p0 + d0, p1);
}

Vec3 point_of_view(double depth) {
  const Vec2 at = scene::uniform2(&noise, 0.6, 0.45);
  return depth * Vec3(at[0], at[1], 1);
}

void begin(int trial, const Mat3& R, const Vec3& t) {
  make(Kind::kStill, trial);
  pair.R = R;
  pair.t = t;
}

void expect_none(int num) {
  const tv_two_view found = estimate(num);
  TEST_ASSERT_EQUAL_INT(0, found.num_still);
}

void test_far_scenery_is_not_left_out(void) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const bool forward = trial % 2 == 1;
    begin(trial, Mat3::Identity(), forward ? Vec3(0.1, 0, -1) : Vec3(-1, 0.1, 0.1));
    int num = 0;
    for (int k = 0; k < 80; ++k) add_point(point_of_view(1e5), &num);
    for (int k = 0; k < 250; ++k) add_point(point_of_view(scene::uniform(&noise, 4, 15)), &num);
    expect_none(num);
    const tv_two_view found = estimate(num);
    TEST_ASSERT_TRUE(found.has_t && turn_error_deg(found) < 0.2);
  }
}

// The camera flies around a thing and keeps it in the middle: it does not move in the picture.
void test_what_an_orbit_turns_about_is_not_left_out(void) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const double angle = 0.05 + 0.01 * trial;
    const Mat3 R = tv::rotation_about(Vec3(0, 1, 0), angle);
    const Vec3 middle(0, 0, 6);
    begin(trial, R, middle - R * middle);
    int num = 0;
    for (int k = 0; k < 60; ++k) {
      const Vec2 beside = scene::uniform2(&noise, 0.02, 0.8);
      add_point(middle + Vec3(beside[0], beside[1], scene::uniform(&noise, -0.02, 0.02)), &num);
    }
    for (int k = 0; k < 200; ++k) add_point(point_of_view(scene::uniform(&noise, 9, 20)), &num);
    expect_none(num);
  }
}

// Most of the picture is at rest and a car crosses it.
void test_a_camera_at_rest_does_not_follow_what_moves(void) {
  for (int trial = 0; trial < kTrials; ++trial) {
    begin(trial, Mat3::Identity(), Vec3::Zero());
    int num = 0;
    for (int k = 0; k < 200; ++k) add_point(point_of_view(scene::uniform(&noise, 4, 15)), &num);
    const Mat3 R = tv::rotation_about(Vec3(0, 1, 0), 0.1);
    begin(trial, R, Vec3(-1, 0, 0.2));
    for (int k = 0; k < 100; ++k) {
      const double depth = scene::uniform(&noise, 5, 7);
      const Vec2 at = scene::uniform2(&noise, 0.25, 0.2);
      add_point(depth * Vec3(at[0], at[1], 1), &num);
    }
    expect_none(num);
  }
}

void test_few_still_matches_and_pairs_without_cameras_are_as_before(void) {
  make(Kind::kGeneral, 0);
  int num = pair.options.num;
  add_overlay(7, 0, &num);
  expect_none(num);
  add_overlay(100, 0, &num);
  TEST_ASSERT_EQUAL_INT(0, estimate(num, false, false).num_still);
  pair.options.camera[1].width += 2;
  expect_none(num);
}

}  // namespace

void setUp(void) { context = estimator::make_context(scene::kMaxMatches); }

void tearDown(void) {}

int main(void) {
  const char* seed = std::getenv("TWOVIEW_SEED");
  if (seed != nullptr) base_seed = std::strtoull(seed, nullptr, 10);
  std::printf("TWOVIEW_SEED=%llu\n", static_cast<unsigned long long>(base_seed));
  UNITY_BEGIN();
  RUN_TEST(test_text_is_left_out_of_every_kind_of_pair);
  RUN_TEST(test_text_is_left_out_through_lenses_that_distort);
  RUN_TEST(test_legs_that_vibrate_are_left_out);
  RUN_TEST(test_far_scenery_is_not_left_out);
  RUN_TEST(test_what_an_orbit_turns_about_is_not_left_out);
  RUN_TEST(test_a_camera_at_rest_does_not_follow_what_moves);
  RUN_TEST(test_few_still_matches_and_pairs_without_cameras_are_as_before);
  return UNITY_END();
}
