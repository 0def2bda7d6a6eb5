// The lens of a film's camera from the map that was made of it: bundle adjustment of keyframes and
// points together with the lens, and with the time that the picture's rows take.
// docs/algorithms/focal_length.md.
#pragma once

#include <vector>

#include "odometry/flight.h"
#include "pair/simple_lens.h"

namespace cli {

struct LensEstimate {
  SimpleLens lens;
  double focal_variance = 0;  // of the log of the focal length
  bool is_known = false;      // false: the keyframes are too few, and `lens` is the start
};

// A keyframe and how a point at rest turns and moves in its camera's frame from one frame to the
// next, in radians and in the map's unit; zeros: unknown.
struct LensKeyframe {
  const FlightKeyframe* key = nullptr;
  std::array<double, 3> turn{}, move{};
};

// Adjusts the lens in windows of successive keyframes of a segment, each with poses and points of
// its own. The keyframes are of pictures of this size, and were tracked with the lens `start`.
LensEstimate adjust_lens(const std::vector<LensKeyframe>& keyframes,
                         const std::vector<tv_map_point>& points, int width, int height,
                         const SimpleLens& start);

}  // namespace cli
