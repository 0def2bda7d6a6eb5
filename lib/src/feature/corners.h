// FAST corners over a pyramid: found, suppressed, budgeted over a grid, refined below a pixel.
#pragma once

#include "base/arena.h"
#include "image/pyramid.h"
#include "twoview/feature.h"

namespace tv {

size_t corners_bytes(int32_t max_width, int32_t max_height);

// Writes at most `budget` keypoints in descending order of (score, then level, y, x); returns how
// many. keypoints has room for budget.
int32_t find_corners(const tvk_table& kernels, const tv_image& image, const tv_image* mask,
                     const tv_feature_options& options, int32_t budget, Arena& arena,
                     tv_keypoint* keypoints);

}  // namespace tv
