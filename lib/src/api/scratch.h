// How much arena the calls of one context need: the sum that tv_context_size answers with.
#pragma once

#include <cstddef>

#include "twoview/context.h"

namespace tv {

// limits.max_matches and limits.purposes are resolved (not 0).
size_t scratch_bytes(const tv_limits& limits);

// The parts of it that a single stage takes.
size_t extract_scratch_bytes(const tv_limits& limits);
size_t guided_scratch_bytes(const tv_limits& limits);
size_t reconstruct_result_bytes(const tv_limits& limits);

}  // namespace tv
