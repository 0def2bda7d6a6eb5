// Least-squares matching: the keypoints of a match moved to the same point of the scene by the
// pixels around them.
#pragma once

#include "kernels/kernels.h"
#include "twoview/feature.h"
#include "twoview/image.h"

namespace tv {

// The standard deviation of an aligned match's position over that of the keypoints' own positions.
inline constexpr double kAlignedSigma = 0.5;

// Moves one keypoint of a match so that both are at the same point of the scene: the affine map,
// gain and offset between the windows around them that leave the least squared differences. The
// keypoint of the larger size stays, since its window is the smoother one, else the one that is
// first by (y, x); so exchanged views move the same one. Only x and y change. size_of_one: the size
// of a keypoint of the full image. Returns false, and changes nothing, when a window is not within
// its image, has too little texture, is not alike, or the keypoint would move by more than
// 1.2 samples.
// A. W. Gruen, Adaptive least squares correlation, 1985; S. Baker, I. Matthews, IJCV 2004 (inverse
// composition). docs/algorithms/match.md.
bool align_keypoints(const tvk_table& kernels, const tv_image& image0, const tv_image& image1,
                     double size_of_one, tv_keypoint* keypoint0, tv_keypoint* keypoint1);

}  // namespace tv
