// Guided matching of two views' keypoints: their rays through the cameras, which the match layer
// does not know, and match/guided.h.
#pragma once

#include "pipeline/context.h"
#include "twoview/match.h"

namespace tv {

// All arguments are checked; the cameras of *epipolar may both be null. *found, in ascending order
// of idx0, lies in the arena, whose scope is the caller's. Returns how many there are, at most the
// smaller of both numbers of features.
int32_t match_epipolar(tv_context* context, const tv_epipolar& epipolar,
                       const tv_features& features0, const tv_features& features1,
                       const tv_guided_options& options, const tv_correspondence** found);

}  // namespace tv
