// Least-squares matching: the keypoints of a match moved to the same point of the scene by the
// pixels around them.
#pragma once

#include "kernels/kernels.h"
#include "twoview/feature.h"
#include "twoview/image.h"
#include "twoview/match.h"

namespace tv {

// The unit of what align_keypoints returns is 1 / kAlignedOne.
inline constexpr int kAlignedOne = 128;

// Moves one keypoint of a match so that both are at the same point of the scene: the affine map,
// gain and offset between the windows around them that leave the least squared differences. The
// keypoint of the larger size stays, since its window is the smoother one, else the one that is
// first by (y, x); so exchanged views move the same one. Only x and y change. size_of_one: the size
// of a keypoint of the full image. Returns the standard deviation of the aligned positions over
// that of the keypoints' own, in 1 / kAlignedOne, 1 to 255. Returns 0, and changes nothing, when a
// window is not within its image, has too little texture, is not alike, or the keypoint would move
// by more than 1.2 samples. A. W. Gruen, Adaptive least squares correlation, 1985; S. Baker, I.
// Matthews, IJCV 2004 (inverse composition). docs/algorithms/match.md. shapes: null, or the shapes
// of both keypoints' patches (patch_shape of feature/tilts.h), which the affine map starts from in
// place of sizes and angles.
uint8_t align_keypoints(const tvk_set& set, const tv_image& image0, const tv_image& image1,
                        double size_of_one, tv_keypoint* keypoint0, tv_keypoint* keypoint1,
                        const double (*shapes)[4] = nullptr);

// The same for each match; writes to `aligned` what align_keypoints returns. A corner with two
// directions has two keypoints in turn, and two corners may have two matches, which are one to the
// estimate: the match of lower rank is aligned, and the other one moves with it.
void align_matches(const tvk_set& set, const tv_image images[2], double size_of_one,
                   tv_keypoint* const keypoints[2], const tv_correspondence* matches,
                   int32_t num_matches, uint8_t* aligned);

}  // namespace tv
