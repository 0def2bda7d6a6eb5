// How the simulated drone flies: simple, but with the right signs and sizes. Nothing here knows of
// packets, sockets or clocks.
// Body: x forward, y right, z down. World: z down, z = 0 the floor. Angles: yaw clockwise from
// above, pitch nose up, roll right side down are positive.
#pragma once

#include "room/room.h"

namespace simulator {

using room::Mat3;
using room::Vec3;

// Fractions of the limits, each in [-1, 1]: roll + right, pitch + backward, climb + up, turn +
// clockwise.
struct Sticks {
  double roll = 0, pitch = 0, climb = 0, turn = 0;
};

// The drone's own defaults for indoor flight.
struct FlightLimits {
  double tilt_rad = 0.21;
  double climb_m_s = 0.7;
  double turn_rad_s = 1.75;
  double altitude_m = 3.0;
};

enum class FlightMode { kLanded, kTakingOff, kHovering, kFlying, kLanding, kMotorsCut };

// The truth at one instant.
struct FlightState {
  FlightMode mode = FlightMode::kLanded;
  Vec3 position{0, 0, 0};                              // world, metres
  Vec3 velocity{0, 0, 0};                              // world, m/s
  Vec3 acceleration{0, 0, 0};                          // world, m/s^2, without gravity
  double yaw = 0, pitch = 0, roll = 0;                 // radians
  double yaw_rate = 0, pitch_rate = 0, roll_rate = 0;  // rad/s
};

Mat3 world_from_body(const FlightState& state);
// Velocity on the body's axes: what the drone's own estimate is about.
Vec3 body_velocity(const FlightState& state);
// What an ideal accelerometer reads, body axes, m/s^2: (0, 0, -9.81) at rest.
Vec3 specific_force(const FlightState& state);

class Flight {
 public:
  // The room stops the drone where it would touch something. It must outlive the flight.
  Flight(const room::Room& room, const Vec3& start, double yaw_rad);

  void set_limits(const FlightLimits& limits) { limits_ = limits; }
  // Wishes, as the on-board computer understands them; it decides what the mode allows.
  void take_off();
  void land();
  void cut_motors();
  // On the ground again after an emergency.
  void rearm();
  void hover();
  void steer(const Sticks& sticks);

  // Moves on by `seconds`, in steps of at most 5 ms.
  void advance(double seconds);
  const FlightState& state() const { return state_; }
  // Above what lies under the drone, metres.
  double height() const;

 private:
  void step(double dt);
  void tilt_towards(double pitch, double roll, double turn_rad_s, double dt);
  void accelerate(double climb_m_s, double dt);
  void move(double dt);

  const room::Room& room_;
  FlightLimits limits_;
  FlightState state_;
  Sticks sticks_;
};

}  // namespace simulator
