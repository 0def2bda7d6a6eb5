// The simulated flight has the signs and magnitudes of real flights.
#include <unity.h>

#include <cmath>

#include "simulator/flight.h"

using simulator::Flight;
using simulator::FlightMode;
using simulator::FlightState;
using simulator::Sticks;
using simulator::Vec3;

namespace {

constexpr double kGravity = 9.81;

const room::Room& the_room() {
  static const room::Room room;
  return room;
}

Flight in_the_air(double yaw = 0) {
  Flight flight(the_room(), {0, 0, 0}, yaw);
  flight.take_off();
  flight.advance(6);
  TEST_ASSERT_TRUE(flight.state().mode == FlightMode::kHovering);
  return flight;
}

Sticks sticks(double roll, double pitch, double climb, double turn) {
  return {roll, pitch, climb, turn};
}

void test_take_off_ends_at_a_metre_and_landing_on_the_floor() {
  Flight flight = in_the_air();
  TEST_ASSERT_TRUE(flight.height() > 0.9 && flight.height() < 1.3);
  flight.land();
  flight.advance(5);
  TEST_ASSERT_TRUE(flight.state().mode == FlightMode::kLanded);
  TEST_ASSERT_TRUE(flight.height() == 0);
}

void test_each_stick_moves_the_way_its_sign_says() {
  struct {
    Sticks sticks;
    double forward, right, up, turn;
  } const cases[] = {
      {sticks(0, -0.5, 0, 0), 1, 0, 0, 0}, {sticks(0, 0.5, 0, 0), -1, 0, 0, 0},
      {sticks(0.5, 0, 0, 0), 0, 1, 0, 0},  {sticks(-0.5, 0, 0, 0), 0, -1, 0, 0},
      {sticks(0, 0, 0.5, 0), 0, 0, 1, 0},  {sticks(0, 0, -0.5, 0), 0, 0, -1, 0},
      {sticks(0, 0, 0, 0.5), 0, 0, 0, 1},  {sticks(0, 0, 0, -0.5), 0, 0, 0, -1},
  };
  for (const auto& c : cases) {
    Flight flight = in_the_air();
    const FlightState before = flight.state();
    flight.steer(c.sticks);
    flight.advance(0.8);
    const FlightState& after = flight.state();
    const double moved[4] = {after.position[0] - before.position[0],
                             after.position[1] - before.position[1],
                             before.position[2] - after.position[2], after.yaw - before.yaw};
    const double wanted[4] = {c.forward, c.right, c.up, c.turn};
    for (int k = 0; k < 4; ++k) {
      TEST_ASSERT_TRUE(wanted[k] == 0 ? std::abs(moved[k]) < 0.05 : moved[k] * wanted[k] > 0.1);
    }
  }
}

void test_tilt_accelerates_by_gravity_as_in_the_flight_log() {
  Flight flight = in_the_air();
  flight.steer(sticks(0, -1, 0, 0));
  flight.advance(0.6);
  const FlightState first = flight.state();
  flight.advance(0.005);
  const double acceleration = (flight.state().velocity[0] - first.velocity[0]) / 0.005;
  TEST_ASSERT_TRUE(first.pitch < -0.15);
  // Two real flights gave -0.146 and -0.166 mm/s^2 per millidegree; without drag the value would be
  // -0.171.
  const double per_millidegree = 1000 * acceleration / (first.pitch * 180000 / 3.14159265358979);
  TEST_ASSERT_TRUE(per_millidegree < -0.14 && per_millidegree > -0.172);
}

void test_body_axes_turn_with_the_drone() {
  // The yaw is 90 degrees: the nose points along the world's y.
  Flight flight = in_the_air(1.5707963267948966);
  flight.steer(sticks(0, -0.6, 0, 0));
  flight.advance(0.8);
  const FlightState& state = flight.state();
  TEST_ASSERT_TRUE(state.velocity[1] > 0.2 && std::abs(state.velocity[0]) < 0.02);
  const Vec3 body = simulator::body_velocity(state);
  TEST_ASSERT_TRUE(body[0] > 0.2 && std::abs(body[1]) < 0.02);
}

void test_hovering_stops_the_drone() {
  Flight flight = in_the_air();
  flight.steer(sticks(0.4, -0.4, 0, 0));
  flight.advance(0.8);
  flight.hover();
  flight.advance(4);
  const Vec3 v = flight.state().velocity;
  TEST_ASSERT_TRUE(std::hypot(std::hypot(v[0], v[1]), v[2]) < 0.05);
  TEST_ASSERT_TRUE(flight.state().mode == FlightMode::kHovering);
}

void test_an_accelerometer_at_rest_reads_minus_gravity_on_z() {
  const Flight flight(the_room(), {0, 0, 0}, 0.3);
  const Vec3 force = simulator::specific_force(flight.state());
  TEST_ASSERT_TRUE(std::abs(force[0]) < 1e-9 && std::abs(force[1]) < 1e-9);
  TEST_ASSERT_TRUE(std::abs(force[2] + kGravity) < 1e-9);
}

void test_cut_motors_fall_and_need_arming() {
  Flight flight = in_the_air();
  flight.cut_motors();
  flight.advance(0.2);
  TEST_ASSERT_TRUE(flight.state().velocity[2] > 1.5);
  flight.rearm();  // must be refused, since the drone is in the air
  TEST_ASSERT_TRUE(flight.state().mode == FlightMode::kMotorsCut);
  flight.advance(2);
  flight.take_off();
  TEST_ASSERT_TRUE(flight.state().mode == FlightMode::kMotorsCut);
  flight.rearm();
  TEST_ASSERT_TRUE(flight.state().mode == FlightMode::kLanded);
}

void test_walls_stop_it_and_limits_hold() {
  Flight flight = in_the_air();
  flight.steer(sticks(0, -1, 0, 0));
  flight.advance(20);
  TEST_ASSERT_TRUE(the_room().is_free(flight.state().position, 0.299));
  flight.steer(sticks(0, 0, 1, 0));
  flight.advance(10);
  TEST_ASSERT_TRUE(flight.height() < 3.05);
  flight.steer(sticks(0, 0, -1, 0));
  flight.advance(10);
  TEST_ASSERT_TRUE(flight.height() > 0.2);
}

void test_small_steps_and_large_ones_fly_the_same_way() {
  Flight one = in_the_air(), many = in_the_air();
  one.steer(sticks(0.2, -0.3, 0.1, 0.3));
  many.steer(sticks(0.2, -0.3, 0.1, 0.3));
  one.advance(1);
  for (int k = 0; k < 1000; ++k) many.advance(0.001);
  for (size_t k = 0; k < 3; ++k) {
    TEST_ASSERT_TRUE(std::abs(one.state().position[k] - many.state().position[k]) < 0.02);
  }
}

}  // namespace

extern "C" void setUp() {}
extern "C" void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_take_off_ends_at_a_metre_and_landing_on_the_floor);
  RUN_TEST(test_each_stick_moves_the_way_its_sign_says);
  RUN_TEST(test_tilt_accelerates_by_gravity_as_in_the_flight_log);
  RUN_TEST(test_body_axes_turn_with_the_drone);
  RUN_TEST(test_hovering_stops_the_drone);
  RUN_TEST(test_an_accelerometer_at_rest_reads_minus_gravity_on_z);
  RUN_TEST(test_cut_motors_fall_and_need_arming);
  RUN_TEST(test_walls_stop_it_and_limits_hold);
  RUN_TEST(test_small_steps_and_large_ones_fly_the_same_way);
  return UNITY_END();
}
