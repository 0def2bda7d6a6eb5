// Matching: mutual nearest neighbours that pass the ratio test in both directions.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/match.h"

namespace tv {

// The bytes of the arena that match_descriptors needs, together with an array for its result, for
// images of at most max_keypoints keypoints.
size_t match_bytes(int32_t max_keypoints);

// Writes at most min(num0, num1) correspondences in ascending order of idx0. Returns their number.
int32_t match_descriptors(const tvk_table& kernels, const uint8_t* descriptors0, int32_t num0,
                          const uint8_t* descriptors1, int32_t num1, float ratio, Arena& arena,
                          tv_correspondence* correspondences);

}  // namespace tv
