// The scale in metres from velocity, altitude and floor, for flights whose truth is a closed
// formula.
#include <cmath>

#include "recording/metric_scale.h"

#include <unity.h>  // comes last, since unity.h defines isnan and isinf as macros

using namespace cli;

namespace {

constexpr double kPi = 3.14159265358979323846;

Matrix3 yaw_of(double yaw) {
  const double c = std::cos(yaw), s = std::sin(yaw);
  return {c, -s, 0, s, c, 0, 0, 0, 1};
}

Matrix3 pitch_of(double pitch) {
  const double c = std::cos(pitch), s = std::sin(pitch);
  return {c, 0, s, 0, 1, 0, -s, 0, c};
}

// A log of two seconds at 100 Hz; velocity and attitude are functions of time.
template <class Attitude, class Velocity, class Altitude>
FlightLog flight(Attitude attitude, Velocity velocity, Altitude altitude) {
  FlightLog log;
  for (int k = 0; k <= 200; ++k) {
    FlightSample sample;
    sample.time_s = 10 + k * 0.01;
    sample.world_from_body = attitude(k * 0.01);
    sample.attitude_sigma_rad = 0.01;
    sample.velocity_m_s = velocity(k * 0.01);
    sample.velocity_sigma = 0.02;
    sample.altitude_m = altitude(k * 0.01);
    sample.altitude_sigma = 0.01;
    log.push_back(sample);
  }
  return log;
}

// A quarter circle of radius 1 m, flown forward while the drone turns with it.
FlightLog circle() {
  return flight([](double t) { return yaw_of(t * kPi / 4); },
                [](double) {
                  return Vector3{kPi / 4, 0, 0};
                },
                [](double) { return 1.0; });
}

FlightLog climb() {
  return flight([](double) { return yaw_of(0.3); },
                [](double) {
                  return Vector3{0, 0, -0.3};
                },
                [](double t) { return 1.0 + 0.3 * t; });
}

void test_velocity_is_integrated_along_the_turns() {
  const auto scale = scale_by_velocity(circle(), 10.005, 11.995, CameraMount());
  TEST_ASSERT_TRUE(scale.has_value());
  // The baseline is the chord of the arc that was flown, not the length of the arc.
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, 2 * std::sin(1.99 * kPi / 8), scale->baseline_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.02 * 1.99, scale->sigma_m);
  TEST_ASSERT_EQUAL_STRING("velocity", scale->source.c_str());
}

void test_order_of_the_frames_does_not_matter_to_velocity() {
  const auto there = scale_by_velocity(circle(), 10.2, 11.5, CameraMount());
  const auto back = scale_by_velocity(circle(), 11.5, 10.2, CameraMount());
  TEST_ASSERT_TRUE(there && back);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, there->baseline_m, back->baseline_m);
}

void test_a_camera_before_the_body_moves_when_it_turns() {
  CameraMount mount;
  mount.position = {0.2, 0, 0};
  const auto scale = scale_by_velocity(circle(), 10, 12, mount);
  TEST_ASSERT_TRUE(scale.has_value());
  // The camera, 0.2 m ahead of the drone's middle, moves from (0.2, 0) to (1, 1) + (0, 0.2).
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, std::hypot(0.8, 1.2), scale->baseline_m);
}

void test_velocity_gives_nothing_over_a_gap_outside_or_at_rest() {
  FlightLog gap = circle();
  gap.erase(gap.begin() + 80, gap.begin() + 120);
  TEST_ASSERT_FALSE(scale_by_velocity(gap, 10.2, 11.8, CameraMount()).has_value());
  TEST_ASSERT_FALSE(scale_by_velocity(circle(), 9, 11, CameraMount()).has_value());
  FlightLog unknown = circle();
  unknown[100].velocity_m_s.reset();
  TEST_ASSERT_FALSE(scale_by_velocity(unknown, 10.2, 11.8, CameraMount()).has_value());
  const FlightLog rest = flight([](double) { return yaw_of(0); },
                                [](double) {
                                  return Vector3{0.01, 0, 0};
                                },
                                [](double) { return 1.0; });
  TEST_ASSERT_FALSE(scale_by_velocity(rest, 10, 12, CameraMount()).has_value());
}

void test_altitude_divides_by_the_vertical_part_of_the_way() {
  // The drone climbs 0.45 m, and its direction rises by 45 degrees.
  const double half = std::sqrt(0.5);
  const auto scale = scale_by_altitude(climb(), 10.2, 11.7, {half, 0, -half}, 0.02, CameraMount());
  TEST_ASSERT_TRUE(scale.has_value());
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.45 / half, scale->baseline_m);
  // The expected sigma has two parts: 0.01 m of each of the two altitudes over the vertical part of
  // the direction; and the baseline times the level part over the vertical part (1), times 0.02 rad
  // of the direction and 0.01 rad of the attitude.
  const double expected =
      std::hypot(0.01 * std::sqrt(2.0) / half, 0.45 / half * std::hypot(0.02, 0.01) * 1.0);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected, scale->sigma_m);
}

void test_altitude_gives_nothing_in_level_flight_or_against_the_way() {
  TEST_ASSERT_FALSE(
      scale_by_altitude(circle(), 10.2, 11.7, {0.9, 0, -0.43}, 0.02, CameraMount()).has_value());
  // Against the way: of that it is certain, and no scale.
  const auto against = scale_by_altitude(climb(), 10.2, 11.7, {0.6, 0, 0.8}, 0.02, CameraMount());
  TEST_ASSERT_TRUE(against.has_value() && against->baseline_m < 0);
  TEST_ASSERT_FALSE(best_scale({against}).has_value());
}

// Two sources that contradict each other leave no scale, and both are named.
void test_contrary_sources_give_no_scale() {
  const MetricScale velocity{"velocity", 1.0, 0.05}, late{"velocity", 0.93, 0.05};
  for (const double factor : {1000.0, 100.0, 2.0, -1.0, 0.01}) {
    const MetricScale altitude{"altitude", factor, 0.04 * std::abs(factor)};
    const auto contrary = contrary_scales({velocity, std::nullopt, altitude});
    TEST_ASSERT_TRUE(contrary.has_value());
    TEST_ASSERT_EQUAL_STRING("velocity", contrary->one.source.c_str());
    TEST_ASSERT_EQUAL_STRING("altitude", contrary->other.source.c_str());
    TEST_ASSERT_FALSE(best_scale({velocity, std::nullopt, altitude}).has_value());
  }
  TEST_ASSERT_FALSE(contrary_scales({velocity, late}).has_value());
  TEST_ASSERT_TRUE(best_scale({velocity, late}).has_value());
  // One that is too vague to be taken is no contradiction either.
  TEST_ASSERT_TRUE(best_scale({velocity, MetricScale{"floor", 9, 3}}).has_value());
}

// The way of velocities has a direction, too.
void test_velocity_against_the_way_gives_no_scale() {
  const auto plain = scale_by_velocity(circle(), 10.2, 11.7, CameraMount());
  TEST_ASSERT_TRUE(plain.has_value());
  // A unit vector that makes no angle with the way is the one whose part of it is the largest.
  double best = 0, best_sigma = 0, worst = 0;
  for (int k = 0; k < 360; ++k) {
    const double angle = k * kPi / 180;
    const Vector3 unit_way = {std::cos(angle), std::sin(angle), 0};
    const auto scale = scale_by_velocity(circle(), 10.2, 11.7, CameraMount(), unit_way);
    const auto back = scale_by_velocity(circle(), 11.7, 10.2, CameraMount(),
                                        Vector3{-unit_way[0], -unit_way[1], 0});
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, scale->baseline_m, back->baseline_m);
    if (scale->baseline_m > best) best = scale->baseline_m, best_sigma = scale->sigma_m;
    worst = std::min(worst, scale->baseline_m);
    const double share = scale->baseline_m / plain->baseline_m;
    TEST_ASSERT_TRUE(share <= 0.9 || best_scale({scale}).has_value());
    TEST_ASSERT_TRUE(share >= 0.7 || !best_scale({scale}).has_value());
  }
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * plain->baseline_m, plain->baseline_m, best);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * plain->baseline_m, plain->sigma_m, best_sigma);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * plain->baseline_m, -plain->baseline_m, worst);
}

// Points of a floor 1.5 m below the camera and of things that stand on it, for a baseline of 0.25
// m.
std::vector<Vector3> floor_points(double pitch, const CameraMount& mount) {
  std::vector<Vector3> points;
  const Matrix3 camera_from_world = transposed(product(pitch_of(pitch), mount.body_from_camera));
  for (int k = 0; k < 300; ++k) {
    const double height = k % 3 == 0 ? 0 : 0.004 * k;  // every third is on the floor
    const Vector3 world = {1.5 + 0.01 * k, -1 + 0.007 * k, 1.5 - height};
    const Vector3 p = applied(camera_from_world, world);
    points.push_back({p[0] / 0.25, p[1] / 0.25, p[2] / 0.25});
  }
  return points;
}

void test_a_seen_floor_gives_the_scale() {
  const CameraMount mount;
  const FlightLog log = flight([](double) { return pitch_of(-0.15); },
                               [](double) {
                                 return Vector3{0, 0, 0};
                               },
                               [](double) { return 1.5; });
  std::vector<Vector3> points = floor_points(-0.15, mount);
  points.push_back({0, 40, 40});  // two wrong points far below the floor
  points.push_back({1, 44, 40});
  const auto scale = scale_by_floor(log, 11, points, mount);
  TEST_ASSERT_TRUE(scale.has_value());
  TEST_ASSERT_DOUBLE_WITHIN(0.004, 0.25, scale->baseline_m);
  TEST_ASSERT_TRUE(scale->sigma_m > 0 && scale->sigma_m < 0.02);
}

void test_no_floor_gives_no_scale() {
  const CameraMount mount;
  const FlightLog log = flight([](double) { return pitch_of(0); },
                               [](double) {
                                 return Vector3{0, 0, 0};
                               },
                               [](double) { return 1.5; });
  std::vector<Vector3> slope;
  for (int k = 0; k < 200; ++k) slope.push_back({0.1 * k, 0.5 + 0.1 * k, 10});
  TEST_ASSERT_FALSE(scale_by_floor(log, 11, slope, mount).has_value());
  TEST_ASSERT_FALSE(scale_by_floor(log, 11, {}, mount).has_value());
}

void test_the_surest_source_wins_and_a_vague_one_is_none() {
  const MetricScale a{"velocity", 1.0, 0.1}, b{"altitude", 1.1, 0.05}, c{"floor", 1.0, 0.5};
  TEST_ASSERT_EQUAL_STRING("altitude", best_scale({a, b, c})->source.c_str());
  TEST_ASSERT_EQUAL_STRING("velocity", best_scale({std::nullopt, a})->source.c_str());
  TEST_ASSERT_FALSE(best_scale({c, std::nullopt}).has_value());
}

void test_attitudes_are_between_their_neighbours_and_never_guessed() {
  const FlightLog log = circle();
  const auto at = sample_at(log, 10.505, 0.05);
  TEST_ASSERT_TRUE(at.has_value());
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::cos(0.505 * kPi / 4), at->world_from_body[0]);
  TEST_ASSERT_FALSE(sample_at(log, 9.99, 0.05).has_value());
  TEST_ASSERT_FALSE(sample_at(log, 12.01, 0.05).has_value());
  FlightLog gap = log;
  gap.erase(gap.begin() + 40, gap.begin() + 60);
  TEST_ASSERT_FALSE(sample_at(gap, 10.505, 0.05).has_value());
}

}  // namespace

extern "C" void setUp() {}
extern "C" void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_velocity_is_integrated_along_the_turns);
  RUN_TEST(test_order_of_the_frames_does_not_matter_to_velocity);
  RUN_TEST(test_a_camera_before_the_body_moves_when_it_turns);
  RUN_TEST(test_velocity_gives_nothing_over_a_gap_outside_or_at_rest);
  RUN_TEST(test_altitude_divides_by_the_vertical_part_of_the_way);
  RUN_TEST(test_altitude_gives_nothing_in_level_flight_or_against_the_way);
  RUN_TEST(test_a_seen_floor_gives_the_scale);
  RUN_TEST(test_no_floor_gives_no_scale);
  RUN_TEST(test_the_surest_source_wins_and_a_vague_one_is_none);
  RUN_TEST(test_contrary_sources_give_no_scale);
  RUN_TEST(test_velocity_against_the_way_gives_no_scale);
  RUN_TEST(test_attitudes_are_between_their_neighbours_and_never_guessed);
  return UNITY_END();
}
