// The dense cloud of a pair whose pose is known.
#pragma once

#include "pair/result.h"

namespace cli {

constexpr int32_t kMostDensePoints = 4000000;

// Computes up to `most` dense points of an outcome with a full pose, in the cameras that its pose
// refers to. Without a full pose it does nothing. Returns the time in nanoseconds.
uint64_t densify_pair(int32_t most, Outcome& outcome);

}  // namespace cli
