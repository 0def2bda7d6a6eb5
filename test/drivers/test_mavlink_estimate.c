/* What visual odometry tells an autopilot: poses and velocities by hand, covariances against
   differences, when a message is sent and when not, and the bytes of the packets, which are read
   here by the tables of the MAVLink standard and not by its library. */
#include <math.h>
#include <mavlink.h>
#include <string.h>
#include <unity.h>

#include "twoview_drivers/mavlink/estimate.h"

#define MS INT64_C(1000000)

static const double AHEAD[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
static const double RIGHT = 1.5707963267948966;
static tvm_estimator estimator;
static tvm_estimator_options options;
static tv_odometry_state state;
static tvm_track track;
static tvm_estimate estimate;

void setUp(void) {
  tvm_estimator_options_init(&options);
  /* But in the tests of these. */
  options.drift_share = options.drift_turn_rad = options.filter_memory_s = 0;
  memset(&state, 0, sizeof state);
  state.struct_size = sizeof state;
  state.status = TV_ODOMETRY_TRACKING;
  state.has_pose = 1;
  state.scale_source = TV_SCALE_VELOCITY;
  memcpy(state.world_from_cam_R, AHEAD, sizeof AHEAD);
  memset(&track, 0, sizeof track);
  track.struct_size = sizeof track;
  track.state = &state;
  track.is_upright = 1;
  track.host_ns = 1000 * MS;
  track.time_us = 77000000;
  estimate.struct_size = sizeof estimate;
}
void tearDown(void) {}

static void begin(void) { TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_estimator_init(&estimator, &options)); }

/* The map drifts so; filter_memory_s is how long the filter averages, 0: nothing is counted twice.
 */
static void begin_drifting(double share, double turn_rad, double memory_s) {
  options.drift_share = share;
  options.drift_turn_rad = turn_rad;
  options.filter_memory_s = memory_s;
  begin();
}

static int update(void) {
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_estimator_update(&estimator, &track, &estimate));
  return estimate.silence;
}

/* The next frame, `ms` later. */
static int next(int ms) {
  track.host_ns += ms * MS;
  track.time_us += (uint64_t)(ms * 1000);
  return update();
}

static void multiply(const double *a, const double *b, double *out) {
  int i, j;
  for (i = 0; i < 3; ++i)
    for (j = 0; j < 3; ++j)
      out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

/* Rz(yaw) Ry(pitch) Rx(roll). */
static void rotation(double roll, double pitch, double yaw, double *R) {
  const double cr = cos(roll), sr = sin(roll), cp = cos(pitch), sp = sin(pitch), cy = cos(yaw),
               sy = sin(yaw);
  const double x[9] = {1, 0, 0, 0, cr, -sr, 0, sr, cr}, y[9] = {cp, 0, sp, 0, 1, 0, -sp, 0, cp},
               z[9] = {cy, -sy, 0, sy, cy, 0, 0, 0, 1};
  double zy[9];
  multiply(z, y, zy);
  multiply(zy, x, R);
}

/* The state's pose for a body of this attitude. */
static void set_attitude(double roll, double pitch, double yaw) {
  double R[9];
  rotation(roll, pitch, yaw, R);
  multiply(R, options.body_from_camera, state.world_from_cam_R);
}

static void set_place(double x, double y, double z) {
  state.world_from_cam_t[0] = x;
  state.world_from_cam_t[1] = y;
  state.world_from_cam_t[2] = z;
}

static void set_covariance(double angle, double place) {
  int k;
  memset(state.cam_from_world_covariance, 0, sizeof state.cam_from_world_covariance);
  for (k = 0; k < 3; ++k) {
    state.cam_from_world_covariance[7 * k] = angle * angle;
    state.cam_from_world_covariance[7 * (k + 3)] = place * place;
  }
  state.has_covariance = 1;
}

static void assert_near(const double *expected, const double *got, int count, double most) {
  int k;
  for (k = 0; k < count; ++k) TEST_ASSERT_DOUBLE_WITHIN(most, expected[k], got[k]);
}

/* ---- poses and velocities ---- */

/* The body looks east in a world whose x is north, so what lies ahead of it lies along y. */
static void test_the_pose_is_that_of_the_body(void) {
  const double place[3] = {1, 2 - 0.1, -3 - 0.05},
               turn[4] = {0.70710678118654752, 0, 0, 0.70710678118654752};
  options.camera_in_body[0] = 0.1;
  options.camera_in_body[2] = 0.05;
  begin();
  set_attitude(0, 0, RIGHT);
  set_place(1, 2, -3);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_VELOCITY, update());
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  assert_near(place, estimate.position_m, 3, 1e-12);
  assert_near(turn, estimate.world_from_body, 4, 1e-12);
  TEST_ASSERT_EQUAL_UINT64(77040000, estimate.time_us);
  TEST_ASSERT_EQUAL_INT(TVM_WORLD_FRD, estimate.world);
}

static void test_a_heading_turns_the_world_to_north(void) {
  const double place[3] = {-2, 1, -3}, turn[4] = {0.70710678118654752, 0, 0, 0.70710678118654752};
  options.world = TVM_WORLD_NED;
  track.heading_rad = RIGHT;
  begin();
  set_place(1, 2, -3);
  update();
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  assert_near(place, estimate.position_m, 3, 1e-12);
  assert_near(turn, estimate.world_from_body, 4, 1e-12);
  TEST_ASSERT_EQUAL_INT(TVM_WORLD_NED, estimate.world);
}

/* North at 2 m/s with the nose to the east is -2 m/s along y; the turn to the right is about z. */
static void test_velocities_are_along_the_body_and_rates_about_it(void) {
  const double velocity[3] = {0.5, -2, 0.25}, rate[3] = {0, 0, 0.3};
  begin();
  set_attitude(0, 0, RIGHT - 0.3 * 0.05);
  update();
  set_attitude(0, 0, RIGHT);
  set_place(2 * 0.05, 0.5 * 0.05, 0.25 * 0.05);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(50));
  assert_near(velocity, estimate.velocity_m_s, 3, 1e-12);
  assert_near(rate, estimate.rate_rad_s, 3, 1e-9);
}

/* The last frame as the map has it now, not as it was sent. */
static void test_a_correction_of_the_map_is_no_velocity(void) {
  const double velocity[3] = {1, 0, 0};
  begin();
  update();
  track.has_previous = 1;
  memcpy(track.previous_R, AHEAD, sizeof AHEAD);
  track.previous_t[0] = 5;
  set_place(5.04, 0, 0);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  assert_near(velocity, estimate.velocity_m_s, 3, 1e-9);
  TEST_ASSERT_EQUAL_INT(1, estimate.reset_counter);
}

/* ---- covariances ---- */

static void euler_of(const double *q, double *out) {
  out[0] = atan2(2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[1] * q[1] + q[2] * q[2]));
  out[1] = asin(2 * (q[0] * q[2] - q[3] * q[1]));
  out[2] = atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
}

/* Moves cam_from_world by x_true = exp([w]x) x + d, for a small (w, d). */
static void perturb(const double *R, const double *t, const double *wd, double *R_out,
                    double *t_out) {
  double angle = sqrt(wd[0] * wd[0] + wd[1] * wd[1] + wd[2] * wd[2]), back[9], d[3];
  double K[9] = {0, -wd[2], wd[1], wd[2], 0, -wd[0], -wd[1], wd[0], 0}, KK[9];
  int k;
  const double a = angle > 0 ? sin(angle) / angle : 1;
  const double b = angle > 0 ? (1 - cos(angle)) / (angle * angle) : 0.5;
  multiply(K, K, KK);
  for (k = 0; k < 9; ++k) back[k] = (k % 4 == 0) - a * K[k] + b * KK[k]; /* exp(-[w]x) */
  multiply(R, back, R_out);
  for (k = 0; k < 3; ++k) d[k] = wd[3 + k];
  for (k = 0; k < 3; ++k)
    t_out[k] = t[k] - (R_out[3 * k] * d[0] + R_out[3 * k + 1] * d[1] + R_out[3 * k + 2] * d[2]);
}

/* x y z roll pitch yaw of the body for a perturbed camera. */
static void measured(const double *R, const double *t, const double *wd, double *out) {
  perturb(R, t, wd, state.world_from_cam_R, state.world_from_cam_t);
  begin();
  update();
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  memcpy(out, estimate.position_m, 3 * sizeof *out);
  euler_of(estimate.world_from_body, out + 3);
}

static void check_covariance(int world) {
  const double step = 1e-6;
  const double none[6] = {0};
  double R[9], t[3], J[36], A[36], C[36] = {0}, expected[36] = {0}, unused[6];
  int i, j, k, l;
  uint32_t seed = 5;
  options.camera_in_body[0] = 0.12;
  options.camera_in_body[1] = -0.03;
  options.camera_in_body[2] = 0.07;
  options.world = world;
  track.heading_rad = 0.7;
  set_attitude(0.2, -0.4, 2.5);
  set_place(3, -1, -2);
  memcpy(R, state.world_from_cam_R, sizeof R);
  memcpy(t, state.world_from_cam_t, sizeof t);
  for (k = 0; k < 36; ++k) {
    seed = seed * 1664525u + 1013904223u;
    A[k] = 0.01 * ((double)(seed >> 8) / 16777216.0 - 0.5);
  }
  for (i = 0; i < 6; ++i)
    for (j = 0; j < 6; ++j)
      for (k = 0; k < 6; ++k) C[6 * i + j] += A[6 * i + k] * A[6 * j + k];
  for (k = 0; k < 6; ++k) {
    double wd[6] = {0}, plus[6], minus[6];
    wd[k] = step;
    measured(R, t, wd, plus);
    wd[k] = -step;
    measured(R, t, wd, minus);
    for (i = 0; i < 6; ++i) J[6 * i + k] = (plus[i] - minus[i]) / (2 * step);
  }
  for (i = 0; i < 6; ++i)
    for (j = 0; j < 6; ++j)
      for (k = 0; k < 6; ++k)
        for (l = 0; l < 6; ++l) expected[6 * i + j] += J[6 * i + k] * C[6 * k + l] * J[6 * j + l];
  memcpy(state.cam_from_world_covariance, C, sizeof C);
  state.has_covariance = 1;
  measured(R, t, none, unused);
  TEST_ASSERT_EQUAL_INT(1, estimate.has_covariance);
  assert_near(expected, estimate.pose_covariance, 36, 1e-10);
}

static void test_the_covariance_is_that_of_place_roll_pitch_and_yaw(void) {
  check_covariance(TVM_WORLD_FRD);
}

static void test_so_it_is_in_a_world_that_is_turned_to_north(void) {
  check_covariance(TVM_WORLD_NED);
}

static void test_a_metre_that_errs_grows_with_the_distance(void) {
  begin();
  set_covariance(0.001, 0.02);
  set_place(10, 0, 0);
  state.scale_sigma = 0.01;
  update();
  next(40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02 + 0.1 * 0.1, estimate.pose_covariance[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02, estimate.pose_covariance[7]);
}

/* 4 m there and back: what drifts is by the way, not by the distance. A new segment begins anew. */
static void test_the_map_drifts_with_the_way(void) {
  begin_drifting(0.005, 0.008, 0);
  set_covariance(0.001, 0.02);
  update();
  set_place(2, 0, 0);
  next(400);
  set_place(0, 0, 0);
  next(400);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02 + 0.02 * 0.02, estimate.pose_covariance[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.001 * 0.001 + 0.008 * 0.008, estimate.pose_covariance[35]);
  state.segment = 1;
  next(40);
  next(40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02, estimate.pose_covariance[7]);
  state.segment = 0; /* joined to the older one again */
  next(40);
  next(40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02 + 0.02 * 0.02, estimate.pose_covariance[7]);
}

/* At 25 messages a second a filter that averages over a second counts an error that stays 25 times
   as if it were new. What is new each time stays as it is, and so does the quality. */
static void test_what_stays_is_sent_as_often_as_the_filter_counts_it(void) {
  double turn;
  begin_drifting(0.005, 0.008, 1);
  set_covariance(0.001, 0.02);
  state.scale_sigma = 0.01;
  update();
  set_place(2, 0, 0);
  next(40);
  turn = 0.008 * 2; /* about the origin, 2 m away */
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02 + 25 * (0.01 * 0.01 + 0.02 * 0.02),
                            estimate.pose_covariance[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 * 0.02 + 25 * (0.01 * 0.01 + turn * turn),
                            estimate.pose_covariance[7]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.001 * 0.001 + 25 * 0.008 * 0.008,
                            estimate.pose_covariance[35]);
  TEST_ASSERT_EQUAL_INT(92, estimate.quality); /* of 0.02, 0.01 and 0.02 m */
}

/* Velocities of 0.1 m/s at 25 Hz let a filter's position err by 0.02 m after a second, so that it
   averages positions of 0.05 m for (0.05 / 0.02)^2 s. The attitude's variance is not of that time.
 */
static void test_a_filter_averages_for_longer_what_it_knows_less(void) {
  begin_drifting(0.005, 0.0001, 1);
  set_covariance(0, 0);
  state.has_covariance = 1;
  update();
  set_place(10, 0, 0);
  next(400);
  next(400);
  next(40); /* at rest, after 10 m */
  next(40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * 0.39, 25 * 6.25 * 0.05 * 0.05, estimate.pose_covariance[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 25 * 1e-8, estimate.pose_covariance[35]);
}

/* The map is turned about its origin; after the first segment by twice as much. */
static void test_a_map_that_is_turned_moves_what_is_far(void) {
  const double variance = 0.02 * 0.02, turn = 0.01 * 3;
  options.drift_turn_rad = 0.01;
  begin();
  set_covariance(0, 0.02);
  set_place(0, 3, 0);
  update();
  next(40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, variance + turn * turn, estimate.pose_covariance[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, variance, estimate.pose_covariance[7]);
  /* A turn about z moves what lies along y against x. */
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -3 * 0.01 * 0.01, estimate.pose_covariance[5]);
  state.segment = 1;
  next(40);
  next(40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, variance + 4 * turn * turn, estimate.pose_covariance[0]);
}

/* Two places of 0.02 m each over 50 ms; the velocity did not change, and the attitude is exact. */
static void test_the_velocity_errs_by_both_places_and_by_what_changed(void) {
  const double variance = 2 * 0.02 * 0.02 / (0.05 * 0.05);
  begin();
  set_covariance(0, 0.02);
  update();
  set_place(0.05, 0, 0);
  next(50);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, variance + 25 * 0.05 * 0.05 / 4, estimate.velocity_covariance[0]);
  set_place(0.10, 0, 0);
  next(50);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, variance, estimate.velocity_covariance[0]);
  set_place(0.20, 0, 0); /* 1 m/s more */
  next(50);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, variance + 0.25, estimate.velocity_covariance[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, variance + 0.25, estimate.velocity_covariance[14]);
}

static void test_the_quality_falls_with_the_place_and_a_weak_frame_grows(void) {
  options.weak = TVM_WEAK_GROWN;
  begin();
  update();
  next(40);
  TEST_ASSERT_EQUAL_INT(0, estimate.quality); /* unknown: no covariance */
  TEST_ASSERT_EQUAL_INT(0, estimate.has_covariance);
  set_covariance(0.001, 0.1);
  next(40);
  next(40);
  TEST_ASSERT_EQUAL_INT(50, estimate.quality);
  set_covariance(0.001, 0.001);
  next(40);
  TEST_ASSERT_EQUAL_INT(100, estimate.quality);
  state.status = TV_ODOMETRY_WEAK;
  next(40);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, estimate.silence);
  TEST_ASSERT_EQUAL_INT(20, estimate.quality);
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 9e-6, estimate.pose_covariance[0]);
  set_covariance(0.001, 10);
  next(40);
  TEST_ASSERT_EQUAL_INT(1, estimate.quality);
}

/* ---- when nothing is sent ---- */

static void test_what_is_not_known_is_not_sent(void) {
  static const struct {
    int32_t status, has_pose, scale, upright, silence;
  } cases[] = {
      {TV_ODOMETRY_STARTING, 0, TV_SCALE_UNIT, 1, TVM_SILENCE_STARTING},
      {TV_ODOMETRY_LOST, 0, TV_SCALE_VELOCITY, 1, TVM_SILENCE_LOST},
      {TV_ODOMETRY_TRACKING, 0, TV_SCALE_VELOCITY, 1, TVM_SILENCE_LOST},
      {TV_ODOMETRY_ROTATION, 1, TV_SCALE_VELOCITY, 1, TVM_SILENCE_ROTATION},
      {TV_ODOMETRY_TRACKING, 1, TV_SCALE_UNIT, 1, TVM_SILENCE_SCALE},
      {TV_ODOMETRY_TRACKING, 1, TV_SCALE_VELOCITY, 0, TVM_SILENCE_ATTITUDE},
      {TV_ODOMETRY_WEAK, 1, TV_SCALE_VELOCITY, 1, TVM_SILENCE_WEAK},
  };
  uint8_t bytes[TVM_MAX_PACKET_BYTES];
  size_t k;
  begin();
  update();
  for (k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
    state.status = TV_ODOMETRY_TRACKING;
    state.has_pose = 1;
    state.scale_source = TV_SCALE_VELOCITY;
    track.is_upright = 1;
    next(40);
    TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
    state.status = cases[k].status;
    state.has_pose = (uint8_t)cases[k].has_pose;
    state.scale_source = cases[k].scale;
    track.is_upright = cases[k].upright;
    TEST_ASSERT_EQUAL_INT(cases[k].silence, next(40));
    TEST_ASSERT_EQUAL_DOUBLE(0, estimate.position_m[0] + estimate.world_from_body[0]);
    TEST_ASSERT_EQUAL_UINT(0, tvm_estimate_pack(&estimate, TVM_SEND_ODOMETRY, 1, 197, 0, bytes));
    TEST_ASSERT_EQUAL_UINT(
        0, tvm_estimate_pack(&estimate, TVM_SEND_VISION_POSITION, 1, 197, 0, bytes));
  }
}

static void test_a_number_that_is_not_finite_is_not_sent(void) {
  double *const places[] = {&state.world_from_cam_R[4], &state.world_from_cam_t[2],
                            &state.cam_from_world_covariance[7], &state.scale_sigma};
  const double wrong[] = {NAN, INFINITY, 1e30};
  size_t k, i;
  begin();
  set_covariance(0.001, 0.02);
  update();
  for (k = 0; k < sizeof places / sizeof places[0]; ++k) {
    for (i = 0; i < 3; ++i) {
      const double kept = *places[k];
      next(40);
      TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
      *places[k] = wrong[i];
      TEST_ASSERT_EQUAL_INT(TVM_SILENCE_LOST, next(40));
      *places[k] = kept;
    }
  }
}

/* Another place's map is upright by chance. */
static void test_a_map_that_was_not_upright_is_on_probation(void) {
  begin();
  update();
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  track.is_upright = -1;
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_ATTITUDE, next(40));
  track.is_upright = 1;
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_ATTITUDE, next(500));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_ATTITUDE, next(490));
  next(40);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  track.is_upright = -1;
  next(40);
  track.is_upright = 1;
  state.segment = 1; /* has done nothing wrong */
  next(40);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
}

/* The pictures move at `speed` along x for `frames` frames, the vehicle at 1 m/s. */
static int move(double speed, int frames) {
  for (; frames > 0; --frames) {
    state.world_from_cam_t[0] += 0.04 * speed;
    next(40);
  }
  return estimate.silence;
}

static void test_pictures_that_move_otherwise_than_the_vehicle_are_not_sent(void) {
  begin();
  set_covariance(0.001, 0.005);
  track.velocity_m_s[0] = 1;
  track.velocity_sigma_m_s = 0.05;
  update();
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(1, 10));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(1.1, 10));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_MOTION, move(2, 10));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(1, 40));
  /* But not for ever: it may be the vehicle's velocity that is wrong. */
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_MOTION, move(2, 50));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(2, 10));
}

static void test_a_later_segment_is_compared_before_it_is_sent(void) {
  begin();
  set_covariance(0.001, 0.005);
  track.velocity_m_s[0] = 1;
  track.velocity_sigma_m_s = 0.05;
  update();
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(1, 1));
  state.segment = 1;
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_VELOCITY, move(1, 1));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_MOTION, move(1, 4));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(1, 2));
  track.velocity_sigma_m_s = 0; /* there is nothing to compare it with */
  state.segment = 2;
  move(3, 1);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, move(3, 1));
}

/* What the way differs by from the vehicle's is in the velocity's covariance. */
static void test_a_velocity_that_differs_from_the_vehicles_is_less_sure(void) {
  double before;
  begin();
  set_covariance(0, 0.02);
  track.velocity_m_s[0] = 1;
  track.velocity_sigma_m_s = 0.2;
  update();
  move(1, 10);
  before = estimate.velocity_covariance[0];
  move(1.3, 60);
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, estimate.silence);
  TEST_ASSERT_DOUBLE_WITHIN(0.05, 10 * 0.09, estimate.velocity_covariance[0] - before);
}

static void test_after_a_pause_a_velocity_is_waited_for(void) {
  begin();
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_VELOCITY, update());
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(500));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_VELOCITY, next(501));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
  /* A weak frame that was not sent gives the next one its velocity. */
  state.status = TV_ODOMETRY_WEAK;
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_WEAK, next(40));
  state.status = TV_ODOMETRY_TRACKING;
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, next(40));
}

static void test_each_jump_raises_the_reset_counter_once(void) {
  begin();
  set_covariance(0.001, 0.02);
  update();
  next(40);
  TEST_ASSERT_EQUAL_INT(0, estimate.reset_counter);
  state.relocated = state.loop_closed = 1;
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_VELOCITY, next(40));
  TEST_ASSERT_EQUAL_INT(1, estimate.reset_counter);
  state.relocated = state.loop_closed = 0;
  next(40);
  TEST_ASSERT_EQUAL_INT(1, estimate.reset_counter);
  state.segment = 1;
  next(40);
  TEST_ASSERT_EQUAL_INT(2, estimate.reset_counter);
  next(40);
  state.has_pose = 0; /* lost, and found in the same segment without a word of it */
  state.segment = -1;
  state.status = TV_ODOMETRY_LOST;
  next(40);
  state.has_pose = 1;
  state.segment = 1;
  state.status = TV_ODOMETRY_TRACKING;
  next(40);
  TEST_ASSERT_EQUAL_INT(2, estimate.reset_counter);
  state.scale_source = TV_SCALE_HEIGHT; /* another sensor, the same metre */
  next(40);
  TEST_ASSERT_EQUAL_INT(2, estimate.reset_counter);
  state.scale_source = TV_SCALE_UNIT;
  next(40);
  TEST_ASSERT_EQUAL_INT(3, estimate.reset_counter);
  estimator.reset_counter = 255;
  state.loop_closed = 1;
  next(40);
  TEST_ASSERT_EQUAL_INT(0, estimate.reset_counter);
}

/* A standard deviation of 0.02 m along each axis is one of 0.035 m in space. */
static void test_a_correction_counts_beyond_its_own_sigma(void) {
  begin();
  set_covariance(0.001, 0.02);
  update();
  track.has_previous = 1;
  memcpy(track.previous_R, AHEAD, sizeof AHEAD);
  track.previous_t[0] = 0.034;
  next(40);
  TEST_ASSERT_EQUAL_INT(0, estimate.reset_counter);
  track.previous_t[0] = 0.036;
  next(40);
  TEST_ASSERT_EQUAL_INT(1, estimate.reset_counter);
  track.previous_t[0] = 0;
  rotation(0, 0, 0.0018, track.previous_R); /* beyond 0.001 sqrt(3) */
  multiply(track.previous_R, AHEAD, estimator.last_R);
  memcpy(track.previous_R, AHEAD, sizeof AHEAD);
  next(40);
  TEST_ASSERT_EQUAL_INT(2, estimate.reset_counter);
}

/* ---- bytes ---- */

static uint16_t checksum(const uint8_t *bytes, size_t size, uint8_t extra) {
  uint16_t crc = 0xffff;
  size_t k;
  for (k = 0; k <= size; ++k) {
    uint8_t t = (uint8_t)((k < size ? bytes[k] : extra) ^ (crc & 255));
    t ^= (uint8_t)(t << 4);
    crc = (uint16_t)((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4));
  }
  return crc;
}

/* Checks the frame of a packet, and fills its payload with the zeros that were cut from its end. */
static void unpack(const uint8_t *bytes, size_t size, uint32_t id, uint8_t extra, uint8_t sequence,
                   uint8_t *payload, size_t payload_size) {
  memset(payload, 0, payload_size);
  TEST_ASSERT_EQUAL_HEX8(0xfd, bytes[0]);
  TEST_ASSERT_EQUAL_UINT(size, (size_t)bytes[1] + 12);
  TEST_ASSERT_TRUE(bytes[1] <= payload_size);
  TEST_ASSERT_EQUAL_HEX8(0, bytes[2]);
  TEST_ASSERT_EQUAL_HEX8(sequence, bytes[4]);
  TEST_ASSERT_EQUAL_UINT8(7, bytes[5]);
  TEST_ASSERT_EQUAL_UINT8(197, bytes[6]);
  TEST_ASSERT_EQUAL_UINT32(id, bytes[7] | bytes[8] << 8 | bytes[9] << 16);
  TEST_ASSERT_EQUAL_HEX16(checksum(bytes + 1, size - 3, extra),
                          bytes[size - 2] | bytes[size - 1] << 8);
  memcpy(payload, bytes + 10, bytes[1]);
}

static float number(const uint8_t *payload, int at) {
  float value;
  memcpy(&value, payload + at, sizeof value);
  return value;
}

static void fill_estimate(void) {
  int i, j;
  memset(&estimate, 0, sizeof estimate);
  estimate.struct_size = sizeof estimate;
  estimate.time_us = UINT64_C(0x0102030405060708);
  estimate.reset_counter = 200;
  estimate.quality = 73;
  estimate.has_covariance = 1;
  for (i = 0; i < 3; ++i) {
    estimate.position_m[i] = 1.5 + i;
    estimate.velocity_m_s[i] = 11.25 + i;
    estimate.rate_rad_s[i] = 21.125 + i;
  }
  estimate.world_from_body[0] = cos(0.25);
  estimate.world_from_body[3] = sin(0.25);
  for (i = 0; i < 6; ++i) {
    for (j = 0; j < 6; ++j) {
      estimate.pose_covariance[6 * i + j] = 100 + 10 * (i < j ? i : j) + (i < j ? j : i);
      estimate.velocity_covariance[6 * i + j] = 200 + 10 * (i < j ? i : j) + (i < j ? j : i);
    }
  }
}

static void test_the_bytes_of_odometry(void) {
  uint8_t bytes[TVM_MAX_PACKET_BYTES], payload[233];
  size_t size;
  int i, j, k = 0;
  fill_estimate();
  size = tvm_estimate_pack(&estimate, TVM_SEND_ODOMETRY, 7, 197, 9, bytes);
  TEST_ASSERT_EQUAL_UINT(245, size);
  unpack(bytes, size, 331, 91, 9, payload, sizeof payload);
  for (i = 0; i < 8; ++i) TEST_ASSERT_EQUAL_HEX8(8 - i, payload[i]);
  for (i = 0; i < 3; ++i) {
    TEST_ASSERT_EQUAL_FLOAT(1.5 + i, number(payload, 8 + 4 * i));
    TEST_ASSERT_EQUAL_FLOAT(11.25 + i, number(payload, 36 + 4 * i));
    TEST_ASSERT_EQUAL_FLOAT(21.125 + i, number(payload, 48 + 4 * i));
  }
  TEST_ASSERT_EQUAL_FLOAT(cos(0.25), number(payload, 20));
  TEST_ASSERT_EQUAL_FLOAT(sin(0.25), number(payload, 32));
  for (i = 0; i < 6; ++i) {
    for (j = i; j < 6; ++j, ++k) {
      TEST_ASSERT_EQUAL_FLOAT(100 + 10 * i + j, number(payload, 60 + 4 * k));
      TEST_ASSERT_EQUAL_FLOAT(200 + 10 * i + j, number(payload, 144 + 4 * k));
    }
  }
  TEST_ASSERT_EQUAL_INT(21, k);
  TEST_ASSERT_EQUAL_UINT8(20, payload[228]); /* MAV_FRAME_LOCAL_FRD */
  TEST_ASSERT_EQUAL_UINT8(12, payload[229]); /* MAV_FRAME_BODY_FRD */
  TEST_ASSERT_EQUAL_UINT8(200, payload[230]);
  TEST_ASSERT_EQUAL_UINT8(3, payload[231]); /* MAV_ESTIMATOR_TYPE_VIO */
  TEST_ASSERT_EQUAL_INT8(73, payload[232]);
  estimate.world = TVM_WORLD_NED;
  size = tvm_estimate_pack(&estimate, TVM_SEND_ODOMETRY, 7, 197, 10, bytes);
  unpack(bytes, size, 331, 91, 10, payload, sizeof payload);
  TEST_ASSERT_EQUAL_UINT8(1, payload[228]); /* MAV_FRAME_LOCAL_NED */
}

static void test_unknown_covariances_begin_with_nan_and_the_quality_is_0(void) {
  uint8_t bytes[TVM_MAX_PACKET_BYTES], payload[233];
  size_t size;
  fill_estimate();
  estimate.has_covariance = estimate.quality = 0;
  size = tvm_estimate_pack(&estimate, TVM_SEND_ODOMETRY, 7, 197, 9, bytes);
  unpack(bytes, size, 331, 91, 9, payload, sizeof payload);
  TEST_ASSERT_TRUE(isnan(number(payload, 60)) && isnan(number(payload, 144)));
  TEST_ASSERT_EQUAL_FLOAT(0, number(payload, 64));
  TEST_ASSERT_EQUAL_UINT8(0, payload[232]);
  size = tvm_estimate_pack(&estimate, TVM_SEND_VISION_POSITION, 7, 197, 9, bytes);
  unpack(bytes, size, 102, 158, 9, payload, 117);
  TEST_ASSERT_TRUE(isnan(number(payload, 32)));
}

static void test_the_bytes_of_vision_position_estimate(void) {
  uint8_t bytes[TVM_MAX_PACKET_BYTES], payload[117];
  size_t size;
  int i, j, k = 0;
  fill_estimate();
  size = tvm_estimate_pack(&estimate, TVM_SEND_VISION_POSITION, 7, 197, 255, bytes);
  unpack(bytes, size, 102, 158, 255, payload, sizeof payload);
  for (i = 0; i < 8; ++i) TEST_ASSERT_EQUAL_HEX8(8 - i, payload[i]);
  for (i = 0; i < 3; ++i) TEST_ASSERT_EQUAL_FLOAT(1.5 + i, number(payload, 8 + 4 * i));
  TEST_ASSERT_EQUAL_FLOAT(0, number(payload, 20));
  TEST_ASSERT_EQUAL_FLOAT(0, number(payload, 24));
  TEST_ASSERT_FLOAT_WITHIN(1e-6, 0.5, number(payload, 28));
  for (i = 0; i < 6; ++i)
    for (j = i; j < 6; ++j, ++k)
      TEST_ASSERT_EQUAL_FLOAT(100 + 10 * i + j, number(payload, 32 + 4 * k));
  TEST_ASSERT_EQUAL_UINT8(200, payload[116]);
}

/* ---- through a session ---- */

enum { SYSTEM = 7 };
static uint8_t memory[200000], queue[2048], sent[256][300];
static size_t queue_size, sent_size[256];
static int num_sent;
static tvm_session *session;
static mavlink_status_t sender;
static int64_t now;

static tvs_status take_sent(void *user, const void *bytes, size_t size) {
  (void)user;
  TEST_ASSERT_TRUE(num_sent < 256);
  memcpy(sent[num_sent], bytes, size);
  sent_size[num_sent++] = size;
  return TVS_OK;
}

static tvs_status give(void *user, void *bytes, size_t capacity, size_t *size) {
  (void)user;
  (void)capacity;
  if (queue_size == 0) return TVS_NONE;
  memcpy(bytes, queue, queue_size);
  *size = queue_size;
  queue_size = 0;
  return TVS_OK;
}

static void add(const mavlink_message_t *m) {
  queue_size += mavlink_msg_to_send_buffer(queue + queue_size, m);
}

/* The vehicle's clock is 4000 s ahead of ours; it flies level to the east, nose to the east. */
static void fly(int64_t ms) {
  mavlink_message_t m;
  const mavlink_attitude_t a = {(uint32_t)(4000000 + ms), 0, 0, (float)RIGHT, 0, 0, 0};
  mavlink_msg_attitude_encode_status(SYSTEM, 1, &sender, &m, &a);
  add(&m);
  now = ms * MS;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_session_step(session, now));
}

static void begin_session(int listen_only) {
  const tvm_transport transport = {sizeof transport, NULL, take_sent, give, NULL, NULL};
  tvm_session_options o;
  mavlink_message_t m;
  const mavlink_heartbeat_t h = {0, MAV_TYPE_QUADROTOR, MAV_AUTOPILOT_PX4, 0, MAV_STATE_ACTIVE, 3};
  int64_t ms;
  tvm_session_options_init(&o);
  o.own_component = TVM_COMPONENT_ODOMETRY;
  o.listen_only = listen_only;
  memset(&sender, 0, sizeof sender);
  queue_size = 0;
  num_sent = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_session_init(&session, &o, &transport, memory, sizeof memory));
  mavlink_msg_heartbeat_encode_status(SYSTEM, 1, &sender, &m, &h);
  add(&m);
  for (ms = 1000; ms <= 1400; ms += 20) fly(ms);
  begin();
  num_sent = 0;
}

static tvs_status send_track(int64_t ms) {
  track.host_ns = ms * MS;
  return tvm_session_send_track(session, &estimator, &track, &estimate);
}

static uint32_t id_of(int k) { return (uint32_t)(sent[k][7] | sent[k][8] << 8 | sent[k][9] << 16); }

/* How many packets of this message were sent, and the last of them. */
static int count_sent(uint32_t id, const uint8_t **last) {
  int k, count = 0;
  for (k = 0; k < num_sent; ++k) {
    if (id_of(k) != id) continue;
    ++count;
    if (last) *last = sent[k];
  }
  return count;
}

/* In the session's world x is the nose at the start, so the attitude is that of the world. */
static void test_a_session_sends_the_exposure_in_the_clock_of_the_vehicle(void) {
  const uint8_t *packet = NULL;
  uint64_t time_us;
  int k;
  options.messages = TVM_SEND_ODOMETRY | TVM_SEND_VISION_POSITION;
  begin_session(0);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, send_track(1290));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_VELOCITY, estimate.silence);
  TEST_ASSERT_EQUAL_INT(TVS_OK, send_track(1310));
  TEST_ASSERT_EQUAL_INT(1, count_sent(102, NULL));
  TEST_ASSERT_EQUAL_INT(1, count_sent(331, &packet));
  TEST_ASSERT_EQUAL_UINT8(SYSTEM, packet[5]);
  TEST_ASSERT_EQUAL_UINT8(197, packet[6]);
  memcpy(&time_us, packet + 10, sizeof time_us);
  TEST_ASSERT_UINT64_WITHIN(1500, 4001310000u, time_us);
  /* Whatever is sent is one of these, none of which steers. */
  for (k = 0; k < num_sent; ++k) {
    const uint32_t id = id_of(k);
    TEST_ASSERT_TRUE(id == 0 || id == 111 || id == 76 || id == 66 || id == 331 || id == 102 ||
                     id == 253);
  }
}

static void test_north_is_by_the_heading_of_the_vehicle(void) {
  options.world = TVM_WORLD_NED;
  begin_session(0);
  set_place(1, 0, 0);
  send_track(1290);
  TEST_ASSERT_EQUAL_INT(TVS_OK, send_track(1310));
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, estimate.position_m[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, estimate.position_m[1]);
}

/* The vehicle starts again with its nose to the south: the old segment's x axis is not known to be
   that of the new run, a new segment's is. */
static void test_a_heading_is_not_carried_over_a_reboot(void) {
  int64_t ms;
  options.world = TVM_WORLD_NED;
  begin_session(0);
  send_track(1200);
  TEST_ASSERT_EQUAL_INT(TVS_OK, send_track(1220));
  for (ms = 1420; ms <= 1800; ms += 20) {
    mavlink_message_t m;
    const mavlink_attitude_t a = {(uint32_t)(ms - 1400), 0, 0, (float)(2 * RIGHT), 0, 0, 0};
    mavlink_msg_attitude_encode_status(SYSTEM, 1, &sender, &m, &a);
    add(&m);
    now = ms * MS;
    TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_session_step(session, now));
  }
  TEST_ASSERT_EQUAL_INT(TVS_NONE, send_track(1700));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_ATTITUDE, estimate.silence);
  state.segment = 1;
  set_place(1, 0, 0);
  send_track(1720);
  TEST_ASSERT_EQUAL_INT(TVS_OK, send_track(1740));
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, -1, estimate.position_m[0]);
}

static void test_a_map_that_is_not_upright_or_has_no_attitude_is_not_sent(void) {
  begin_session(0);
  send_track(1200);
  TEST_ASSERT_EQUAL_INT(TVS_OK, send_track(1220));
  set_attitude(0, 0.3, 0);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, send_track(1240));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_ATTITUDE, estimate.silence);
  set_attitude(0, 0, 0);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, send_track(1500)); /* no attitude has come for this time yet */
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_ATTITUDE, estimate.silence);
}

static void test_a_status_text_says_when_positions_end_and_why(void) {
  const uint8_t *packet = NULL;
  int64_t ms;
  begin_session(0);
  send_track(1200);
  send_track(1220);
  TEST_ASSERT_EQUAL_INT(1, count_sent(253, &packet));
  TEST_ASSERT_EQUAL_UINT8(MAV_SEVERITY_INFO, packet[10]);
  TEST_ASSERT_EQUAL_STRING_LEN("twoview: position", (const char *)packet + 11, 17);
  state.status = TV_ODOMETRY_LOST;
  state.has_pose = 0;
  for (ms = 1240; ms <= 1380; ms += 20) send_track(ms);
  TEST_ASSERT_EQUAL_INT(1, count_sent(253, NULL)); /* at most one a second */
  for (ms = 1420; ms <= 3000; ms += 20) {
    fly(ms);
    send_track(ms - 20);
  }
  TEST_ASSERT_EQUAL_INT(2, count_sent(253, &packet));
  TEST_ASSERT_EQUAL_UINT8(MAV_SEVERITY_WARNING, packet[10]);
  TEST_ASSERT_EQUAL_STRING_LEN("twoview: lost, no position", (const char *)packet + 11, 26);
  TEST_ASSERT_EQUAL_INT(1, count_sent(331, NULL));
}

static void test_the_autopilot_finds_no_offset_to_our_times(void) {
  mavlink_timesync_t request;
  uint8_t payload[18] = {0};
  const uint8_t *packet = NULL;
  mavlink_message_t m;
  int64_t answer, asked;
  int num_own;
  memset(&request, 0, sizeof request);
  request.ts1 = 4242;
  begin_session(0);
  mavlink_msg_timesync_encode_status(SYSTEM, 1, &sender, &m, &request);
  add(&m);
  fly(1420);
  num_own = count_sent(111, NULL); /* without estimates nobody asks for an answer */
  send_track(1400);
  mavlink_msg_timesync_encode_status(SYSTEM, 1, &sender, &m, &request);
  add(&m);
  fly(1440);
  TEST_ASSERT_EQUAL_INT(num_own + 1, count_sent(111, &packet));
  memcpy(payload, packet + 10, packet[1]); /* zeros at the end are cut */
  memcpy(&answer, payload, sizeof answer);
  memcpy(&asked, payload + 8, sizeof asked);
  TEST_ASSERT_EQUAL_INT64(4242, asked);
  TEST_ASSERT_INT64_WITHIN(3 * MS, 4001440 * MS, answer);
}

static void test_a_session_that_listens_sends_nothing(void) {
  begin_session(1);
  send_track(1290);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, send_track(1310));
  TEST_ASSERT_EQUAL_INT(TVM_SILENCE_NONE, estimate.silence);
  TEST_ASSERT_EQUAL_INT(0, num_sent);
}

/* ---- a caller with a newer header ---- */

static void test_a_newer_callers_structs_are_read_and_written_whole(void) {
  struct {
    tvm_track known;
    uint64_t more;
  } newer_track;
  struct {
    tvm_estimate known;
    uint64_t more;
  } newer;
  struct {
    tv_odometry_state known;
    uint64_t more;
  } newer_state;
  uint8_t bytes[TVM_MAX_PACKET_BYTES];
  begin();
  newer_state.known = state;
  newer_state.known.struct_size = sizeof newer_state;
  newer_state.more = 7; /* what a newer odometry writes and this library does not know */
  newer_track.known = track;
  newer_track.known.struct_size = sizeof newer_track;
  newer_track.known.state = &newer_state.known;
  newer_track.more = 0;
  memset(&newer, 0xff, sizeof newer);
  newer.known.struct_size = sizeof newer;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_estimator_update(&estimator, &newer_track.known, &newer.known));
  TEST_ASSERT_EQUAL_UINT32(sizeof newer, newer.known.struct_size);
  TEST_ASSERT_EQUAL_UINT64(0, newer.more);
  fill_estimate();
  newer.known = estimate;
  newer.known.struct_size = sizeof newer;
  TEST_ASSERT_TRUE(tvm_estimate_pack(&newer.known, 1, 1, 197, 0, bytes) > 0);
  newer.more = 1;
  TEST_ASSERT_EQUAL_UINT(0, tvm_estimate_pack(&newer.known, 1, 1, 197, 0, bytes));
  newer_track.more = 1;
  ++newer_track.known.host_ns;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE,
                        tvm_estimator_update(&estimator, &newer_track.known, &newer.known));
}

/* ---- bad arguments ---- */

static void test_bad_arguments_are_refused_and_change_nothing(void) {
  uint8_t bytes[TVM_MAX_PACKET_BYTES];
  tvm_estimator before;
  begin();
  update();
  before = estimator;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_estimator_update(&estimator, &track, &estimate));
  track.struct_size = 8;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, tvm_estimator_update(&estimator, &track, &estimate));
  track.struct_size = sizeof track;
  track.state = NULL;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, tvm_estimator_update(&estimator, &track, &estimate));
  TEST_ASSERT_EQUAL_MEMORY(&before, &estimator, sizeof before);
  fill_estimate();
  TEST_ASSERT_EQUAL_UINT(0, tvm_estimate_pack(&estimate, 4, 1, 197, 0, bytes));
  TEST_ASSERT_EQUAL_UINT(0, tvm_estimate_pack(&estimate, 3, 1, 197, 0, bytes));
  TEST_ASSERT_EQUAL_UINT(0, tvm_estimate_pack(NULL, 1, 1, 197, 0, bytes));
  options.weak = 2;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_estimator_init(&estimator, &options));
  options.weak = 0;
  options.messages = 0;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_estimator_init(&estimator, &options));
  options.messages = 1;
  options.weak_factor = 0.5;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_estimator_init(&estimator, &options));
  options.weak_factor = 3;
  options.filter_memory_s = -1;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_estimator_init(&estimator, &options));
  options.filter_memory_s = 0;
  options.body_from_camera[0] = 1;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_estimator_init(&estimator, &options));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, tvm_estimator_init(NULL, &options));
  options.struct_size = 4;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, tvm_estimator_init(&estimator, &options));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_pose_is_that_of_the_body);
  RUN_TEST(test_a_heading_turns_the_world_to_north);
  RUN_TEST(test_velocities_are_along_the_body_and_rates_about_it);
  RUN_TEST(test_a_correction_of_the_map_is_no_velocity);
  RUN_TEST(test_the_covariance_is_that_of_place_roll_pitch_and_yaw);
  RUN_TEST(test_so_it_is_in_a_world_that_is_turned_to_north);
  RUN_TEST(test_a_metre_that_errs_grows_with_the_distance);
  RUN_TEST(test_the_map_drifts_with_the_way);
  RUN_TEST(test_what_stays_is_sent_as_often_as_the_filter_counts_it);
  RUN_TEST(test_a_filter_averages_for_longer_what_it_knows_less);
  RUN_TEST(test_a_map_that_is_turned_moves_what_is_far);
  RUN_TEST(test_the_velocity_errs_by_both_places_and_by_what_changed);
  RUN_TEST(test_the_quality_falls_with_the_place_and_a_weak_frame_grows);
  RUN_TEST(test_what_is_not_known_is_not_sent);
  RUN_TEST(test_a_number_that_is_not_finite_is_not_sent);
  RUN_TEST(test_a_map_that_was_not_upright_is_on_probation);
  RUN_TEST(test_pictures_that_move_otherwise_than_the_vehicle_are_not_sent);
  RUN_TEST(test_a_later_segment_is_compared_before_it_is_sent);
  RUN_TEST(test_a_velocity_that_differs_from_the_vehicles_is_less_sure);
  RUN_TEST(test_after_a_pause_a_velocity_is_waited_for);
  RUN_TEST(test_each_jump_raises_the_reset_counter_once);
  RUN_TEST(test_a_correction_counts_beyond_its_own_sigma);
  RUN_TEST(test_the_bytes_of_odometry);
  RUN_TEST(test_unknown_covariances_begin_with_nan_and_the_quality_is_0);
  RUN_TEST(test_the_bytes_of_vision_position_estimate);
  RUN_TEST(test_a_session_sends_the_exposure_in_the_clock_of_the_vehicle);
  RUN_TEST(test_north_is_by_the_heading_of_the_vehicle);
  RUN_TEST(test_a_heading_is_not_carried_over_a_reboot);
  RUN_TEST(test_a_map_that_is_not_upright_or_has_no_attitude_is_not_sent);
  RUN_TEST(test_a_status_text_says_when_positions_end_and_why);
  RUN_TEST(test_the_autopilot_finds_no_offset_to_our_times);
  RUN_TEST(test_a_session_that_listens_sends_nothing);
  RUN_TEST(test_a_newer_callers_structs_are_read_and_written_whole);
  RUN_TEST(test_bad_arguments_are_refused_and_change_nothing);
  return UNITY_END();
}
