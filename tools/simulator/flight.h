// A simple model of how the simulated drone flies, with correct signs and magnitudes. It uses no
// packets, sockets or clocks.
// Body frame: x forward, y right, z down. World frame: z down, and the floor is z = 0. Positive
// angles: yaw clockwise from above, pitch with the nose up, roll with the right side down.
#pragma once

#include "room/room.h"

namespace simulator {

using room::Mat3;
using room::Vec3;

// The sticks as fractions of the limits, each in [-1, 1]. Positive: roll right, pitch backward,
// climb up, turn clockwise.
struct Sticks {
  double roll = 0, pitch = 0, climb = 0, turn = 0;
};

// The limits of flight; the defaults are the drone's own for indoor flight.
struct FlightLimits {
  double tilt_rad = 0.21;
  double climb_m_s = 0.7;
  double turn_rad_s = 1.75;
  double altitude_m = 3.0;
};

enum class FlightMode { kLanded, kTakingOff, kHovering, kFlying, kLanding, kMotorsCut };

// The true state of the drone at one instant.
struct FlightState {
  FlightMode mode = FlightMode::kLanded;
  Vec3 position{0, 0, 0};                              // in the world frame, metres
  Vec3 velocity{0, 0, 0};                              // in the world frame, m/s
  Vec3 acceleration{0, 0, 0};                          // in the world frame, m/s^2, without gravity
  double yaw = 0, pitch = 0, roll = 0;                 // radians
  double yaw_rate = 0, pitch_rate = 0, roll_rate = 0;  // rad/s
};

Mat3 world_from_body(const FlightState& state);
// The velocity on the body's axes, which the drone's own velocity estimate approximates.
Vec3 body_velocity(const FlightState& state);
// The reading of an ideal accelerometer on body axes, in m/s^2: (0, 0, -9.81) at rest and level.
Vec3 specific_force(const FlightState& state);

class Flight {
 public:
  // The drone stops where it would touch the room, which must outlive this object.
  Flight(const room::Room& room, const Vec3& start, double yaw_rad);

  void set_limits(const FlightLimits& limits) { limits_ = limits; }
  // Requests from the controller. The drone executes a request only if its mode allows it.
  void take_off();
  void land();
  void cut_motors();
  // Ends an emergency: the drone returns from kMotorsCut to kLanded if it is on the ground.
  void rearm();
  void hover();
  void steer(const Sticks& sticks);

  // Advances the flight by `seconds`, in steps of at most 5 ms.
  void advance(double seconds);
  const FlightState& state() const { return state_; }
  // The height above the floor or furniture below the drone, in metres.
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
