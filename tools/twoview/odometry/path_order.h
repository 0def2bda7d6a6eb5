// Whether the pictures of a source follow each other in the order in which they were taken, by the
// path that came out: each picture finds its place in the map, in whatever order it comes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "odometry/flight_frame.h"
#include "twoview/odometry.h"

namespace cli {

// A line where the frames of this segment, in their order, go to and fro between places that a
// shorter way joins, or where the camera jumps once: pictures that are missing, of another take, or
// in another order. Empty where neither is so.
std::string path_order_words(const std::vector<FlightFrame>& frames,
                             const std::vector<tv_map_point>& points, int32_t segment);

}  // namespace cli
