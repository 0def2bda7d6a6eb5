// What descriptors are evidence for beside the geometry: a scene with places that look the same,
// and a picture that is mirrored. docs/algorithms/two_view.md.
#pragma once

#include "twoview/feature.h"
#include "twoview/match.h"

namespace tv {

// Whether more than half of the inliers have a second nearest descriptor that is as near as those
// of one place in two pictures are: then another place looks the same. inlier_mask: a byte for each
// match. options: those that the matches were found with.
bool looks_repeated(const tv_match_options& options, const tv_correspondence* matches,
                    const uint8_t* inlier_mask, int32_t num_matches);

// Replaces descriptors by those of the mirrored patches; a second call restores them.
void mirror_descriptors(uint8_t* descriptors, int32_t num);

}  // namespace tv
