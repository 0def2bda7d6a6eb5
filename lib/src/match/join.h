// Sets of matches: two sets as one, and the best of a set.
#pragma once

#include "base/arena.h"
#include "twoview/match.h"

namespace tv {

// Merges `matches` into `found`, which has room for both: removes the found matches that use a
// keypoint of `matches`, then inserts `matches` so that idx0 ascends, as it does in both. Returns
// how many matches `found` then holds. Takes 2 bytes of the arena for each of max_keypoints.
int32_t join_matches(const tv_correspondence* matches, int32_t num_matches, Arena& arena,
                     int32_t max_keypoints, tv_correspondence* found, int32_t num_found);

// Keeps the best matches (rank_of), at most `most`, in their order; returns how many it left out.
// Where two of equal rank compete for the last place, neither gets it.
int32_t keep_best(tv_correspondence* matches, int32_t most, int32_t* num_matches);

}  // namespace tv
