// What a loop does (odometry/loop_closure.h): to the scale that sensors gave, with keyframes that
// see no points; to the keyframes and points of an invented room (odometry/adjust_segment.h); and
// when few points are believed.

#include <unity.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "odometry/adjust_segment.h"
#include "odometry/loop_closure.h"
#include "odometry/map.h"
#include "odometry/metric.h"
#include "odometry/spread.h"

namespace {

constexpr int kNum = 20;
alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;

// Keyframes on a line, 0.1 apart.
void add_keyframes() {
  const tv_keypoint no_keypoint{};
  const uint8_t no_descriptor = 0;
  for (int k = 0; k < kNum; ++k) {
    const int32_t at = tv::add_keyframe(&odometry->map, &no_keypoint, &no_descriptor, 0);
    odometry->map.keyframes[at].cam_from_world = tv::kIdentity;
    odometry->map.keyframes[at].cam_from_world.t[0] = -0.1 * k;
  }
}

double path_length() {
  const tv::MapKeyframe* k = odometry->map.keyframes;
  double length = 0;
  for (int i = 1; i < odometry->map.num_keyframes; ++i) {
    length += tv::way_between(k[i - 1].cam_from_world, k[i].cam_from_world);
  }
  return length;
}

// The metres in a unit of the map, as the ways of the keyframes say.
double scale_of_ways() {
  const tv::MetricScale kept = odometry->scale;
  odometry->scale = tv::MetricScale{};
  tv::gather_ways(odometry);
  const double scale = odometry->scale.velocity.product / odometry->scale.velocity.square;
  odometry->scale = kept;
  return scale;
}

double known_scale() { return odometry->scale.velocity.product / odometry->scale.velocity.square; }

// The velocities say that each way is `metres` long for a unit of the map.
void measure_ways(double metres) {
  tv::Map& map = odometry->map;
  for (int32_t k = 1; k < map.num_keyframes; ++k) {
    const tv::Rigid back =
        tv::motion_between(map.keyframes[k - 1].cam_from_world, map.keyframes[k].cam_from_world);
    for (int c = 0; c < 3; ++c) map.keyframes[k].way_m[c] = -metres * back.t[c];
    map.keyframes[k].way_variance = 0.01;
    map.keyframes[k].is_followed = true;
  }
  odometry->scale = tv::MetricScale{};
  tv::gather_ways(odometry);
}

// Whoever is found again after a loss is not where the ways led.
void test_a_way_across_a_loss_says_nothing_of_the_scale() {
  add_keyframes();
  measure_ways(0.8);
  tv::MapKeyframe& found = odometry->map.keyframes[kNum / 2];
  found.cam_from_world.t[0] -= 7;
  found.way_m[0] += 3;
  found.is_followed = (&found)[1].is_followed = false;
  tv::gather_ways(odometry);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.8, known_scale());
  TEST_ASSERT_TRUE(odometry->scale.velocity.num == 3 * (kNum - 3));
}

// Ways that contradict the map are outliers, but not where they are most of them.
void test_contrary_ways_count_where_they_say_more_than_the_others() {
  add_keyframes();
  for (const int num_contrary : {kNum / 2 - 1, kNum / 2 + 1}) {
    measure_ways(0.8);
    for (int k = 1; k <= num_contrary; ++k) {
      odometry->map.keyframes[k].is_contrary = true;
      odometry->map.keyframes[k].way_m[0] *= -1;
    }
    tv::gather_ways(odometry);
    const tv::ScaleEstimate estimate = tv::velocity_estimate(odometry->scale);
    const double of_all = 0.8 * (kNum - 1 - 2 * num_contrary) / (kNum - 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, num_contrary < kNum / 2 ? 0.8 : of_all,
                              estimate.product / estimate.square);
  }
}

void test_the_metre_keeps_its_length_when_a_loop_stretches_the_path() {
  add_keyframes();
  measure_ways(0.8);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.8, known_scale());
  const double before_m = 0.8 * path_length();
  tv::LoopEnd end = {0, tv::kIdentity, 1.2};
  end.cam_from_world.t[0] = -2.2;  // it was at 1.9
  const tv::Frame nothing{};
  tv::close_loop(odometry, kNum - 1, nothing, end);
  TEST_ASSERT_TRUE(path_length() > 2.1);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, scale_of_ways(), known_scale());
  TEST_ASSERT_DOUBLE_WITHIN(0.02, before_m, known_scale() * path_length());
}

// A segment's ways count in the one that it becomes a part of, whose own are not known here.
void test_the_metre_goes_with_a_segment_that_joins_another_one() {
  add_keyframes();
  measure_ways(0.8);
  for (int k = 0; k < 5; ++k) odometry->map.keyframes[k].segment = 1;
  for (int k = 0; k <= 5; ++k) odometry->map.keyframes[k].is_followed = false;
  const tv::LoopEnd end = {2, tv::kIdentity, 2};
  const tv::Frame nothing{};
  tv::close_loop(odometry, kNum - 1, nothing, end);
  TEST_ASSERT_EQUAL_INT(1, odometry->segment);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4, known_scale());
}

void test_a_way_goes_on_over_a_keyframe_that_is_removed() {
  add_keyframes();
  measure_ways(0.8);
  odometry->map.keyframes[7].cam_from_world.R[0] = odometry->map.keyframes[7].cam_from_world.R[8] =
      -1;  // half a turn, after which its way to the next one points backwards
  measure_ways(0.8);
  tv::remove_keyframe(&odometry->map, 7, 6);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.8, scale_of_ways());
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.16, odometry->map.keyframes[7].way_m[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02, odometry->map.keyframes[7].way_variance);
  odometry->map.keyframes[9].way_variance = 0;
  tv::remove_keyframe(&odometry->map, 9, 8);
  TEST_ASSERT_TRUE(odometry->map.keyframes[9].way_variance == 0);
}

// ---- a room ----

constexpr int kViews = 40, kPoints = 700;
constexpr double kPi = 3.14159265358979323846;
double true_points[kPoints][3];
tv::Rigid true_poses[kViews];

double uniform() { return rand() / (RAND_MAX + 1.0); }

tv::Rigid turned(double angle) {
  return {{cos(angle), 0, -sin(angle), 0, 1, 0, sin(angle), 0, cos(angle)}, {0, 0, 0}};
}

// Looks outward along a circle of radius 1, at walls 3 to 4 from its centre. The next keyframe's
// place is `stride` places further along the circle.
void invent_room(int stride) {
  srand(7);
  for (auto& point : true_points) {
    const double angle = 2 * kPi * uniform(), distance = 3 + uniform();
    point[0] = distance * sin(angle);
    point[1] = 2 * uniform() - 1;
    point[2] = distance * cos(angle);
  }
  for (int k = 0; k < kViews; ++k) {
    const double angle = 2 * kPi * (stride * k % kViews) / kViews;
    tv::Rigid there = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {-sin(angle), 0, -cos(angle)}};
    true_poses[k] = tv::compose(turned(angle), there);
  }
}

// What a drift of up to 7 cm and 2 degrees makes of a pose, none at the first keyframe.
tv::Rigid drifted(int k) {
  const double share = sin(kPi * k / kViews);
  tv::Rigid drift = turned(0.035 * share);
  drift.t[0] = 0.06 * share;
  drift.t[1] = -0.04 * share;
  return tv::compose(true_poses[k], drift);
}

// The map of the room: exact pixels, poses that drifted, and points that drifted with the keyframe
// that sees them first. Returns how many observations there are.
int map_room() {
  tv::Map& map = odometry->map;
  int num = 0;
  int32_t place_of[kPoints];
  for (int32_t& place : place_of) place = tv::kNoPoint;
  for (int k = 0; k < kViews; ++k) {
    tv_keypoint keypoints[100] = {};
    int seen[100], num_seen = 0;
    for (int p = 0; p < kPoints && num_seen < 100; ++p) {
      double x[3];
      tv::transform(true_poses[k], true_points[p], x);
      const double u = 500 * x[0] / x[2] + 320, v = 500 * x[1] / x[2] + 240;
      if (x[2] < 0.5 || u < 0 || u > 639 || v < 0 || v > 479) continue;
      keypoints[num_seen] = {static_cast<float>(u), static_cast<float>(v), 4, 0, 1, 0};
      seen[num_seen++] = p;
    }
    static const uint8_t descriptors[100 * TV_DESCRIPTOR_BYTES] = {};
    const int32_t at = tv::add_keyframe(&map, keypoints, descriptors, num_seen);
    map.keyframes[at].cam_from_world = drifted(k);
    for (int i = 0; i < num_seen; ++i) {
      int32_t* place = &place_of[seen[i]];
      if (*place == tv::kNoPoint) {
        double x[3], world[3];
        tv::transform(true_poses[k], true_points[seen[i]], x);
        tv::transform(tv::inverse(drifted(k)), x, world);
        *place = tv::add_point(&map, world, descriptors, 0);
        map.points[*place].made_at = map.keyframes[at].id;
      }
      tv::observe(&map, at, i, *place);
      ++num;
    }
  }
  return num;
}

// The largest distance of a keyframe from where it is, in the unit that the path's length gives.
double worst_position() {
  double worst = 0, truth = 0;
  for (int k = 1; k < kViews; ++k) truth += tv::way_between(true_poses[k - 1], true_poses[k]);
  const double scale = truth / path_length();
  double first[3];
  tv::centre_of(true_poses[0], first);
  for (int k = 0; k < kViews; ++k) {
    double a[3], b[3];
    tv::centre_of(true_poses[k], a);
    tv::centre_of(odometry->map.keyframes[k].cam_from_world, b);
    for (int c = 0; c < 3; ++c) b[c] = first[c] + scale * (b[c] - first[c]);
    worst = fmax(worst, tv::distance_between(a, b));
  }
  return worst;
}

// The mean distance in pixels between the keypoints and the images of their points.
double mean_error() {
  const tv::Map& map = odometry->map;
  double sum = 0;
  int num = 0;
  for (int k = 0; k < kViews; ++k) {
    const tv::MapKeypoint* own = tv::keypoints_of(map, map.keyframes[k]);
    const int32_t* seen = tv::seen_by(map, map.keyframes[k]);
    for (int i = 0; i < map.keyframes[k].num_keypoints; ++i) {
      if (seen[i] == tv::kNoPoint) continue;
      double x[3];
      tv::transform(map.keyframes[k].cam_from_world, map.points[seen[i]].position, x);
      sum += hypot(500 * x[0] / x[2] + 320 - static_cast<double>(own[i].x),
                   500 * x[1] / x[2] + 240 - static_cast<double>(own[i].y));
      ++num;
    }
  }
  return sum / num;
}

// A window holds fewer observations than the room has, so that some points only move with their
// keyframes.
void test_all_keyframes_of_a_segment_are_adjusted_together() {
  const int num = map_room();
  TEST_ASSERT_TRUE(num > 22 * odometry->options.max_keypoints);
  TEST_ASSERT_TRUE(worst_position() > 0.04);
  const double before = mean_error();
  TEST_ASSERT_TRUE(before > 2);
  int steps = 1;
  while (steps < 12 && tv::adjust_segment(odometry, 0, 0, 1)) ++steps;
  TEST_ASSERT_TRUE(steps < 8);
  TEST_ASSERT_TRUE(worst_position() < 1e-4);
  const double between = mean_error();
  TEST_ASSERT_TRUE(between > 0.2 && between < before);
  int32_t place = 0, calls = 0;
  for (; place < odometry->map.end_points; ++calls) {
    place = tv::adjust_points(odometry, 0, place, 5);
  }
  TEST_ASSERT_TRUE(calls > 1);
  TEST_ASSERT_TRUE(mean_error() < 0.02);
  TEST_ASSERT_TRUE(worst_position() < 1e-4);
}

// Nine places lie between one keyframe and the next, so that the order of least degree, in which
// they are adjusted, is another than that in which they were added.
void test_keyframes_are_adjusted_in_any_order() {
  invent_room(9);
  map_room();
  TEST_ASSERT_TRUE(worst_position() > 0.04);
  int steps = 1;
  while (steps < 12 && tv::adjust_segment(odometry, 0, 0, 1)) ++steps;
  TEST_ASSERT_TRUE(steps < 12);
  TEST_ASSERT_TRUE(worst_position() < 1e-4);
}

// The older keyframes stay where they are, and hold the newer ones through the points alone.
void test_older_keyframes_are_held() {
  constexpr int kFirst = 16;
  map_room();
  tv::Map& map = odometry->map;
  for (int k = 0; k < kFirst; ++k) map.keyframes[k].cam_from_world = true_poses[k];
  TEST_ASSERT_TRUE(worst_position() > 0.04);
  int steps = 1;
  while (steps < 12 && tv::adjust_segment(odometry, 0, map.keyframes[kFirst].id, 1)) ++steps;
  TEST_ASSERT_TRUE(steps < 12);
  for (int k = 0; k < kFirst; ++k) {
    TEST_ASSERT_EQUAL_MEMORY(&true_poses[k], &map.keyframes[k].cam_from_world, sizeof(tv::Rigid));
  }
  TEST_ASSERT_TRUE(worst_position() < 1e-4);
}

// Each way counts as it is after the steps, and not by what they make of the whole path.
void test_the_metre_is_that_of_the_ways_as_they_are() {
  map_room();
  measure_ways(0.5);
  for (int k = 1; k < kViews; ++k) {  // as the true path has them
    const tv::Rigid back = tv::motion_between(true_poses[k - 1], true_poses[k]);
    for (int c = 0; c < 3; ++c) odometry->map.keyframes[k].way_m[c] = -0.5 * back.t[c];
  }
  odometry->scale = tv::MetricScale{};
  tv::gather_ways(odometry);
  int steps = 0;
  while (tv::adjust_segment(odometry, 0, 0, 1)) ++steps;
  TEST_ASSERT_TRUE(steps > 1);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, scale_of_ways(), known_scale());
  double length = 0;
  for (int k = 1; k < kViews; ++k) length += tv::way_between(true_poses[k - 1], true_poses[k]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.5 * length / path_length(), known_scale());
}

// The first keyframe of a flight is the one that the start knew worst: it is not held.
void test_the_first_keyframe_of_an_upright_segment_finds_its_place() {
  map_room();
  tv::Map& map = odometry->map;
  odometry->is_upright = true;
  for (int k = 0; k < kViews; ++k) {  // gravity along z, as in the true map
    for (int r = 0; r < 3; ++r) map.keyframes[k].down[r] = true_poses[k].R[3 * r + 2];
    map.keyframes[k].down_sigma_rad = 0.01;
  }
  map.keyframes[0].cam_from_world.t[0] += 0.3;
  const tv::Rigid first = map.keyframes[0].cam_from_world;
  for (int step = 0; step < 4; ++step) tv::adjust_segment(odometry, 0, 0, 1);
  TEST_ASSERT_TRUE(tv::way_between(first, map.keyframes[0].cam_from_world) > 0.2);
}

void test_a_frame_and_the_measured_way_move_with_their_keyframe() {
  map_room();
  constexpr int kReference = 20;
  tv::MapKeyframe* reference = &odometry->map.keyframes[kReference];
  odometry->reference_id = reference->id;
  tv::Frame frame{};
  frame.cam_from_world = reference->cam_from_world;
  tv::centre_of(reference->cam_from_world, odometry->travel.from);
  odometry->spread = {12, 0, 0, 0, 0};
  while (odometry->spread.num_steps > 0) tv::step_spread(odometry, &frame);
  double centre[3];
  tv::centre_of(reference->cam_from_world, centre);
  TEST_ASSERT_TRUE(tv::way_between(drifted(kReference), reference->cam_from_world) > 0.01);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0,
                            tv::way_between(frame.cam_from_world, reference->cam_from_world));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, tv::distance_between(odometry->travel.from, centre));
  TEST_ASSERT_EQUAL_INT(0, odometry->spread.num_steps);
  TEST_ASSERT_TRUE(tv::is_spreading(*odometry));
  for (int i = 0; i < 10; ++i) {
    if (tv::is_spreading(*odometry)) tv::step_spread(odometry, &frame);
  }
  TEST_ASSERT_FALSE(tv::is_spreading(*odometry));
}

void test_finish_takes_all_steps_that_are_left() {
  map_room();
  odometry->reference_id = odometry->map.keyframes[kViews - 1].id;
  odometry->spread = {12, 0, 0, 0, 0};
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
  TEST_ASSERT_FALSE(tv::is_spreading(*odometry));
  TEST_ASSERT_TRUE(worst_position() < 1e-4);
  TEST_ASSERT_TRUE(mean_error() < 0.02);
}

// A frame of another segment may have come meanwhile.
void test_the_points_of_the_loops_segment_are_adjusted() {
  map_room();
  odometry->reference_id = odometry->map.keyframes[kViews - 1].id;
  odometry->segment = 1;
  odometry->spread = {12, 0, 0, 0, 0};
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
  TEST_ASSERT_TRUE(mean_error() < 0.02);
}

void test_small_corrections_are_not_spread() {
  add_keyframes();
  tv::LoopEnd end = {0, tv::kIdentity, 1};
  end.cam_from_world.t[0] = -1.901;  // it was at 1.9
  const tv::Frame nothing{};
  tv::close_loop(odometry, kNum - 1, nothing, end);
  TEST_ASSERT_FALSE(tv::is_spreading(*odometry));
  end.cam_from_world.t[0] = -1.93;
  odometry->is_found_again = true;
  tv::close_loop(odometry, kNum - 1, nothing, end);
  TEST_ASSERT_TRUE(odometry->spread.num_steps > 0);
  TEST_ASSERT_FALSE(odometry->is_found_again);
}

// A loop's steps adjust the newest hundred keyframes, and all since the loop before.
void test_keyframes_from_before_the_last_loop_are_held() {
  tv::LoopEnd end = {0, tv::kIdentity, 1};
  end.cam_from_world.t[0] = 5;
  const tv::Frame nothing{};
  const int32_t* const num = &odometry->map.num_keyframes;
  const tv::MapKeyframe* const keyframes = odometry->map.keyframes;
  for (int i = 0; i < 6; ++i) add_keyframes();
  tv::close_loop(odometry, *num - 1, nothing, end);
  TEST_ASSERT_EQUAL_INT(0, odometry->spread.first_id);
  TEST_ASSERT_EQUAL_INT(keyframes[*num - 1].id, odometry->spread.last_id);
  const int32_t last_id = odometry->spread.last_id;
  add_keyframes();
  end.cam_from_world.t[0] = 10;
  tv::close_loop(odometry, *num - 1, nothing, end);
  TEST_ASSERT_EQUAL_INT(keyframes[*num - 100].id, odometry->spread.first_id);
  TEST_ASSERT_TRUE(odometry->spread.first_id > 0 && odometry->spread.first_id < last_id);
  // Another segment's loop says nothing of this one's keyframes.
  odometry->spread.segment = 1;
  end.cam_from_world.t[0] = 15;
  tv::close_loop(odometry, *num - 1, nothing, end);
  TEST_ASSERT_EQUAL_INT(0, odometry->spread.first_id);
  // The loop before is farther back than a hundred keyframes.
  odometry->spread.last_id = keyframes[7].id;
  end.cam_from_world.t[0] = 20;
  tv::close_loop(odometry, *num - 1, nothing, end);
  TEST_ASSERT_EQUAL_INT(keyframes[7].id, odometry->spread.first_id);
}

void test_few_points_close_a_loop_only_twice() {
  odometry->median_depth = 2;
  tv::Frame frame{};
  frame.number = 100;
  frame.cam_from_world = tv::kIdentity;
  tv::LoopEnd end = {0, tv::kIdentity, 1.1};
  end.cam_from_world.t[0] = 0.3;
  TEST_ASSERT_FALSE(tv::is_seen_twice(odometry, frame, end));
  // The camera moves by 0.1, which is 0.11 beside the loop's end.
  frame.number = 104;
  frame.cam_from_world.t[2] = -0.1;
  end.cam_from_world.t[2] = -0.11;
  TEST_ASSERT_TRUE(tv::is_seen_twice(odometry, frame, end));
  end.cam_from_world.t[0] = 0.37;  // 3.5 % of the median depth farther
  TEST_ASSERT_FALSE(tv::is_seen_twice(odometry, frame, end));
  TEST_ASSERT_TRUE(tv::is_seen_twice(odometry, frame, end));
  end.cam_from_world = tv::compose(turned(0.02), end.cam_from_world);
  TEST_ASSERT_FALSE(tv::is_seen_twice(odometry, frame, end));
  frame.number = 120;
  TEST_ASSERT_FALSE(tv::is_seen_twice(odometry, frame, end));
}

void test_a_gross_correction_closes_a_loop_only_twice() {
  add_keyframes();
  odometry->median_depth = 2;
  tv::Frame frame{};
  frame.number = 100;
  frame.cam_from_world = tv::kIdentity;
  tv::LoopEnd end = {0, tv::kIdentity, 1};
  end.cam_from_world.t[0] = 0.19;
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  end.cam_from_world.t[0] = 0.21;  // more than a tenth of the median depth
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  end.cam_from_world = turned(0.06);
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  // Where the world of another segment lies says nothing, but attitudes give both the same axes.
  odometry->segment = 1;
  end.cam_from_world = turned(0.5);
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  odometry->is_upright = true;
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 5, 50, 60, end));
  end.cam_from_world = turned(0.3);
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 5, 50, 60, end));
}

// Wallpaper that repeats: flight 12 closed a loop that turned by 0.22 radians after five median
// depths. Of 450 right loops between upright keyframes none turned by more than 0.02.
void test_drift_explains_a_loop_only_within_bounds() {
  add_keyframes();
  odometry->median_depth = 2;
  tv::Frame frame{};
  frame.cam_from_world = tv::kIdentity;
  tv::LoopEnd end = {0, turned(0.22), 1};
  // After 10 m: 0.05 x 10 + 0.15 x 2 = 0.8 m or, upright, 0.2 x 0.8 / 2 = 0.08 radians.
  TEST_ASSERT_TRUE(tv::is_plausible(*odometry, frame, 10, end));
  odometry->is_upright = true;
  TEST_ASSERT_FALSE(tv::is_plausible(*odometry, frame, 10, end));
  // A lost frame may have been found at a wrong place, which only a loop puts right.
  odometry->is_found_again = true;
  TEST_ASSERT_TRUE(tv::is_plausible(*odometry, frame, 10, end));
  odometry->is_found_again = false;
  end.cam_from_world = turned(0.079);
  TEST_ASSERT_TRUE(tv::is_plausible(*odometry, frame, 10, end));
  TEST_ASSERT_FALSE(tv::is_plausible(*odometry, frame, 9, end));
  end.cam_from_world = tv::kIdentity;
  end.cam_from_world.t[0] = 0.79;
  TEST_ASSERT_TRUE(tv::is_plausible(*odometry, frame, 10, end));
  end.cam_from_world.t[0] = 0.81;
  TEST_ASSERT_FALSE(tv::is_plausible(*odometry, frame, 10, end));
  end.cam_from_world.t[0] = 0;
  for (const double scale : {0.68, 1.51, 0.0, -1.0, std::nan("")}) {
    end.scale = scale;
    TEST_ASSERT_FALSE(tv::is_plausible(*odometry, frame, 10, end));
  }
  end.scale = 0.7;
  TEST_ASSERT_TRUE(tv::is_plausible(*odometry, frame, 10, end));
  // Another segment has coordinates of its own, so its distance does not make a loop implausible.
  odometry->segment = 1;
  end.cam_from_world = turned(1);
  TEST_ASSERT_TRUE(tv::is_plausible(*odometry, frame, 10, end));
}

void test_few_points_join_upright_segments_only_twice() {
  add_keyframes();
  odometry->median_depth = 2;
  tv::Frame frame{};
  frame.number = 100;
  frame.cam_from_world = tv::kIdentity;
  const tv::LoopEnd end = {0, tv::kIdentity, 1};
  // Within a segment, after a long path.
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 7.9, 30, 40, end));
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 7.9, 30, 40, end));
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 8, 30, 40, end));
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 8, 30, 41, end));
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 8, 30, 40, end));
  odometry->segment = 1;
  odometry->weak_loop.frame = -1;
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 0, 30, 40, end));
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 0, 30, 40, end));
  odometry->is_upright = true;
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 0, 30, 44, end));
  TEST_ASSERT_FALSE(tv::is_believed(odometry, frame, 0, 30, 45, end));
  TEST_ASSERT_TRUE(tv::is_believed(odometry, frame, 0, 30, 44, end));
}

// 19 keyframes before it, the path is 1.9 long: 3 % of it are 0.057.
void test_a_large_correction_is_a_jump() {
  const double ways[] = {0.05, 0.07, 0, 0}, turns[] = {0, 0, 0.04, 0.06};
  for (int k = 0; k < 4; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
    odometry->median_depth = 1;
    odometry->drift_sq = 1;
    add_keyframes();
    tv::LoopEnd end = {0, odometry->map.keyframes[kNum - 1].cam_from_world, 1};
    end.cam_from_world = tv::compose(turned(turns[k]), end.cam_from_world);
    end.cam_from_world.t[2] += ways[k];
    const tv::Frame nothing{};
    TEST_ASSERT_EQUAL(k % 2 != 0, tv::close_loop(odometry, kNum - 1, nothing, end));
    TEST_ASSERT_EQUAL_DOUBLE(0, odometry->drift_sq);
  }
}

}  // namespace

extern "C" void setUp(void) {
  const tv_camera camera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {0}};
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  options.max_keypoints = 100;
  options.max_keyframes = 8 * kNum;
  options.max_points = 2000;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_odometry_init(&odometry, &camera, &options, memory, sizeof memory));
  invent_room(1);
}

extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_drift_explains_a_loop_only_within_bounds);
  RUN_TEST(test_a_way_across_a_loss_says_nothing_of_the_scale);
  RUN_TEST(test_contrary_ways_count_where_they_say_more_than_the_others);
  RUN_TEST(test_the_metre_keeps_its_length_when_a_loop_stretches_the_path);
  RUN_TEST(test_the_metre_goes_with_a_segment_that_joins_another_one);
  RUN_TEST(test_a_large_correction_is_a_jump);
  RUN_TEST(test_a_way_goes_on_over_a_keyframe_that_is_removed);
  RUN_TEST(test_all_keyframes_of_a_segment_are_adjusted_together);
  RUN_TEST(test_keyframes_are_adjusted_in_any_order);
  RUN_TEST(test_older_keyframes_are_held);
  RUN_TEST(test_the_metre_is_that_of_the_ways_as_they_are);
  RUN_TEST(test_the_first_keyframe_of_an_upright_segment_finds_its_place);
  RUN_TEST(test_a_frame_and_the_measured_way_move_with_their_keyframe);
  RUN_TEST(test_finish_takes_all_steps_that_are_left);
  RUN_TEST(test_the_points_of_the_loops_segment_are_adjusted);
  RUN_TEST(test_small_corrections_are_not_spread);
  RUN_TEST(test_keyframes_from_before_the_last_loop_are_held);
  RUN_TEST(test_few_points_close_a_loop_only_twice);
  RUN_TEST(test_a_gross_correction_closes_a_loop_only_twice);
  RUN_TEST(test_few_points_join_upright_segments_only_twice);
  return UNITY_END();
}
