// How the report and the live page look at a map.
#pragma once

#include <cstdint>
#include <vector>

#include "base/matrix.h"
#include "odometry/flight.h"

namespace cli {

struct MapView {
  // The rows are the directions to the right, down and ahead; in the world they are turned so that
  // up is up.
  Matrix3 view_from_world{1, 0, 0, 0, 1, 0, 0, 0, 1};
  // Whether the vehicle's attitudes say where up is; else it is taken from how the camera was held.
  bool is_measured = false;
};

// The view of a segment of the map. Ahead is where its first keyframe looks, or, where the world's
// z axis points down, along its x axis.
MapView view_of(const Flight& flight, const std::vector<FlightKeyframe>& keyframes,
                int32_t segment);

}  // namespace cli
