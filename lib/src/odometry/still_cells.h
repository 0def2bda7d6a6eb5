// Cells of the picture that stand still while the scene moves, of which no keypoints are taken:
// what pairs of frames say of them (robust/still.h), remembered for the frames that follow.
#pragma once

#include "odometry/odometry.h"
#include "twoview/match.h"

namespace tv {

// For each match whose pixel is the same in both frames, within a threshold, marks all cells that
// the cores of its two descriptors cover as still. It is called only for a pair whose estimate left
// such matches out (tv_two_view.num_still > 0).
void mark_still(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                const tv_correspondence* matches, int32_t num);

// The share of the picture that is left out of the next frame, [0, 1].
double still_share(const Odometry& odometry);

// Writes the mask of the next frame, width x height bytes: 0 in cells that are still, elsewhere the
// bytes of `given`, or 255 where that is null.
void write_mask(const Odometry& odometry, const tv_image* given, uint8_t* mask);

}  // namespace tv
