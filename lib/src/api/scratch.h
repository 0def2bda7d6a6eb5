// How many bytes of arena the calls with one context need. tv_context_size reports this number plus
// the bytes of the tv_context itself.
#pragma once

#include <cstddef>

#include "twoview/context.h"

namespace tv {

// In all of these functions limits.max_matches and limits.purposes must already be resolved (not
// 0).
size_t scratch_bytes(const tv_limits& limits);

// The most keypoints of an image, over the rungs of effort.
int32_t most_keypoints(const tv_limits& limits);

// How many matches of tv_reconstruct there is room for after the best were chosen.
int32_t most_chosen_matches(const tv_limits& limits);

}  // namespace tv
