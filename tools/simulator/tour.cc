#include "simulator/tour.h"

#include <algorithm>
#include <cmath>

namespace simulator {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSpeed = 1.0;       // m/s of the aim that the drone follows
constexpr double kLead = 0.8;        // m, how far the aim may be ahead
constexpr double kInward = 0.45;     // rad, by which the nose points from the way into the room
constexpr double kPerMetre = 1.6;    // m/s that are wanted for each metre to the aim
constexpr double kPerSpeed = 0.9;    // stick for each m/s that is wanted in addition
constexpr double kPerHeight = 1.5;   // stick for each metre of height
constexpr double kPerAngle = 0.9;    // stick for each radian of heading
constexpr double kTurn = 0.45;       // most of the turning stick
constexpr double kTilt = 0.9;        // most of the tilting sticks
constexpr double kNear = 0.15;       // m, where the way counts as flown
constexpr double kLookAhead = 0.35;  // m, between the two points that give the way's direction

double between(const Vec3& a, const Vec3& b) { return std::hypot(b[0] - a[0], b[1] - a[1]); }

}  // namespace

Tour::Tour(const Vec3& start) {
  points_ = {
      {start[0], start[1], -1.2}, {-1.0, -2.3, -1.3}, {1.6, -2.3, -1.5},         {2.4, -1.3, -1.4},
      {3.8, -0.9, -1.3},          {5.3, -0.9, -1.5},  {6.1, 0.3, -1.5},          {6.0, 1.9, -1.6},
      {4.9, 1.9, -1.5},           {4.2, 1.0, -1.4},   {4.9, 0.1, -1.4},          {6.1, 0.5, -1.5},
      {6.0, 1.9, -1.6},           {4.6, 1.8, -1.5},   {2.4, 1.6, -1.4},          {0.8, 2.4, -1.5},
      {-1.0, 2.4, -1.3},          {-1.2, 0, -1.2},    {start[0], start[1], -1.2}};
}

double Tour::length() const {
  double sum = 0;
  for (size_t k = 1; k < points_.size(); ++k) sum += between(points_[k - 1], points_[k]);
  return sum;
}

Vec3 Tour::at(double way) const {
  for (size_t k = 1; k < points_.size(); ++k) {
    const Vec3 &a = points_[k - 1], &b = points_[k];
    const double leg = between(a, b);
    if (way <= leg && leg > 0) {
      const double share = std::max(way, 0.0) / leg;
      return {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]),
              a[2] + share * (b[2] - a[2])};
    }
    way -= leg;
  }
  return points_.back();
}

void Tour::steer(Flight& flight, double seconds) {
  const FlightState& state = flight.state();
  if (has_ended_) return;
  if (!has_taken_off_) {
    flight.take_off();
    has_taken_off_ = true;
  }
  if (state.mode != FlightMode::kHovering && state.mode != FlightMode::kFlying) return;
  const double whole = length();
  if (between(state.position, at(way_)) < kLead) way_ = std::min(way_ + kSpeed * seconds, whole);
  const Vec3 aim = at(way_);
  const double left = between(state.position, aim);
  if (way_ >= whole && left < kNear) {
    flight.hover();
    flight.land();
    has_ended_ = true;
    return;
  }
  // The nose points along the way, turned into the room; near the end of the way as before.
  const Vec3 from = at(std::min(way_, whole - kLookAhead)),
             to = at(std::min(way_, whole - kLookAhead) + kLookAhead);
  const double heading = std::atan2(to[1] - from[1], to[0] - from[0]) + kInward;
  const double c = std::cos(state.yaw), s = std::sin(state.yaw);
  const double add[2] = {kPerMetre * (aim[0] - state.position[0]) - state.velocity[0],
                         kPerMetre * (aim[1] - state.position[1]) - state.velocity[1]};
  const auto stick = [](double value, double most) { return std::clamp(value, -most, most); };
  Sticks sticks;
  sticks.pitch = stick(-kPerSpeed * (c * add[0] + s * add[1]), kTilt);
  sticks.roll = stick(kPerSpeed * (c * add[1] - s * add[0]), kTilt);
  sticks.climb = stick(kPerHeight * (state.position[2] - aim[2]), kTilt);
  sticks.turn = stick(kPerAngle * std::remainder(heading - state.yaw, 2 * kPi), kTurn);
  flight.steer(sticks);
}

}  // namespace simulator
