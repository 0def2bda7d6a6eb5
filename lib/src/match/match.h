// Matching: mutual nearest neighbours that pass the ratio test in both directions.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/feature.h"
#include "twoview/match.h"

namespace tv {

// The bytes of the arena that match_descriptors needs for images of at most max_keypoints
// keypoints.
size_t match_bytes(int32_t max_keypoints);

// Returns the number of matches, at most the smaller of both numbers of features. *found points to
// them in the arena, in ascending order of idx0. The keypoints are read where
// options.neighbourhood_px is above 0. The caller's ArenaScope gives the memory back.
int32_t match_descriptors(const tvk_set& set, const tv_features& features0,
                          const tv_features& features1, const tv_match_options& options,
                          Arena& arena, const tv_correspondence** found);

}  // namespace tv
