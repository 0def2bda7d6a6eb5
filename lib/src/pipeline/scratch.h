// How many bytes of arena the calls with one context need. tv_context_size reports this number plus
// the bytes of the tv_context itself.
#pragma once

#include <cstddef>

#include "twoview/context.h"

namespace tv {

// limits.max_matches and limits.purposes must already be resolved (not 0).
size_t scratch_bytes(const tv_limits& limits);

}  // namespace tv
