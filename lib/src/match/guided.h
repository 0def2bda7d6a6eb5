// A second matching pass, along the epipolar lines of a first estimate. The match layer knows no
// cameras: a view comes as rays and their slopes.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/match.h"

namespace tv {

// One view's keypoints. A ray is any multiple of the direction through the pixel; slopes are
// d ray / d pixel, 3x2 row-major. A keypoint without a ray (valid 0) is never matched.
struct GuidedView {
  const tv_keypoint* keypoints;
  const uint8_t* descriptors;
  const double* rays;    // 3 each
  const double* slopes;  // 6 each
  const uint8_t* valid;
  int32_t num;
};

// Scratch of match_guided.
size_t guided_bytes(int32_t max_keypoints);

// ray1' M ray0 = 0 is the epipolar constraint, M row-major. Writes at most min(view0.num,
// view1.num) correspondences in ascending order of idx0; returns how many.
int32_t match_guided(const tvk_table& kernels, const GuidedView& view0, const GuidedView& view1,
                     const double M[9], const tv_guided_options& options, Arena& arena,
                     tv_correspondence* correspondences);

}  // namespace tv
