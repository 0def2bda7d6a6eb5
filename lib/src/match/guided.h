// Guided matching: a second matching pass along the epipolar lines of a first estimate. This layer
// knows no cameras; the caller passes each view as rays and their derivatives.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/match.h"

namespace tv {

// One view's keypoints. A ray is any multiple except 0 of the direction through the pixel; slopes
// are its derivatives d ray / d pixel, 3x2 row-major. Keypoints with valid = 0 have no ray and are
// never matched.
struct GuidedView {
  const tv_keypoint* keypoints;
  const uint8_t* descriptors;
  const double* rays;    // 3 numbers per keypoint
  const double* slopes;  // 6 numbers per keypoint
  const uint8_t* valid;
  int32_t num;
};

// The bytes of the arena that the rays, slopes and flags of one view take.
size_t guided_view_bytes(int32_t max_keypoints);
// The bytes of the arena that match_guided needs for views of at most max_keypoints keypoints.
size_t guided_bytes(int32_t max_keypoints);

// Matches the keypoints near each other's epipolar lines: ray1' M ray0 = 0, M row-major. Writes at
// most min(view0.num, view1.num) correspondences in ascending order of idx0 and returns their
// number.
int32_t match_guided(const tvk_set& set, const GuidedView& view0, const GuidedView& view1,
                     const double M[9], const tv_guided_options& options, Arena& arena,
                     tv_correspondence* correspondences);

}  // namespace tv
