#include "api/scratch.h"

#include <algorithm>

#include "feature/corners.h"
#include "match/match.h"
#include "odometry/absolute_pose.h"
#include "robust/bundle.h"
#include "robust/two_view.h"
#include "twoview/reconstruct.h"

namespace tv {

// Two arrays of keypoints: what was found, and its order while corners are found, or the oriented
// keypoints afterwards.
size_t extract_scratch_bytes(const tv_limits& limits) {
  const size_t keypoints = arena_bytes<tv_keypoint>(static_cast<size_t>(limits.max_keypoints));
  return 2 * keypoints + std::max(corners_bytes(limits.max_width, limits.max_height),
                                  octaves_bytes(limits.max_width, limits.max_height));
}

size_t reconstruct_result_bytes(const tv_limits& limits) {
  const size_t n = static_cast<size_t>(limits.max_keypoints);
  return 2 * (arena_bytes<tv_keypoint>(n) + arena_bytes<uint8_t>(n * TV_DESCRIPTOR_BYTES) +
              arena_bytes<double>(2 * n) + arena_bytes<float>(n)) +
         2 * (arena_bytes<tv_correspondence>(n) + arena_bytes<uint8_t>(n)) +
         arena_bytes<tv_point>(n) + arena_bytes<float>(n);
}

size_t scratch_bytes(const tv_limits& limits) {
  const size_t of_purpose[] = {extract_scratch_bytes(limits),
                               match_bytes(limits.max_keypoints),
                               two_view_scratch_bytes(limits.max_matches),
                               0,  // tv_reconstruct: the bytes of its results are added below
                               guided_scratch_bytes(limits),
                               bundle_scratch_bytes(limits.max_matches),
                               absolute_pose_bytes(limits.max_matches)};
  size_t stage = 0;
  for (unsigned bit = 0; bit < 7; ++bit) {
    if ((limits.purposes >> bit & 1) != 0) stage = std::max(stage, of_purpose[bit]);
  }
  return stage + ((limits.purposes >> 3 & 1) != 0 ? reconstruct_result_bytes(limits) : 0);
}

}  // namespace tv
