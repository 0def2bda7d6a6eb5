// A flight through the whole room that the simulated drone makes by itself: take-off, along the
// walls, round the pillar that stands beside the table, back, and landing.
#pragma once

#include <cstddef>
#include <vector>

#include "simulator/flight.h"

namespace simulator {

class Tour {
 public:
  // Makes the way of the tour: it begins and ends above `start`, on the floor.
  explicit Tour(const Vec3& start);

  // Steers the drone for the next `seconds`. Call it often.
  void steer(Flight& flight, double seconds);
  bool has_ended() const { return has_ended_; }
  // The whole way on the floor's plane, in metres, and the points it leads through.
  double length() const;
  const std::vector<Vec3>& points() const { return points_; }

 private:
  Vec3 at(double way) const;

  std::vector<Vec3> points_;
  double way_ = 0;  // metres that the aim has covered
  bool has_taken_off_ = false, has_ended_ = false;
};

}  // namespace simulator
