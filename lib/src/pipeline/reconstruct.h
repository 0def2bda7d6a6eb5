// The whole way from two images to a pose and points: one rung of effort after another, as far as a
// further one could help, then guided matching, points and their adjustment, as the options say.
#pragma once

#include "pipeline/rung.h"

namespace tv {

// The results lie at the front of the arena until the next call with the context. *attempt, which
// is given as Attempt{}, is then the last one. Returns how many points have the status TV_POINT_OK.
int32_t reconstruct(tv_context* context, const PairTask& task, PairArrays* arrays,
                    Attempt* attempt);

}  // namespace tv
