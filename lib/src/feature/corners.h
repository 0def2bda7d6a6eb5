// FAST corners over a pyramid: detection, non-maximum suppression, the distribution of the budget
// over levels and grid cells, and sub-pixel refinement.
#pragma once

#include "base/arena.h"
#include "image/pyramid.h"
#include "twoview/feature.h"

namespace tv {

size_t corners_bytes(int32_t max_width, int32_t max_height);

// Writes at most `budget` keypoints, in descending order of score, then in ascending order of
// level, y and x. Returns their number. `keypoints` has room for `budget` elements; the arena needs
// corners_bytes and room for as many keypoints.
int32_t find_corners(const tvk_set& set, const tv_image& image, const tv_image* mask,
                     const tv_feature_options& options, int32_t budget, Arena& arena,
                     tv_keypoint* keypoints);

}  // namespace tv
