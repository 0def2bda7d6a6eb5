// The rivals of the epipolar model (a rotation, a homography, no motion), fitted to its inliers.
#pragma once

#include "geometry/homography_4pt.h"
#include "robust/estimators.h"

namespace tv {

// The rivals, found among the epipolar model's inliers, and counted over all different matches.
struct Rivals {
  bool has_rotation, has_homography;
  Mat3 R = Mat3::Identity(), H = Mat3::Zero();  // both map rays of view 0 to rays of view 1
  int rotation_inliers, homography_inliers, identity_inliers;
};

// The rotation and the homography that explain most of the listed matches; one that explains less
// than least_share of them may be missed.
Rivals find_rivals(const Matches& matches, const int32_t* support, int num_support, bool calibrated,
                   double least_share, double threshold_px, uint64_t seed, Arena& arena);

size_t rivals_bytes(int max_matches);

}  // namespace tv
