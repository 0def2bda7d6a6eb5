// The lens of a film's camera from the map that was made of it: bundle adjustment of keyframes and
// points together with the focal length and the lens's first coefficient.
// docs/algorithms/focal_length.md.
#pragma once

#include <vector>

#include "odometry/flight.h"
#include "pair/simple_lens.h"

namespace cli {

struct LensEstimate {
  SimpleLens lens;            // k1 is 0 where it does not stand out from its standard deviation
  double focal_variance = 0;  // of the log of the focal length
  bool is_known = false;      // false: the keyframes are too few, and `lens` is the start
};

// Adjusts the lens in windows of successive keyframes of a segment, each with poses and points of
// its own. The keyframes are of pictures of this size, and were tracked with the lens `start`.
LensEstimate adjust_lens(const std::vector<FlightKeyframe>& keyframes,
                         const std::vector<tv_map_point>& points, int width, int height,
                         const SimpleLens& start);

}  // namespace cli
