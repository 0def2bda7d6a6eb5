// The turn that a gyro measures (tv_integrate_gyro, odometry/gyro.h): against an integration in
// steps of a microsecond in extended precision, simulated noise and offsets, and a flight through
// the dark.

#include <unity.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "odometry/gyro.h"
#include "support/odometry_flight.h"
#include "support/scene.h"

namespace {

alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;

constexpr int kNum = 41;  // samples of 200 Hz: 0.2 s
tv_gyro_sample samples[kNum];

// A turn that is fast and whose axis moves, as of a shaken vehicle.
void shake() {
  for (int k = 0; k < kNum; ++k) {
    const double t = 0.005 * k;
    samples[k] = {t, {2 * std::sin(30 * t), 3.5 + std::cos(40 * t), 1.5 * std::sin(25 * t + 1)}};
  }
}

// By the midpoint rule of q' = q w / 2, with the rate linear between the samples.
void integrate_finely(double begin_s, double end_s, double R[9]) {
  constexpr int kSteps = 100000;
  long double q[4] = {1, 0, 0, 0};
  const long double h = (static_cast<long double>(end_s) - begin_s) / kSteps;
  for (int n = 0; n < kSteps; ++n) {
    const long double t = begin_s + (n + 0.5L) * h;
    const int k = std::min(static_cast<int>(t / 0.005L), kNum - 2);
    const long double share = (t - samples[k].time_s) / (samples[k + 1].time_s - samples[k].time_s);
    long double w[3], half = 0;
    for (int c = 0; c < 3; ++c) {
      w[c] =
          h / 2 * (samples[k].rate_rad_s[c] * (1 - share) + samples[k + 1].rate_rad_s[c] * share);
      half += w[c] * w[c];
    }
    half = sqrtl(half);
    const long double c = cosl(half), s = half > 0 ? sinl(half) / half : 1;
    const long double p[4] = {c, s * w[0], s * w[1], s * w[2]};
    const long double r[4] = {q[0] * p[0] - q[1] * p[1] - q[2] * p[2] - q[3] * p[3],
                              q[0] * p[1] + q[1] * p[0] + q[2] * p[3] - q[3] * p[2],
                              q[0] * p[2] + q[2] * p[0] + q[3] * p[1] - q[1] * p[3],
                              q[0] * p[3] + q[3] * p[0] + q[1] * p[2] - q[2] * p[1]};
    std::copy_n(r, 4, q);
  }
  const long double w = q[0], x = q[1], y = q[2], z = q[3];
  const long double m[9] = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  for (int k = 0; k < 9; ++k) R[k] = static_cast<double>(m[k]);
}

double angle_between(const double A[9], const double B[9]) {
  return tv::turn_between(tv::rigid_of(A, tv::kIdentity.t), tv::rigid_of(B, tv::kIdentity.t));
}

// 0.2 s at 230 deg/s: 47 degrees.
void test_a_turn_is_that_of_an_integration_in_small_steps() {
  shake();
  for (const double begin_s : {0.0, 0.0137}) {
    double R[9], fine[9], sigma;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_integrate_gyro(samples, kNum, 0, begin_s, 0.2, R, &sigma));
    integrate_finely(begin_s, 0.2, fine);
    TEST_ASSERT_TRUE(tv::rotation_angle(tv::rigid_of(R, tv::kIdentity.t)) > 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(2e-7, 0, angle_between(R, fine));
    TEST_ASSERT_EQUAL_DOUBLE(0, sigma);
  }
}

void test_the_sigma_is_that_of_noisy_samples() {
  shake();
  tv_gyro_sample exact[kNum];
  std::copy_n(samples, kNum, exact);
  tv::Random random = tv::random_seeded(20261201);
  double R[9], noisy[9], sigma = 0, sum = 0;
  constexpr int kTrials = 2000;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_integrate_gyro(exact, kNum, 0, 0.0137, 0.19, R, &sigma));
  for (int n = 0; n < kTrials; ++n) {
    for (int k = 0; k < kNum; ++k) {
      for (int c = 0; c < 3; ++c) {
        samples[k].rate_rad_s[c] = exact[k].rate_rad_s[c] + 0.01 * scene::normal(&random);
      }
    }
    tv_integrate_gyro(samples, kNum, 0.01, 0.0137, 0.19, noisy, &sigma);
    const double angle = angle_between(R, noisy);
    sum += angle * angle;
  }
  TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, std::sqrt(sum / (3 * kTrials)) / sigma);
}

void test_samples_that_cannot_be_integrated_are_refused() {
  shake();
  double R[9] = {9}, sigma = 9;
  const auto with = [&](int32_t num, double noise, double begin_s, double end_s) {
    return tv_integrate_gyro(samples, num, noise, begin_s, end_s, R, &sigma);
  };
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_integrate_gyro(nullptr, 2, 0, 0, 0.1, R, &sigma));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_integrate_gyro(samples, 2, 0, 0, 0.1, R, nullptr));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, with(1, 0, 0, 0.1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, with(kNum, -1, 0, 0.1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, with(kNum, 0, 0, INFINITY));
  TEST_ASSERT_EQUAL_INT(TV_ERR_TIME, with(kNum, 0, 0.1, 0.1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_TIME, with(kNum, 0, -0.001, 0.1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_TIME, with(kNum, 0, 0.1, 0.201));
  samples[7].rate_rad_s[1] = NAN;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, with(kNum, 0, 0, 0.1));
  samples[7].rate_rad_s[1] = 1001;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, with(kNum, 0, 0, 0.1));
  samples[7].rate_rad_s[1] = 0;
  samples[7].time_s = samples[6].time_s;
  TEST_ASSERT_EQUAL_INT(TV_ERR_TIME, with(kNum, 0, 0, 0.1));
  TEST_ASSERT_EQUAL_DOUBLE(9, R[0]);
  TEST_ASSERT_EQUAL_DOUBLE(9, sigma);
}

// A camera that turns at 200 deg/s about an axis that is not one of its own, with an offset of
// 2 deg/s, 30 frames a second.
void test_a_constant_offset_is_measured() {
  const double offset[3] = {0.03, -0.02, 0.035}, frame_s = 1 / 30.0;
  const double rate[3] = {1.2, 3.2, -0.6};
  tv::Random random = tv::random_seeded(7);
  tv::Rigid now = tv::kIdentity;
  odometry->tracking.state = tv::TrackingState::kTracked;
  odometry->turn_sigma = 0.0005;
  for (int n = 1; n <= 300; ++n) {
    double R[9], sigma;
    tv_gyro_sample two[2] = {{0, {0}}, {frame_s, {0}}};
    for (tv_gyro_sample& s : two) std::copy_n(rate, 3, s.rate_rad_s);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_integrate_gyro(two, 2, 0, 0, frame_s, R, &sigma));
    const tv::Rigid truth = tv::compose(tv::inverse(tv::rigid_of(R, tv::kIdentity.t)), now);
    for (tv_gyro_sample& s : two) {
      for (int c = 0; c < 3; ++c) s.rate_rad_s[c] += offset[c] + 0.002 * scene::normal(&random);
    }
    tv_odometry_frame input;
    tv_odometry_frame_init(&input);
    tv_integrate_gyro(two, 2, 0.002, 0, frame_s, input.previous_from_cam, &input.turn_sigma_rad);
    odometry->previous.cam_from_world = now;
    odometry->frame.time_s = n * frame_s;
    odometry->frame.cam_from_world = truth;
    tv::hold_turn(odometry, input, odometry->frame);
    TEST_ASSERT_TRUE(odometry->gyro.is_held);
    tv::measure_bias(odometry, odometry->frame);
    odometry->last_time_s = odometry->frame.time_s;
    now = truth;
  }
  const double sigma = std::sqrt(odometry->gyro.bias_variance);
  TEST_ASSERT_TRUE(sigma < 0.005);
  for (int c = 0; c < 3; ++c) {
    TEST_ASSERT_DOUBLE_WITHIN(3 * sigma, offset[c], odometry->gyro.bias[c]);
  }
}

// previous_from_cam of the room's camera, which draws what lies at a yaw about the vertical axis.
void turn_of(double yaw0, double yaw1, double R[9]) {
  const double c = std::cos(yaw1 - yaw0), s = std::sin(yaw1 - yaw0);
  const double turn[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
  std::copy_n(turn, 9, R);
}

// The room is seen for 60 frames, then the camera turns by half a radian in the dark, and moves on.
tv_odometry_state fly_through_the_dark(int num_dark, bool has_gyro) {
  static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];
  odometry = begin_room_flight(memory, sizeof memory);
  tv_odometry_state state;
  double before = 0;
  double seen[9] = {0};
  for (int n = 0; n < 60 + num_dark + 15; ++n) {
    const double x = 0.9 * std::sin(0.07 * n) - 0.3;
    const double centre[3] = {x, 0.15 * std::sin(0.11 * n), 0.3 * std::sin(0.05 * n)};
    const double turned = 0.5 * std::min(std::max(n - 59, 0), num_dark) / num_dark;
    const double yaw = 0.12 * std::sin(0.06 * n) + turned;
    const bool is_dark = n >= 60 && n < 60 + num_dark;
    room_draw(centre, yaw, pixels);
    if (is_dark) std::memset(pixels, 2, sizeof pixels);
    tv_odometry_frame frame;
    tv_odometry_frame_init(&frame);
    frame.image = {pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
    frame.time_s = n / 30.0;
    if (has_gyro && n > 0) {
      turn_of(before, yaw, frame.previous_from_cam);
      frame.turn_sigma_rad = 1e-4;
    }
    tv_odometry_state_init(&state);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
    if (n < 60 && n > 40) {
      TEST_ASSERT_TRUE(state.has_pose);
      std::copy_n(state.world_from_cam_R, 9, seen);
    }
    if (is_dark && !has_gyro) TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, state.status);
    if (is_dark && has_gyro) {
      TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_ROTATION, state.status);
      double turn[9], expected[9];
      turn_of(0.12 * std::sin(0.06 * 59), yaw, turn);
      tv::write_matrix(tv::matrix_of(seen) * tv::matrix_of(turn), expected);
      TEST_ASSERT_DOUBLE_WITHIN(3 * tv::held_sigma(odometry->gyro), 0,
                                angle_between(expected, state.world_from_cam_R));
    }
    before = yaw;
  }
  return state;
}

void test_a_second_of_darkness_ends_no_segment() {
  fly_through_the_dark(30, false);
  const tv_odometry_state with = fly_through_the_dark(30, true);
  TEST_ASSERT_EQUAL_INT(1, with.num_segments);
  TEST_ASSERT_TRUE(with.status == TV_ODOMETRY_TRACKING || with.status == TV_ODOMETRY_WEAK);
}

void test_a_turn_that_is_none_is_not_used() {
  tv_odometry_frame input;
  tv_odometry_frame_init(&input);
  odometry->tracking.state = tv::TrackingState::kTracked;
  odometry->previous.cam_from_world = tv::kIdentity;
  odometry->frame.time_s = 1;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double sigma : {0.0, -1.0, 0.2, nan}) {
    turn_of(0, 0.1, input.previous_from_cam);
    input.turn_sigma_rad = sigma;
    tv::hold_turn(odometry, input, odometry->frame);
    TEST_ASSERT_FALSE(odometry->gyro.is_held);
  }
  input.turn_sigma_rad = 0.001;
  input.previous_from_cam[4] = nan;
  tv::hold_turn(odometry, input, odometry->frame);
  TEST_ASSERT_FALSE(odometry->gyro.is_held);
  input.previous_from_cam[4] = 1;
  tv::hold_turn(odometry, input, odometry->frame);
  TEST_ASSERT_TRUE(odometry->gyro.is_held);
}

}  // namespace

extern "C" void setUp(void) { odometry = begin_room_flight(memory, sizeof memory); }
extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_turn_is_that_of_an_integration_in_small_steps);
  RUN_TEST(test_the_sigma_is_that_of_noisy_samples);
  RUN_TEST(test_samples_that_cannot_be_integrated_are_refused);
  RUN_TEST(test_a_constant_offset_is_measured);
  RUN_TEST(test_a_second_of_darkness_ends_no_segment);
  RUN_TEST(test_a_turn_that_is_none_is_not_used);
  return UNITY_END();
}
