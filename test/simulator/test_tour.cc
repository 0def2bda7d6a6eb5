// The tour of the simulated drone leads through the whole room, touches nothing, and ends where it
// began.
#include <unity.h>

#include <algorithm>
#include <cmath>

#include "simulator/tour.h"

namespace {

constexpr double kStep = 0.005;  // s

void test_the_tour_covers_the_room_and_lands_where_it_took_off() {
  const room::Room room;
  simulator::Flight flight(room, {0, 0, 0}, 0);
  simulator::Tour tour({0, 0, 0});
  double seconds = 0, way = 0, fastest_turn = 0, low[2] = {0, 0}, high[2] = {0, 0};
  const auto is_over = [&] {
    return tour.has_ended() && flight.state().mode == simulator::FlightMode::kLanded;
  };
  for (; seconds < 60 && !is_over(); seconds += kStep) {
    tour.steer(flight, kStep);
    const simulator::Vec3 before = flight.state().position;
    flight.advance(kStep);
    const simulator::FlightState& state = flight.state();
    way += std::hypot(state.position[0] - before[0], state.position[1] - before[1]);
    fastest_turn = std::max(fastest_turn, std::abs(state.yaw_rate));
    for (size_t k = 0; k < 2; ++k) {
      low[k] = std::min(low[k], state.position[k]);
      high[k] = std::max(high[k], state.position[k]);
    }
    // Where the drone would touch something, Flight stops it.
    const bool flies = state.mode == simulator::FlightMode::kFlying && seconds > 5;
    TEST_ASSERT_TRUE_MESSAGE(!flies || std::hypot(state.velocity[0], state.velocity[1]) > 0.005,
                             "it was stopped");
  }
  TEST_ASSERT_TRUE(is_over());
  TEST_ASSERT_DOUBLE_WITHIN(0.1 * tour.length(), tour.length(), way);
  TEST_ASSERT_TRUE(fastest_turn < 1);  // rad/s
  // Within 1.3 m of each wall.
  TEST_ASSERT_TRUE(low[0] < -0.7 && low[1] < -2.2 && high[0] > 5.7 && high[1] > 2.2);
  TEST_ASSERT_DOUBLE_WITHIN(0.4, 0, flight.state().position[0]);
  TEST_ASSERT_DOUBLE_WITHIN(0.4, 0, flight.state().position[1]);
}

}  // namespace

void setUp(void) {}
void tearDown(void) {}
int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_tour_covers_the_room_and_lands_where_it_took_off);
  return UNITY_END();
}
