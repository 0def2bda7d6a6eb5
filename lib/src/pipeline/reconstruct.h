// The whole way from two images to a pose and points: one rung of effort after another, as far as a
// further one could help, then guided matching, points and their adjustment, as the options say.
#pragma once

#include "pipeline/rung.h"

namespace tv {

// The results lie at the front of the arena until the next call with the context. *attempt, which
// is given as Attempt{}, is then the last one. Returns how many points have the status TV_POINT_OK.
int32_t reconstruct(tv_context* context, const PairTask& task, PairArrays* arrays,
                    Attempt* attempt);

// Whether more keypoints or views could give what a pose that is not "ok" lacks. What it lacks by
// the cameras alone, in enough places, none gives; and with cameras that the matches contradict
// some of them have a motion of their own, which more matches may only hide.
// docs/algorithms/effort.md.
bool more_could_help(const PairResult& pose);

}  // namespace tv
