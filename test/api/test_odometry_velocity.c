/* Tests of the odometry with velocities and heights: they give the metre, contradict each other,
   and velocities contradict a map that is carried away. It flies through the room of
   support/room_scene.h. */
#include <math.h>

#include "support/api.h"
#include "support/room_scene.h"
#include "twoview/odometry.h"

enum { MEMORY = 12 << 20, LEARNT = 60 };

static const double RIGHT[3] = {1, 1, 1}, REVERSED[3] = {-1, -1, -1}, SIDEWAYS[3] = {0.1, 1, 8};
static tv_odometry_frame frame;
static tv_odometry_state state;
static tv_odometry *odometry;
static _Alignas(64) uint8_t block[MEMORY];
static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];

static void centre_at(int n, double centre[3]) { /* of room_flight */
  centre[0] = 0.9 * sin(0.07 * n) - 0.3, centre[1] = 0.15 * sin(0.11 * n);
  centre[2] = 0.3 * sin(0.05 * n);
}

/* Shows a picture of the flight; another room is this one upside down. */
static void show(int n, int is_another_room) {
  int k;
  room_flight(n, pixels);
  for (k = 0; is_another_room && k < ROOM_WIDTH * ROOM_HEIGHT / 2; ++k) {
    const uint8_t upper = pixels[k];
    const int below = (ROOM_HEIGHT - 1 - k / ROOM_WIDTH) * ROOM_WIDTH + k % ROOM_WIDTH;
    pixels[k] = pixels[below], pixels[below] = upper;
  }
  frame.time_s = n / 30.0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
}

/* The camera's true velocity at frame n, in its axes, each component times a factor. */
static void measure_velocity(int n, const double factors[3]) {
  const double yaw = 0.12 * sin(0.06 * n), c = cos(yaw), s = sin(yaw);
  double here[3], before[3], v[3];
  int k;
  centre_at(n, here), centre_at(n - 1, before);
  for (k = 0; k < 3; ++k) v[k] = 30 * (here[k] - before[k]);
  frame.velocity_m_s[0] = factors[0] * (c * v[0] - s * v[2]);
  frame.velocity_m_s[1] = factors[1] * v[1];
  frame.velocity_m_s[2] = factors[2] * (s * v[0] + c * v[2]);
  frame.velocity_sigma_m_s = 0.02;
}

/* The frame with the camera's true velocity, each component times a factor. */
static void give_of(int n, const double factors[3], int is_another_room) {
  measure_velocity(n, factors);
  show(n, is_another_room);
}

static void give(int n, const double factors[3]) { give_of(n, factors, 0); }

static int is_contrary(void) { return (state.reasons & TV_REASON_SECOND_MOTION) != 0; }

void setUp(void) {
  const tv_camera camera = room_camera();
  tv_odometry_options options;
  size_t size;
  tv_odometry_options_init(&options);
  options.max_keypoints = 400;
  options.max_keyframes = 40;
  options.max_points = 2000;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_size(&camera, &options, &size));
  TEST_ASSERT_TRUE(size <= MEMORY);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&odometry, &camera, &options, block, size));
  tv_odometry_frame_init(&frame);
  frame.image = api_image(pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH);
  tv_odometry_state_init(&state);
}

void tearDown(void) {}

/* Flies with right velocities to a frame that is no keyframe, since a keyframe says what it adds to
   the scale at the next frame; returns the number of the next frame. */
static int learn(void) {
  int n;
  for (n = 0; n < LEARNT || state.is_keyframe; ++n) {
    give(n, RIGHT);
    TEST_ASSERT_FALSE(is_contrary());
  }
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_VELOCITY, state.scale_source);
  return n;
}

static void test_right_velocities_give_the_metre(void) {
  double first[3], last[3], truth = 0, way = 0;
  const int begin = learn();
  int n, k;
  for (k = 0; k < 3; ++k) first[k] = state.world_from_cam_t[k];
  for (n = begin; n < begin + 15; ++n) give(n, RIGHT);
  for (k = 0; k < 3; ++k) way += pow(state.world_from_cam_t[k] - first[k], 2);
  centre_at(begin - 1, first), centre_at(n - 1, last);
  for (k = 0; k < 3; ++k) truth += pow(last[k] - first[k], 2);
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * sqrt(truth), sqrt(truth), sqrt(way));
}

/* A map that follows something that moves: to it, the camera flies another way than it does. */
static void expect_lost_after_learning(const double factors[3]) {
  const int begin = learn();
  int n, num_weak = 0;
  for (n = begin; state.status != TV_ODOMETRY_LOST && n < begin + 10; ++n) {
    give(n, factors);
    num_weak += state.status == TV_ODOMETRY_WEAK && is_contrary();
  }
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, state.status);
  TEST_ASSERT_FALSE(state.has_pose);
  TEST_ASSERT_EQUAL_INT(4, num_weak);
  /* The map from before is found again, and is in metres. */
  for (; state.status != TV_ODOMETRY_TRACKING && n < begin + 40; ++n) give(n, RIGHT);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  TEST_ASSERT_EQUAL_INT(1, state.num_relocations);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_VELOCITY, state.scale_source);
}

static void test_velocities_that_were_right_contradict_the_map(void) {
  expect_lost_after_learning(REVERSED);
}

static void test_another_direction_contradicts_the_map(void) {
  expect_lost_after_learning(SIDEWAYS);
}

/* Nothing is removed because of velocities that never agreed, and they give no scale. */
static void test_velocities_that_were_never_right_are_not_believed(void) {
  int n, num_weak = 0;
  for (n = 0; n < LEARNT; ++n) {
    give(n, REVERSED);
    num_weak += is_contrary();
    TEST_ASSERT_TRUE(n <= 20 || state.has_pose);
  }
  TEST_ASSERT_TRUE(num_weak > 20);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_UNIT, state.scale_source);
}

/* Velocities that turn wrong for good are believed a few times, since a person who carries the map
   away may stay for some seconds. */
static void test_wrong_velocities_are_not_believed_for_ever(void) {
  const int begin = learn();
  int n, num_lost = 0, num_removals = 0, was_lost = 0;
  for (n = begin; n < begin + 120; ++n) {
    give(n, REVERSED);
    num_removals += state.status == TV_ODOMETRY_LOST && !was_lost;
    was_lost = state.status == TV_ODOMETRY_LOST;
    num_lost += was_lost;
  }
  TEST_ASSERT_TRUE(num_removals >= 3 && num_removals <= 6);
  TEST_ASSERT_TRUE(state.has_pose && num_lost <= 12);
  TEST_ASSERT_TRUE(is_contrary());
}

/* Without a velocity. */
static void give_picture(int n, int is_another_room) {
  frame.velocity_sigma_m_s = 0;
  show(n, is_another_room);
}

static void test_a_gap_in_the_velocities_contradicts_nothing(void) {
  const int begin = learn();
  int n;
  for (n = begin; n < begin + 10; ++n) {
    give_picture(n, 0);
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  }
}

static void test_the_metre_is_known_again_after_another_segment(void) {
  const int begin = learn();
  const double sigma = state.scale_sigma;
  int n;
  for (n = begin; n < begin + 30; ++n) give_picture(n, 1);
  TEST_ASSERT_EQUAL_INT(2, state.num_segments);
  TEST_ASSERT_EQUAL_INT(1, state.segment);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_UNIT, state.scale_source);
  for (; n < begin + 60 && state.segment != 0; ++n) give_picture(n, 0);
  TEST_ASSERT_EQUAL_INT(0, state.segment);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_VELOCITY, state.scale_source);
  TEST_ASSERT_EQUAL_DOUBLE(sigma, state.scale_sigma);
}

/* A segment that velocities contradict before it is in metres was wrong from its start. */
static void test_a_segment_that_never_agreed_is_removed(void) {
  const int begin = learn(), num_keyframes = state.num_keyframes;
  tv_odometry_state of_removed;
  double R[9], t[3];
  int32_t segment;
  int n;
  for (n = begin; state.segment != 1 && n < begin + 30; ++n) give_of(n, REVERSED, 1);
  TEST_ASSERT_EQUAL_INT(1, state.segment);
  TEST_ASSERT_TRUE(state.num_keyframes > num_keyframes);
  of_removed = state;
  for (; state.status != TV_ODOMETRY_LOST && n < begin + 60; ++n) give_of(n, REVERSED, 1);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, state.status);
  TEST_ASSERT_TRUE(is_contrary());
  TEST_ASSERT_EQUAL_INT(num_keyframes, state.num_keyframes);
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_ARGUMENT,
      tv_odometry_pose_of(odometry, of_removed.reference_id, of_removed.reference_from_cam_R,
                          of_removed.reference_from_cam_t, R, t, &segment));
  /* The map from before is found again, and is in metres. */
  for (; state.status != TV_ODOMETRY_TRACKING && n < begin + 100; ++n) give(n, RIGHT);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  TEST_ASSERT_EQUAL_INT(0, state.segment);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_VELOCITY, state.scale_source);
  /* Another segment may begin, and stay. */
  for (; state.segment != 2 && n < begin + 160; ++n) give_of(n, RIGHT, 1);
  TEST_ASSERT_EQUAL_INT(2, state.segment);
}

/* The frame with an attitude, the height times a factor, and the velocity of an earlier frame times
   another one. */
static void give_both(int n, double height_factor, double velocity_factor, int num_late) {
  static const double level[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
  const double factors[3] = {velocity_factor, velocity_factor, velocity_factor};
  double centre[3];
  memcpy(frame.world_from_cam, level, sizeof level);
  frame.attitude_sigma_rad = 0.02;
  centre_at(n, centre); /* y is down */
  frame.height_m = 1.5 - height_factor * centre[1];
  frame.height_sigma_m = 0.01;
  measure_velocity(n - num_late, factors);
  show(n, 0);
}

enum { BOTH = 100, BOTH_LEVEL = 86 }; /* at which the height is that of the start */

static void test_heights_and_velocities_that_agree_give_the_metre(void) {
  int n;
  for (n = 0; n < BOTH; ++n) {
    give_both(n, 1, 1, 0);
    TEST_ASSERT_EQUAL_INT32(0, state.scale_contradicted);
  }
  TEST_ASSERT_EQUAL_INT(TV_SCALE_HEIGHT_AND_VELOCITY, state.scale_source);
  TEST_ASSERT_TRUE(state.scale_sigma >= 0.01 && state.scale_sigma < 0.03);
  TEST_ASSERT_DOUBLE_WITHIN(3 * state.height_scale_sigma, 1, state.height_scale);
  TEST_ASSERT_DOUBLE_WITHIN(3 * state.velocity_scale_sigma + 0.01, 1, state.velocity_scale);
}

/* Of two sensors one has another unit or sign. There is no metre, and never a number between them;
   each one's own number is in the state. A height of the other sign is that of a depth. Velocities
   of the other sign contradict the map itself, way by way, but ways that are left out are no
   outliers where they are most of them. */
static void test_heights_and_velocities_that_contradict_give_no_metre(void) {
  static const double heights[8] = {1000, 100, 2, 0.01, -1, 1, 1, 1};
  static const double velocities[8] = {1, 1, 1, 1, 1, 2, -1, -1000};
  int k, n;
  for (k = 0; k < 8; ++k) {
    if (k > 0) setUp();
    for (n = 0; n < BOTH; ++n) give_both(n, heights[k], velocities[k], 0);
    TEST_ASSERT_TRUE(state.has_pose);
    TEST_ASSERT_EQUAL_INT(TV_SCALE_UNIT, state.scale_source);
    TEST_ASSERT_EQUAL_DOUBLE(0, state.scale_sigma);
    TEST_ASSERT_EQUAL_INT32(1, state.scale_contradicted);
    TEST_ASSERT_DOUBLE_WITHIN(
        0.2, 1, state.height_scale / state.velocity_scale * velocities[k] / heights[k]);
  }
}

/* A map in metres is no longer in metres when the contradiction comes, and does not change to and
   fro; its lengths stay as they are. */
static void test_a_contradiction_stays_until_the_sensors_agree(void) {
  int n, num_changes = 0, was = 1;
  double before[3], after[3];
  for (n = 0; n < BOTH_LEVEL; ++n) give_both(n, 1, 1, 0);
  TEST_ASSERT_EQUAL_INT(TV_SCALE_HEIGHT_AND_VELOCITY, state.scale_source);
  memcpy(before, state.world_from_cam_t, sizeof before);
  for (; n < 2 * BOTH; ++n) {
    give_both(n, 4, 1, 0);
    num_changes += was != (state.scale_source != TV_SCALE_UNIT);
    was = state.scale_source != TV_SCALE_UNIT;
    if (n == BOTH_LEVEL) memcpy(after, state.world_from_cam_t, sizeof after);
  }
  TEST_ASSERT_EQUAL_INT(1, num_changes);
  TEST_ASSERT_EQUAL_INT32(1, state.scale_contradicted);
  TEST_ASSERT_DOUBLE_WITHIN(0.1, before[0], after[0]);
}

/* Velocities that come late do not have the map's directions: the metre is as uncertain as that
   makes it, or there is none. */
static void test_late_velocities_make_the_metre_uncertain(void) {
  double here[3], there[3], truth = 0, way = 0, from[3];
  int n, k;
  for (n = 0; n < BOTH; ++n) {
    give_both(n, 1, 1, 9);
    if (n == BOTH - 12) memcpy(from, state.world_from_cam_t, sizeof from);
  }
  centre_at(n - 1, here), centre_at(BOTH - 12, there);
  for (k = 0; k < 3; ++k) truth += pow(here[k] - there[k], 2);
  for (k = 0; k < 3; ++k) way += pow(state.world_from_cam_t[k] - from[k], 2);
  TEST_ASSERT_TRUE(state.scale_source == TV_SCALE_UNIT ||
                   fabs(sqrt(way / truth) - 1) < 3 * state.scale_sigma);
  TEST_ASSERT_TRUE(state.velocity_scale_sigma > 0.05);
}

/* A map keeps what is known of its scale, and a contradiction leaves nothing that is known. */
static void test_a_map_keeps_its_scale_but_no_contradiction(void) {
  static uint8_t bytes[MEMORY], again[MEMORY];
  size_t num = 0, num_again = 0;
  int k, n;
  for (k = 0; k < 2; ++k) {
    if (k > 0) setUp();
    for (n = 0; n < BOTH; ++n) give_both(n, k == 0 ? 1 : 3, 1, 0);
    TEST_ASSERT_EQUAL_INT32(k, state.scale_contradicted);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save(odometry, bytes, MEMORY, &num));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_load(odometry, bytes, num));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save(odometry, again, MEMORY, &num_again));
    TEST_ASSERT_EQUAL_UINT64(num, num_again);
    TEST_ASSERT_EQUAL_MEMORY(bytes + 16, again + 16, 208 - 16); /* to the scale's end */
    frame.height_sigma_m = frame.velocity_sigma_m_s = 0;
    frame.gap = 1;
    show(n - 1, 0);
    frame.gap = 0;
    TEST_ASSERT_EQUAL_INT(k == 0 ? TV_SCALE_HEIGHT_AND_VELOCITY : TV_SCALE_UNIT,
                          state.scale_source);
    TEST_ASSERT_EQUAL_INT32(0, state.scale_contradicted);
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_heights_and_velocities_that_agree_give_the_metre);
  RUN_TEST(test_heights_and_velocities_that_contradict_give_no_metre);
  RUN_TEST(test_a_contradiction_stays_until_the_sensors_agree);
  RUN_TEST(test_late_velocities_make_the_metre_uncertain);
  RUN_TEST(test_a_map_keeps_its_scale_but_no_contradiction);
  RUN_TEST(test_right_velocities_give_the_metre);
  RUN_TEST(test_velocities_that_were_right_contradict_the_map);
  RUN_TEST(test_another_direction_contradicts_the_map);
  RUN_TEST(test_velocities_that_were_never_right_are_not_believed);
  RUN_TEST(test_wrong_velocities_are_not_believed_for_ever);
  RUN_TEST(test_a_gap_in_the_velocities_contradicts_nothing);
  RUN_TEST(test_the_metre_is_known_again_after_another_segment);
  RUN_TEST(test_a_segment_that_never_agreed_is_removed);
  return UNITY_END();
}
