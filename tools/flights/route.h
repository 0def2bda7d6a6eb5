// How a drone flies through a room: take-off, along the walls, round the table, and back to where
// it began, with the attitudes that its accelerations need.
#pragma once

#include <vector>

#include "flights/interior.h"

namespace flights {

struct RouteOptions {
  uint64_t seed = 0;
  double max_seconds = 20;
  // Turns by 180 degrees on the spot after half of the walls; the position then stands still.
  bool has_half_turn = false;
  double tremble = 1;  // vibration: 1 is a degree at most and some millimetres
};

struct BodyState {
  Vec3 position, velocity;  // world, metres, m/s
  double yaw, pitch, roll;  // radians
};

class Route {
 public:
  Route(const Interior& interior, const RouteOptions& options);
  double seconds() const { return kStep * static_cast<double>(states_.size() - 1); }
  BodyState at(double time) const;
  double path_length() const;
  double half_turn_begins() const { return turn_begins_; }  // seconds; below 0: there is none
  double half_turn_ends() const { return turn_ends_; }
  // Shifts and turns the world: x_new = R_z(-yaw) (x - origin).
  void move_world(const Vec3& origin, double yaw_rad);
  // The distance from the path to the nearest point of a box, metres.
  double clearance(const Box& box) const;

 private:
  static constexpr double kStep = 0.0025;  // seconds
  void derive();
  std::vector<BodyState> states_;
  std::vector<Vec3> tremble_angle_;  // yaw, pitch and roll, radians
  double turn_begins_ = -1, turn_ends_ = -1;
};

}  // namespace flights
