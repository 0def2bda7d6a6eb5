// What contradicts a file of true poses when it is compared with a path, beside the unit of its
// times and the order of its quaternions (odometry/truth_fit.h). Only words: nothing is applied.
#pragma once

#include <string>
#include <vector>

#include "odometry/truth_fit.h"

namespace cli {

// Lines on a clock that is whole frames, or a rate, off that of the frames (the turns of both then
// fit at another time), and on positions that are latitude and longitude in degrees, or the path's
// mirror image, or else on its motion (odometry/truth_motion.h); empty where the truth fits as it
// is, and where nothing else fits clearly better.
std::vector<std::string> truth_doubts(const Trajectory& estimate, const TruePoses& truth,
                                      const FrameClock& clock);

}  // namespace cli
