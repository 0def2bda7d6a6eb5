#include "simulator/flight.h"

#include <algorithm>
#include <cmath>

namespace simulator {
namespace {

constexpr double kGravity = 9.81;      // m/s^2
constexpr double kStep = 0.005;        // s, longest time step of the integration
constexpr double kTiltDelay = 0.12;    // s until 63 % of the commanded angle is reached
constexpr double kClimbDelay = 0.25;   // s until 63 % of the commanded climb rate is reached
constexpr double kTurnDelay = 0.15;    // s until 63 % of the commanded turn rate is reached
constexpr double kDrag = 0.25;         // 1/s, deceleration by air drag for each m/s
constexpr double kBrake = 0.16;        // rad of tilt per m/s of speed, while hovering
constexpr double kHoverHeight = 1.0;   // m, height at which a take-off ends
constexpr double kLandingSpeed = 0.5;  // m/s
constexpr double kTakeOffSpeed = 0.6;  // m/s
constexpr double kBodyRadius = 0.3;    // m, from the drone's centre to the propellers' guards
constexpr double kLowest = 0.3;        // m above the ground; a flying drone that is lower climbs
constexpr double kRecovery = 0.1;      // m/s, climb rate below kLowest

Vec3 rotate_back(const Mat3& m, const Vec3& v) {
  Vec3 out{};
  for (size_t i = 0; i < 3; ++i) out[i] = m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2];
  return out;
}

}  // namespace

Mat3 world_from_body(const FlightState& state) {
  return room::world_from_body(state.yaw, state.pitch, state.roll);
}

Vec3 body_velocity(const FlightState& state) {
  return rotate_back(world_from_body(state), state.velocity);
}

Vec3 specific_force(const FlightState& state) {
  const Vec3 force{state.acceleration[0], state.acceleration[1], state.acceleration[2] - kGravity};
  return rotate_back(world_from_body(state), force);
}

Flight::Flight(const room::Room& room, const Vec3& start, double yaw_rad) : room_(room) {
  state_.position = start;
  state_.yaw = yaw_rad;
}

double Flight::height() const { return room_.height_above_ground(state_.position); }

void Flight::take_off() {
  if (state_.mode == FlightMode::kLanded) state_.mode = FlightMode::kTakingOff;
}

void Flight::land() {
  const bool in_air = state_.mode != FlightMode::kLanded && state_.mode != FlightMode::kMotorsCut;
  if (in_air) state_.mode = FlightMode::kLanding;
}

void Flight::cut_motors() { state_.mode = FlightMode::kMotorsCut; }

void Flight::rearm() {
  if (state_.mode == FlightMode::kMotorsCut && height() <= 0) state_.mode = FlightMode::kLanded;
}

void Flight::hover() {
  if (state_.mode == FlightMode::kFlying) state_.mode = FlightMode::kHovering;
}

void Flight::steer(const Sticks& sticks) {
  sticks_ = sticks;
  if (state_.mode == FlightMode::kHovering) state_.mode = FlightMode::kFlying;
}

void Flight::advance(double seconds) {
  while (seconds > 0) {
    const double dt = std::min(seconds, kStep);
    step(dt);
    seconds -= dt;
  }
}

void Flight::step(double dt) {
  // The velocity along horizontal axes that turn with the yaw: forward and right.
  const double forward =
      std::cos(state_.yaw) * state_.velocity[0] + std::sin(state_.yaw) * state_.velocity[1];
  const double right =
      std::cos(state_.yaw) * state_.velocity[1] - std::sin(state_.yaw) * state_.velocity[0];
  const double brake_pitch = std::clamp(kBrake * forward, -limits_.tilt_rad, limits_.tilt_rad);
  const double brake_roll = std::clamp(-kBrake * right, -limits_.tilt_rad, limits_.tilt_rad);
  switch (state_.mode) {
    case FlightMode::kLanded:
      state_.velocity = state_.acceleration = {0, 0, 0};
      tilt_towards(0, 0, 0, dt);
      return;
    case FlightMode::kTakingOff:
      tilt_towards(brake_pitch, brake_roll, 0, dt);
      accelerate(kTakeOffSpeed, dt);
      if (height() >= kHoverHeight) state_.mode = FlightMode::kHovering;
      break;
    case FlightMode::kHovering:
      tilt_towards(brake_pitch, brake_roll, 0, dt);
      accelerate(0, dt);
      break;
    case FlightMode::kFlying:
      tilt_towards(sticks_.pitch * limits_.tilt_rad, sticks_.roll * limits_.tilt_rad,
                   sticks_.turn * limits_.turn_rad_s, dt);
      accelerate(sticks_.climb * limits_.climb_m_s, dt);
      break;
    case FlightMode::kLanding:
      tilt_towards(brake_pitch, brake_roll, 0, dt);
      accelerate(-kLandingSpeed, dt);
      break;
    case FlightMode::kMotorsCut:
      state_.acceleration = {0, 0, kGravity};
      for (size_t k = 0; k < 3; ++k) state_.velocity[k] += state_.acceleration[k] * dt;
      break;
  }
  move(dt);
}

void Flight::tilt_towards(double pitch, double roll, double turn_rad_s, double dt) {
  const double share = 1 - std::exp(-dt / kTiltDelay);
  const double pitch_change = (pitch - state_.pitch) * share;
  const double roll_change = (roll - state_.roll) * share;
  state_.pitch += pitch_change;
  state_.roll += roll_change;
  state_.pitch_rate = pitch_change / dt;
  state_.roll_rate = roll_change / dt;
  state_.yaw_rate += (turn_rad_s - state_.yaw_rate) * (1 - std::exp(-dt / kTurnDelay));
  state_.yaw = std::remainder(state_.yaw + state_.yaw_rate * dt, 2 * 3.14159265358979323846);
}

// The thrust compensates the vertical force that a tilt removes, so that only a level acceleration
// of g tan(tilt) remains. A lowered nose accelerates forward, a lowered right side to the right.
void Flight::accelerate(double climb_m_s, double dt) {
  const double forward = -kGravity * std::tan(state_.pitch);
  const double right = kGravity * std::tan(state_.roll) / std::cos(state_.pitch);
  const double up_limit = height() >= limits_.altitude_m ? 0.0 : climb_m_s;
  const bool is_too_low = state_.mode == FlightMode::kFlying && height() <= kLowest;
  const double climb = is_too_low ? std::max(up_limit, kRecovery) : up_limit;
  state_.acceleration = {
      std::cos(state_.yaw) * forward - std::sin(state_.yaw) * right - kDrag * state_.velocity[0],
      std::sin(state_.yaw) * forward + std::cos(state_.yaw) * right - kDrag * state_.velocity[1],
      (-climb - state_.velocity[2]) / kClimbDelay};
  for (size_t k = 0; k < 3; ++k) state_.velocity[k] += state_.acceleration[k] * dt;
}

void Flight::move(double dt) {
  Vec3 next = state_.position;
  for (size_t k = 0; k < 3; ++k) next[k] += state_.velocity[k] * dt;
  const double ground = room_.height_above_ground(next) + next[2];
  if (next[2] >= ground) {
    next[2] = ground;
    state_.velocity = {0, 0, 0};
    if (state_.mode == FlightMode::kLanding) state_.mode = FlightMode::kLanded;
  }
  // Furniture and walls stop the drone. Contact with the floor is no obstacle, since the drone
  // stands on it.
  const Vec3 above{next[0], next[1], std::min(next[2], ground - kBodyRadius)};
  if (room_.is_free(above, kBodyRadius)) {
    state_.position = next;
    return;
  }
  state_.velocity = {0, 0, 0};
  if (state_.mode == FlightMode::kLanding || state_.mode == FlightMode::kMotorsCut) {
    state_.position[2] = std::min(state_.position[2] + kLandingSpeed * dt, ground);
    if (state_.position[2] >= ground && state_.mode == FlightMode::kLanding)
      state_.mode = FlightMode::kLanded;
  }
}

}  // namespace simulator
