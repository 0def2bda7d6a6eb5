// The map's bookkeeping (odometry/map.h) where keyframes and points are removed, where segments lie
// between each other's keyframes, and where a point is seen more often than any window has room
// for.

#include <unity.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "odometry/adjust.h"
#include "odometry/adjust_segment.h"
#include "odometry/find_points.h"
#include "odometry/keyframe.h"
#include "odometry/loop_closure.h"
#include "odometry/map.h"
#include "odometry/path.h"

namespace {

constexpr int32_t kKeyframes = 60, kKeypoints = 100, kPoints = 600;
alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;

tv_camera camera_of(int32_t model) { return {model, 640, 480, 0, 500, 500, 320, 240, {0}}; }

void begin(int32_t model) {
  const tv_camera camera = camera_of(model);
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  options.max_keypoints = kKeypoints;
  options.max_keyframes = kKeyframes;
  options.max_points = kPoints;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_odometry_init(&odometry, &camera, &options, memory, sizeof memory));
}

// A camera at x = `at` that looks along z, turned a little more with each one.
int32_t add_keyframe(double at, int32_t segment, int32_t num_keypoints) {
  static tv_keypoint keypoints[kKeypoints];
  static uint8_t descriptors[kKeypoints * TV_DESCRIPTOR_BYTES];
  tv::Map& map = odometry->map;
  for (tv_keypoint& k : keypoints) k = tv_keypoint{320, 240, 4, 0, 1, 0};
  const int32_t k = tv::add_keyframe(&map, keypoints, descriptors, num_keypoints);
  const double angle = 0.1 * map.keyframes[k].id, c = std::cos(angle), s = std::sin(angle);
  map.keyframes[k].cam_from_world = {{c, 0, -s, 0, 1, 0, s, 0, c}, {-c * at, 0, -s * at}};
  map.keyframes[k].segment = segment;
  odometry->num_segments = std::max(odometry->num_segments, segment + 1);
  return k;
}

int32_t add_point(double x, int32_t segment, int32_t made_at) {
  const double position[3] = {x, 0, 5};
  const uint8_t descriptor[TV_DESCRIPTOR_BYTES] = {};
  const int32_t p = tv::add_point(&odometry->map, position, descriptor, segment);
  odometry->map.points[p].made_at = made_at;
  return p;
}

// Where a frame is now that was 1 to the right of keyframe `id` when that was in this unit.
void expect_frame(int32_t id, double unit, double x, double z, int32_t segment) {
  const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3] = {1 / unit, 0, 0};
  double pose[9], at[3];
  int32_t found = -1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_pose_of(odometry, id, R, t, pose, at, &found));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, x, at[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, z, at[2]);
  TEST_ASSERT_EQUAL_INT(segment, found);
}

void test_frames_keep_their_place_over_many_removals() {
  tv::Map& map = odometry->map;
  for (int n = 0; n < 20 * kKeyframes; ++n) {
    add_keyframe(0.5 * n, 0, 0);
    map.keyframes[map.num_keyframes - 1].scale = 1 + n % 3;  // as loops would have left it
    if (map.num_keyframes < 8) continue;
    // Each one is relative to the one before it, which is removed next.
    for (int32_t k = 6; k > 0; --k) tv::remove_keyframe(&map, k, k - 1);
  }
  TEST_ASSERT_EQUAL_INT(tv::max_removed(map.sizes), map.num_removed);
  for (int32_t n = 0; n < map.num_removed; ++n) {
    TEST_ASSERT_TRUE(tv::find_keyframe(map, map.removed[n].kept_id) >= 0);
    const int32_t id = map.removed[n].id;
    const double angle = 0.1 * id;
    expect_frame(id, 1 + id % 3, 0.5 * id + std::cos(angle), -std::sin(angle), 0);
  }
  const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3] = {0, 0, 0};
  double pose[9], at[3];  // the first of them are forgotten
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_odometry_pose_of(odometry, 2, R, t, pose, at, nullptr));
}

// The first keyframe of a segment is removed where there is no other: it is no part of the segment
// before it.
void test_a_removed_keyframe_is_relative_to_one_of_its_segment() {
  tv::Map& map = odometry->map;
  for (int n = 0; n < kKeyframes; ++n) add_keyframe(n, n / 2, 0);
  odometry->reference_id = map.keyframes[kKeyframes - 1].id;
  tv::make_room(odometry, 1);
  TEST_ASSERT_EQUAL_INT(kKeyframes - 1, map.num_keyframes);
  TEST_ASSERT_EQUAL_INT(1, map.num_removed);
  const int32_t id = map.removed[0].id;
  const double angle = 0.1 * id;
  expect_frame(id, 1, id + std::cos(angle), -std::sin(angle), id / 2);
  // Of a segment of which none is left nothing is known.
  tv::make_room(odometry, kKeyframes / 2 + 2);
  for (int32_t n = 0; n < map.num_removed; ++n) {
    const int32_t k = tv::find_keyframe(map, map.removed[n].kept_id);
    if (k >= 0) TEST_ASSERT_EQUAL_INT(map.removed[n].id / 2, map.keyframes[k].segment);
  }
}

void test_points_move_with_keyframes_of_their_segment() {
  tv::Map& map = odometry->map;
  for (int n = 0; n < 6; ++n) add_keyframe(n, n < 3 ? 0 : 1, 0);
  // The keyframes that made these are gone, and those that come next are of the other segment.
  const int32_t before = add_point(2, 0, map.keyframes[2].id);
  const int32_t after = add_point(3, 1, map.keyframes[2].id);
  tv::remove_keyframe(&map, 2, 1);
  tv::MovedKeyframe moved[5] = {};
  for (int n = 2; n < 5; ++n) {  // segment 1 goes 10 to the left
    moved[n] = {map.keyframes[n].cam_from_world, 1};
    const double* R = moved[n].cam_from_world.R;
    moved[n].cam_from_world.t[0] += 10 * R[0];
    moved[n].cam_from_world.t[2] += 10 * R[6];
  }
  tv::move_keyframes(&map, moved);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2, map.points[before].position[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -7, map.points[after].position[0]);
}

// A loop is spread over the segment's own path: what lies between its keyframes in the array, in
// another segment and elsewhere, is no part of it.
void test_a_loop_is_spread_over_its_own_segment() {
  tv::Map& map = odometry->map;
  for (int n = 0; n < 21; ++n) add_keyframe(n >= 8 && n < 12 ? 1000 : n, n >= 8 && n < 12, 0);
  tv::LoopEnd end = {0, map.keyframes[20].cam_from_world, 1};
  const double* R = end.cam_from_world.R;
  end.cam_from_world.t[0] -= R[0];  // the last one is 1 farther to the right
  end.cam_from_world.t[2] -= R[6];
  odometry->median_depth = 4;
  const tv::Frame nothing{};
  tv::close_loop(odometry, 20, nothing, end);
  for (int n = 0; n < 21; ++n) {
    double at[3];
    tv::centre_of(map.keyframes[n].cam_from_world, at);
    const double expected = n >= 8 && n < 12 ? 1000 : n + n / 20.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected, at[0]);
  }
}

void test_a_point_that_no_window_has_room_for_is_passed_over() {
  tv::Map& map = odometry->map;
  const int32_t often = add_point(0, 0, 0), seldom = add_point(1, 0, 0);
  for (int n = 0; n < 30; ++n) {
    add_keyframe(0.01 * n, 0, kKeypoints);
    // 30 x 99 observations, more than 22 x 100.
    for (int32_t i = 1; i < kKeypoints; ++i) tv::observe(&map, n, i, often);
    tv::observe(&map, n, 0, seldom);
  }
  TEST_ASSERT_EQUAL_INT(2, tv::adjust_points(odometry, 0, 0, 1));
}

void test_a_map_is_added_in_the_places_of_points_that_are_gone() {
  static uint8_t bytes[1 << 16];
  size_t num;
  tv::Map& map = odometry->map;
  int32_t joined = -1;
  for (int n = 0; n < 2; ++n) add_keyframe(n, 0, 3);
  for (int32_t i = 0; i < 3; ++i) {
    const int32_t p = add_point(10 + i, 0, 1);
    for (int n = 0; n < 2; ++n) tv::observe(&map, n, i, p);
  }
  odometry->num_frames = 2;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save(odometry, bytes, sizeof bytes, &num));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  odometry->num_frames = 2;
  add_keyframe(0, 0, kKeypoints);
  for (int n = 0; n < kPoints; ++n) add_point(n, 0, 0);
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS, tv_odometry_add(odometry, bytes, num, &joined));
  tv::clear_marks(&map);
  for (int n = 0; n < kPoints; ++n) {
    if (n % 7 != 0) tv::mark_point(&map, n);
  }
  tv::remove_marked_points(&map);
  for (int32_t n = 0; n < kKeypoints && 7 * n < kPoints; ++n) tv::observe(&map, 0, n, 7 * n);
  const int32_t before = map.num_points;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(odometry, bytes, num, &joined));
  TEST_ASSERT_EQUAL_INT(before + 3, map.num_points);
  for (int k = 1; k < 3; ++k) {
    const int32_t* seen = tv::seen_by(map, map.keyframes[k]);
    for (int32_t i = 0; i < 3; ++i) {
      TEST_ASSERT_TRUE(map.points[seen[i]].position[0] == 10 + i);
      TEST_ASSERT_EQUAL_INT(2, map.points[seen[i]].num_observations);
    }
  }
}

// A fisheye lens sees what is beside and behind it.
void test_the_error_of_a_depth_is_that_of_a_distance_in_a_fisheye() {
  tv::MapPoint point{};
  point.position[2] = 4;
  point.depth_sigma = 0.1f;
  const double centre[3] = {1, 0, 0};
  const double ahead[3] = {0, 0, 4}, beside[3] = {4, 0, 0}, behind[3] = {0, 0, -4};
  begin(TV_CAMERA_KANNALA_BRANDT);
  // A shift of 0.1 at a distance of 4.
  for (const double* x : {ahead, beside, behind}) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 500 * 0.1 / 4, tv::depth_error_px(*odometry, point, centre, x));
  }
  begin(TV_CAMERA_PINHOLE);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 500 * 0.1 / 4,
                            tv::depth_error_px(*odometry, point, centre, ahead));
}

// A map in metres that has shrunk to nine tenths of itself: nothing in its pictures shows it. What
// velocities say of the ways between its keyframes does, unless the map has no metre.
void test_velocities_hold_the_scale_of_a_map_in_metres() {
  constexpr double kShrunk = 0.9, kWay = 0.5;
  constexpr int kViews = 8, kSeen = 60;
  const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (int source : {TV_SCALE_UNIT, TV_SCALE_VELOCITY}) {
    begin(TV_CAMERA_PINHOLE);
    tv::Map& map = odometry->map;
    for (int i = 0; i < kSeen; ++i) {
      const uint8_t descriptor[TV_DESCRIPTOR_BYTES] = {};
      const double position[3] = {kShrunk * (0.1 * i - 1), kShrunk * (0.3 * (i % 7) - 1),
                                  kShrunk * (4 + i % 5)};
      tv::add_point(&map, position, descriptor, 0);
    }
    for (int n = 0; n < kViews; ++n) {
      const int32_t k = add_keyframe(0, 0, kSeen);
      tv::MapKeyframe& own = map.keyframes[k];
      std::copy_n(R, 9, own.cam_from_world.R);
      own.cam_from_world.t[0] = -kShrunk * kWay * n;
      own.way_m[0] = kWay;
      own.way_variance = n == 0 ? 0 : 0.02 * 0.02;
      tv::MapKeypoint* keypoints = tv::keypoints_of(map, own);
      for (int i = 0; i < kSeen; ++i) {
        const double* X = map.points[i].position;
        keypoints[i].x = static_cast<float>(320 + 500 * (X[0] + own.cam_from_world.t[0]) / X[2]);
        keypoints[i].y = static_cast<float>(240 + 500 * X[1] / X[2]);
        tv::observe(&map, k, i, i);
      }
    }
    map.keyframes[4].way_m[0] = 5 * kWay;  // a sensor's error: left out
    odometry->scale.source = source;
    tv::adjust_around(odometry, kViews - 1, 20);
    for (int n = 1; n < kViews; ++n) {
      const double way =
          map.keyframes[n - 1].cam_from_world.t[0] - map.keyframes[n].cam_from_world.t[0];
      TEST_ASSERT_DOUBLE_WITHIN(1e-3, source == TV_SCALE_UNIT ? kShrunk * kWay : kWay, way);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.02, (source == TV_SCALE_UNIT ? kShrunk : 1) * 4,
                              map.points[0].position[2]);
  }
}

// Ten frames a second along x, a tenth of a unit each, of which 1, 5, 6, 7 and 9 have no pose yet.
void test_a_frame_found_afterwards_is_where_the_camera_can_have_flown() {
  begin(TV_CAMERA_PINHOLE);
  for (const int32_t segment : {0, 1}) {
    odometry->map.keyframes[add_keyframe(0, segment, 0)].frame = 1000 + segment;
  }
  constexpr int kNum = 10;
  tv_path_frame frames[kNum] = {};
  for (int n = 0; n < kNum; ++n) {
    tv_path_frame* frame = &frames[n];
    *frame = {0.1 * n, n, TV_PATH_TRACKED, 0, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0.1 * n, 0, 0}};
    if (n == 1 || n == 9 || (n >= 5 && n <= 7)) frame->origin = TV_PATH_UNKNOWN;
  }
  const auto can_be = [&](int32_t idx, int32_t segment, double x, double y) {
    const tv_path_pose pose = {TV_PATH_LOCATED, segment, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {x, y, 0}};
    return tv::can_have_flown(odometry->map, frames, kNum, idx, pose);
  };
  TEST_ASSERT_TRUE(can_be(1, 0, 0.1, 0.02));
  TEST_ASSERT_TRUE(can_be(6, 0, 0.6, 0.3));  // two frames from both neighbours
  TEST_ASSERT_TRUE(can_be(9, 0, 0.98, 0));   // with one on one side alone
  TEST_ASSERT_FALSE(can_be(1, 0, 0.1, 1.1));
  TEST_ASSERT_FALSE(can_be(6, 0, 0.6, 0.5));
  TEST_ASSERT_FALSE(can_be(9, 0, 1.3, 0));
  TEST_ASSERT_FALSE(can_be(7, 0, 0.3, 0));  // near the one before, not the one after
  TEST_ASSERT_TRUE(can_be(1, 1, 9, 9));     // of a segment of which nothing is tracked
  // The turn alone was followed: that position is the one of the frame before, and bounds nothing.
  frames[8].origin = TV_PATH_TURNED;
  TEST_ASSERT_TRUE(can_be(7, 0, 0.3, 0));
}

}  // namespace

extern "C" void setUp(void) { begin(TV_CAMERA_PINHOLE); }

extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_frames_keep_their_place_over_many_removals);
  RUN_TEST(test_a_removed_keyframe_is_relative_to_one_of_its_segment);
  RUN_TEST(test_points_move_with_keyframes_of_their_segment);
  RUN_TEST(test_a_loop_is_spread_over_its_own_segment);
  RUN_TEST(test_a_point_that_no_window_has_room_for_is_passed_over);
  RUN_TEST(test_a_map_is_added_in_the_places_of_points_that_are_gone);
  RUN_TEST(test_the_error_of_a_depth_is_that_of_a_distance_in_a_fisheye);
  RUN_TEST(test_velocities_hold_the_scale_of_a_map_in_metres);
  RUN_TEST(test_a_frame_found_afterwards_is_where_the_camera_can_have_flown);
  return UNITY_END();
}
