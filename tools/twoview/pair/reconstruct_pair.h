// Reconstructs a pair of images: from pixels to pose and points.
#pragma once

#include <cstdint>

#include "pair/options.h"
#include "pair/result.h"
#include "pair/session.h"

namespace cli {

// Reconstructs from outcome.picture and outcome.camera, and fills outcome.two_view and
// outcome.reconstruction. Returns the wall time of the library's call in nanoseconds. Throws
// BadInput when the library refuses.
uint64_t reconstruct_pair(Session& session, const Options& options, Outcome& outcome);

}  // namespace cli
