// How the motion of true poses contradicts the path that is compared with them: a truth that stands
// or jumps where the path does not, that has noise, that lacks a coordinate, or that is of another
// point than the camera. Only words: nothing is applied.
#pragma once

#include <string>
#include <vector>

#include "odometry/poses.h"

namespace cli {

std::vector<std::string> motion_doubts(const Trajectory& estimate, const Trajectory& truth);

}  // namespace cli
