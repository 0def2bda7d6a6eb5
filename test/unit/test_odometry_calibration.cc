// When and how the odometry moves the principal point (odometry/move_principal_point.h,
// docs/algorithms/odometry.md, "The camera's principal point").

#include "odometry/move_principal_point.h"

#include <unity.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "odometry/loop_closure.h"
#include "odometry/map_check.h"
#include "odometry/spread.h"
#include "support/odometry_flight.h"
#include "support/random.h"

namespace {

alignas(64) uint8_t memory[24 << 20], other_memory[24 << 20];
uint8_t map[4 << 20], again[4 << 20];
tv_odometry* odometry;
uint64_t random_state = 51;

double uniform(double low, double high) { return low + (high - low) * random_unit(&random_state); }

struct Asked {
  double px[2], covariance[3];
};

// With standard deviations of about 1 px: much information.
Asked asked_near(double x, double y, double reach_px) {
  const double xx = uniform(0.5, 2), yy = uniform(0.5, 2);
  return {{x + uniform(-reach_px, reach_px), y + uniform(-reach_px, reach_px)},
          {xx, uniform(-0.5, 0.5) * std::sqrt(xx * yy), yy}};
}

void add(const Asked& asked) {
  tv_evidence of_pair;
  tv_evidence_init(&of_pair);
  std::memcpy(of_pair.principal_point_asked_px, asked.px, sizeof asked.px);
  std::memcpy(of_pair.principal_point_asked_covariance, asked.covariance, sizeof asked.covariance);
  tv::add_evidence(of_pair, odometry->camera.model.fx, &odometry->camera_evidence);
}

// By how far the next call moves the principal point.
void correct(double shift_px[2]) {
  const double before[2] = {odometry->camera.model.cx, odometry->camera.model.cy};
  tv::correct_camera(odometry, &odometry->frame);
  shift_px[0] = odometry->camera.model.cx - before[0];
  shift_px[1] = odometry->camera.model.cy - before[1];
}

void expect_kept() {
  double shift[2];
  correct(shift);
  TEST_ASSERT_TRUE(shift[0] == 0 && shift[1] == 0);
}

// The weighted mean, by minimising sum (a - m)' C^-1 (a - m): the gradient there is 0.
void test_the_point_moves_to_the_weighted_mean_of_what_pairs_ask_for() {
  Asked asked[6];
  double shift[2], gradient[2] = {0, 0}, size = 0;
  for (int k = 0; k < 6; ++k) {
    expect_kept();  // of fewer than six pairs
    add(asked[k] = asked_near(6, -4, 1));
  }
  correct(shift);
  TEST_ASSERT_DOUBLE_WITHIN(1, 6, shift[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1, -4, shift[1]);
  for (int k = 0; k < 6; ++k) {
    const double* C = asked[k].covariance;
    const double x = shift[0] - asked[k].px[0], y = shift[1] - asked[k].px[1];
    const double det = C[0] * C[2] - C[1] * C[1];
    gradient[0] += (C[2] * x - C[1] * y) / det;
    gradient[1] += (C[0] * y - C[1] * x) / det;
    size += (C[2] + C[0]) / det;
  }
  TEST_ASSERT_DOUBLE_WITHIN(1e-12 * size, 0, gradient[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12 * size, 0, gradient[1]);
}

// What the pairs before the move asked for is met: those after it ask for 2 px more, and are as
// many.
void test_it_moves_again_when_twice_as_many_pairs_have_been_seen() {
  double shift[2];
  for (int k = 0; k < 6; ++k) add({{6, -4}, {1, 0, 1}});
  correct(shift);
  for (int k = 0; k < 6; ++k) {
    expect_kept();
    add({{2, 0}, {1, 0, 1}});
  }
  correct(shift);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1, shift[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, shift[1]);
}

void test_it_is_kept_where_the_evidence_is_weak() {
  // Six pairs that ask for the same 1 px with a sigma of 0.36 have a chi-square of 46, of 0.33, 55.
  for (const double sigma : {0.36, 0.33}) {
    tv::start_anew(odometry);
    for (int k = 0; k < 6; ++k) add({{1, 0}, {sigma * sigma, 0, sigma * sigma}});
    double shift[2];
    correct(shift);
    TEST_ASSERT_EQUAL_DOUBLE(sigma > 0.35 ? 0 : 1, std::round(shift[0]));
  }
  // Pairs that contradict each other by six sigmas.
  tv::start_anew(odometry);
  for (int k = 0; k < 12; ++k) add({{k % 2 == 0 ? 9.0 : -3.0, k % 3 * 6.0 - 6}, {1, 0, 1}});
  expect_kept();
  // Two hundred pairs, of which each asks for half its sigma: a chi-square of 50 of a small bias.
  tv::start_anew(odometry);
  for (int k = 0; k < 204; ++k) {
    add({{0.5, 0}, {1, 0, 1}});
    expect_kept();
  }
}

void test_pairs_that_say_little_or_ask_for_much_are_no_evidence() {
  const double fx = odometry->camera.model.fx, wide = 0.0201 * fx, nan = std::nan("");
  for (int k = 0; k < 12; ++k) {
    add({{6, -4}, {wide * wide / 2, 0, wide * wide / 2}});
    add({{0.0501 * fx, 0}, {1, 0, 1}});
    add({{6, -4}, {0, 0, 0}});  // as of a pair without evidence
    add({{6, -4}, {nan, 0, 1}});
    add({{nan, -4}, {1, 0, 1}});
  }
  TEST_ASSERT_EQUAL_INT32(0, odometry->camera_evidence.num_pairs);
  expect_kept();
}

// In two steps of 4 per cent of the focal length: the second one would lead farther than 5.
void test_it_is_not_moved_far_from_where_it_was_given() {
  const double asked = 0.04 * odometry->camera.model.fx;
  double shift[2];
  for (int k = 0; k < 6; ++k) add({{asked, 0}, {1, 0, 1}});
  correct(shift);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, asked, shift[0]);
  for (int k = 0; k < 30; ++k) {
    add({{asked, 0}, {1, 0, 1}});
    expect_kept();
  }
}

// The largest distance between the images of the map's points in its keyframes before and after, of
// those within `reach` focal lengths of the middle.
double largest_change(const tv_odometry* o, const tv_camera& before, const tv::Rigid* poses,
                      double reach) {
  const tv::Map& m = o->map;
  double largest = 0;
  for (int32_t k = 0; k < m.num_keyframes; ++k) {
    const int32_t* seen = tv::seen_by(m, m.keyframes[k]);
    for (int32_t i = 0; i < m.keyframes[k].num_keypoints; ++i) {
      if (seen[i] == tv::kNoPoint) continue;
      double x[3], first[2], second[2];
      tv::transform(poses[k], m.points[seen[i]].position, x);
      if (std::hypot(x[0], x[1]) > reach * x[2]) continue;
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&before, x, first, nullptr));
      tv::transform(m.keyframes[k].cam_from_world, m.points[seen[i]].position, x);
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&o->camera.model, x, second, nullptr));
      largest = std::fmax(largest, std::hypot(first[0] - second[0], first[1] - second[1]));
    }
  }
  return largest;
}

struct Centre {
  double x[3];
};

Centre centre_at(int n) {
  return {{0.9 * std::sin(0.07 * n) - 0.3, 0.15 * std::sin(0.11 * n), 0.3 * std::sin(0.05 * n)}};
}

tv_camera wrong_camera() {
  tv_camera camera = room_camera();
  camera.cx += 8;
  camera.cy -= 6;
  return camera;
}

constexpr uint32_t kRefine[2] = {TV_REFINE_NOTHING, TV_REFINE_PRINCIPAL_POINT};

tv_odometry* begin_flight_of(const tv_camera& camera, uint32_t refine, uint8_t* where) {
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  options.refine = refine;
  tv_odometry* made = nullptr;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&made, &camera, &options, where, sizeof memory));
  return made;
}

size_t save(const tv_odometry* o, uint8_t* bytes) {
  size_t num = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save(o, bytes, sizeof map, &num));
  return num;
}

// Gives the odometry frame n of a flight that turns by up to 40 degrees from its middle.
void fly(tv_odometry* o, int n, tv_odometry_state* state, double middle_rad = 0) {
  static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];
  room_draw(centre_at(n).x, middle_rad + 0.7 * std::sin(0.035 * n), pixels);
  tv_odometry_frame frame;
  tv_odometry_frame_init(&frame);
  frame.image = {pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
  frame.time_s = n / 30.0;
  tv_odometry_state_init(state);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(o, &frame, state));
}

// A shift of d and a turn of d / f differ by d times the squared distance from the middle in focal
// lengths.
void test_keyframes_see_their_points_where_they_saw_them() {
  tv_odometry_state state;
  for (int n = 0; n < 60; ++n) fly(odometry, n, &state);
  const tv_camera before = odometry->camera.model;
  static tv::Rigid poses[200];
  const int32_t num = odometry->map.num_keyframes;
  TEST_ASSERT_TRUE(num > 3);
  for (int32_t k = 0; k < num; ++k) poses[k] = odometry->map.keyframes[k].cam_from_world;
  const double from[2] = {before.cx, before.cy}, to[2] = {before.cx + 5, before.cy - 3};
  const tv::Rigid turn = tv::move_principal_point(odometry, to, from, 0);
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, std::hypot(5, 3) / before.fx, tv::rotation_angle(turn));
  TEST_ASSERT_TRUE(largest_change(odometry, before, poses, 0.1) < 0.12);
  TEST_ASSERT_TRUE(largest_change(odometry, before, poses, 10) < 5);
  for (int32_t k = 0; k < num; ++k) {
    TEST_ASSERT_TRUE(tv::way_between(poses[k], odometry->map.keyframes[k].cam_from_world) < 1e-12);
  }
}

// That a map keeps the camera that it was made with, that a reset forgets it, and that a map which
// is added is turned into the camera of the one that is there.
void expect_map_keeps_camera() {
  const tv_camera given = wrong_camera(), used = odometry->camera.model;
  tv_camera loaded;
  const size_t num = save(odometry, map);
  tv_odometry* second = begin_flight_of(given, TV_REFINE_PRINCIPAL_POINT, other_memory);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_load(second, map, num));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_camera(second, &loaded));
  TEST_ASSERT_EQUAL_MEMORY(&used, &loaded, sizeof used);
  TEST_ASSERT_EQUAL_UINT64(num, save(second, again));
  TEST_ASSERT_EQUAL_MEMORY(map, again, num);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(second));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_camera(second, &loaded));
  TEST_ASSERT_EQUAL_MEMORY(&given, &loaded, sizeof given);
  for (int n = 0; second->map.num_keyframes == 0; ++n) {  // of the wall behind, which meets nothing
    tv_odometry_state state;
    fly(second, n, &state, 3.14);
    TEST_ASSERT_TRUE(n < 60);
  }
  const int32_t first = second->map.num_keyframes;
  int32_t joined = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(second, map, num, &joined));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_camera(second, &loaded));
  TEST_ASSERT_EQUAL_MEMORY(&given, &loaded, sizeof given);
  TEST_ASSERT_EQUAL_INT32(0, joined);
  const tv::Rigid turn = tv::motion_between(odometry->map.keyframes[0].cam_from_world,
                                            second->map.keyframes[first].cam_from_world);
  // From cx - 8, cy + 6 back to cx, cy: a pixel's ray lies farther to the left and down then.
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, -8 / given.fx, turn.R[2]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, 6 / given.fx, turn.R[5]);
}

// How far the ratio of the map's way from the first to each keyframe over the true one varies, from
// the least to the largest, in shares of the mean.
double spread_of_scale(const tv_odometry* o) {
  double least = 1e9, largest = 0;
  const tv::Map& m = o->map;
  for (int32_t k = 1; k < m.num_keyframes; ++k) {
    const Centre from = centre_at(m.keyframes[0].frame), to = centre_at(m.keyframes[k].frame);
    const double way = tv::distance_between(from.x, to.x);
    if (way < 0.3) continue;
    const double ratio =
        tv::way_between(m.keyframes[0].cam_from_world, m.keyframes[k].cam_from_world) / way;
    least = std::fmin(least, ratio);
    largest = std::fmax(largest, ratio);
  }
  return 2 * (largest - least) / (largest + least);
}

// A camera whose principal point is off by (8, -6) of 260 px: six pairs ask for the right place at
// frame 60.
void test_the_map_is_adjusted_to_the_corrected_camera() {
  double spread[2];
  for (const int corrects : {0, 1}) {
    tv_odometry_state state;
    odometry = begin_flight_of(wrong_camera(), kRefine[corrects], memory);
    for (int n = 0; n < 150; ++n) {
      fly(odometry, n, &state);
      TEST_ASSERT_TRUE(n < 30 || state.has_pose);
      TEST_ASSERT_EQUAL_DOUBLE(corrects && n > 60 ? -8 : 0, state.principal_point_shift_px[0]);
      TEST_ASSERT_EQUAL_DOUBLE(corrects && n > 60 ? 6 : 0, state.principal_point_shift_px[1]);
      TEST_ASSERT_TRUE(n != 61 || tv::is_spreading(*odometry) == (corrects != 0));
      odometry->camera_evidence = tv::CameraEvidence{};  // what the flight's own pairs ask for
      for (int k = 0; corrects && n == 60 && k < 6; ++k) add({{-8, 6}, {1, 0, 1}});
    }
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
    TEST_ASSERT_EQUAL_INT(1, state.num_segments);
    spread[corrects] = spread_of_scale(odometry);
  }
  TEST_ASSERT_TRUE(spread[1] < 0.5 * spread[0]);
  expect_map_keeps_camera();
}

// Matches of a scene as a camera sees it whose principal point is at another place, of pairs that
// turn: the vote on each adds to the evidence.
void test_pairs_that_check_the_map_are_evidence() {
  constexpr int kNum = 400;
  static tv_keypoint keypoints[2][kNum];
  static tv_correspondence matches[kNum];
  for (const int corrects : {0, 1}) {
    tv_camera given = room_camera();
    odometry = begin_flight_of(given, kRefine[corrects], memory);
    for (int pair = 0; pair < 6; ++pair) {
      const double angle = 0.3 + 0.05 * pair, c = std::cos(angle), s = std::sin(angle);
      const tv::Rigid motion = {{c, 0, -s, 0, 1, 0, s, 0, c}, {-0.4, 0.02, 0.05}};
      for (int n = 0; n < kNum; ++n) {
        const double z = uniform(1.5, 4);
        double x[2][3] = {{z * uniform(-0.3, 0.6), z * uniform(-0.4, 0.4), z}};
        tv::transform(motion, x[0], x[1]);
        for (int view = 0; view < 2; ++view) {
          tv_keypoint* k = &keypoints[view][n];
          *k = tv_keypoint{};
          k->x =
              static_cast<float>(260 * x[view][0] / x[view][2] + given.cx - 6 + uniform(-0.2, 0.2));
          k->y =
              static_cast<float>(260 * x[view][1] / x[view][2] + given.cy + 4 + uniform(-0.2, 0.2));
          k->size = tv::kFinestSize;
        }
        matches[n] = tv_correspondence{};
        matches[n].idx0 = matches[n].idx1 = n;
        matches[n].ratio = 0.5f;
      }
      tv::MapVote vote{};
      tv::add_vote(odometry, keypoints[0], keypoints[1], matches, kNum, motion, &vote);
    }
    TEST_ASSERT_EQUAL_INT32(corrects ? 6 : 0, odometry->camera_evidence.num_pairs);
    double shift[2];
    correct(shift);
    TEST_ASSERT_DOUBLE_WITHIN(0.7, corrects ? -6 : 0, shift[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.7, corrects ? 4 : 0, shift[1]);
  }
}

}  // namespace

extern "C" void setUp(void) { odometry = begin_room_flight(memory, sizeof memory); }
extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_the_point_moves_to_the_weighted_mean_of_what_pairs_ask_for);
  RUN_TEST(test_it_moves_again_when_twice_as_many_pairs_have_been_seen);
  RUN_TEST(test_it_is_kept_where_the_evidence_is_weak);
  RUN_TEST(test_pairs_that_say_little_or_ask_for_much_are_no_evidence);
  RUN_TEST(test_it_is_not_moved_far_from_where_it_was_given);
  RUN_TEST(test_keyframes_see_their_points_where_they_saw_them);
  RUN_TEST(test_the_map_is_adjusted_to_the_corrected_camera);
  RUN_TEST(test_pairs_that_check_the_map_are_evidence);
  return UNITY_END();
}
