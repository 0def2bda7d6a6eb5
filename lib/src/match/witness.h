// Matches that show one place of the scene several times.
#pragma once

#include "base/arena.h"
#include "twoview/feature.h"
#include "twoview/match.h"

namespace tv {

size_t witness_bytes(int32_t max_matches);

// Keeps of all matches of one place the most precise one, and returns how many are left, in their
// order. Matches are of one place where their keypoints are less than kOnePlacePx pixels apart
// along x and along y, in both images: a corner that was found in several views, or on several
// levels, is matched again there, and these matches agree with each other whether they are right or
// wrong; so they are one witness. variances: of each match, that of its position; of equal ones the
// match of the lower rank (rank_of) is kept, so that exchanged images keep the same matches.
inline constexpr float kOnePlacePx = 2;
int32_t keep_witnesses(const tv_keypoint* const keypoints[2], const float* variances,
                       tv_correspondence* matches, int32_t num, Arena& arena);

}  // namespace tv
