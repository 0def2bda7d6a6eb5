// Where a frame can be that was found in the finished map: a place that looks the same elsewhere,
// as on a wall with a pattern, is farther from the tracked frames before and after it than the
// camera can have flown in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "odometry/flight_frame.h"

namespace cli {

class Reach {
 public:
  // The frames with their final poses; they must outlive this, and are read when it is asked.
  explicit Reach(const std::vector<FlightFrame>& frames);

  // Whether the frame of this index can be at this place of the segment.
  bool contains(size_t index, int32_t segment, const Vector3& place) const;

 private:
  const std::vector<FlightFrame>& frames_;
  // Of each segment: the largest speed between two tracked frames that follow each other, in units
  // of the map a second.
  std::map<int32_t, double> speed_;
};

}  // namespace cli
