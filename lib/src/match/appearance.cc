#include "match/appearance.h"

#include <algorithm>

namespace tv {

bool looks_repeated(const tv_match_options& options, const tv_correspondence* matches,
                    const uint8_t* inlier_mask, int32_t num_matches) {
  constexpr float kAlikeSq = 20000;
  // Below such a bound max_distance replaces the distance of the second nearest descriptor, and
  // nothing is known of it.
  const float bound = options.max_distance;
  if (bound > 0 && bound * bound <= kAlikeSq) return false;
  int32_t alike = 0, inliers = 0;
  for (int32_t k = 0; k < num_matches; ++k) {
    if (inlier_mask[k] == 0) continue;
    const tv_correspondence& m = matches[k];
    ++inliers;
    alike += static_cast<float>(m.dist_sq) < kAlikeSq * (m.ratio * m.ratio);
  }
  return 2 * alike > inliers;
}

// A patch is turned to its angle: mirrored across that axis, its rows of cells change places, the
// first with the last, and the direction bin k becomes bin -k.
void mirror_descriptors(uint8_t* descriptors, int32_t num) {
  for (int32_t i = 0; i < num; ++i, descriptors += TV_DESCRIPTOR_BYTES) {
    uint8_t mirrored[TV_DESCRIPTOR_BYTES];
    for (int k = 0; k < TV_DESCRIPTOR_BYTES; ++k) {
      mirrored[k] = descriptors[32 * (3 - k / 32) + (k & 24) + (-k & 7)];
    }
    std::copy(mirrored, mirrored + TV_DESCRIPTOR_BYTES, descriptors);
  }
}

}  // namespace tv
