// What a caller is given of a pair's estimate: in the caller's order of the views, with the
// matrices of pixels.
#pragma once

#include "pipeline/two_view.h"

namespace tv {

// Writes all of *result but its judgement, which becomes zeros.
void write_estimate(const PairEstimate& estimate, tv_two_view* result);
void write_judgement(const Judgement& judgement, tv_two_view* result);

// Writes a byte for each match: 1 for an inlier, else 0.
void write_inliers(const PairEstimate& estimate, uint8_t* inlier_mask);

// The cameras and the motion of a result, as tv_corrected_pair gives them.
tv_camera_pair corrected_pair(const tv_two_view& result, const tv_camera& camera0,
                              const tv_camera& camera1);

}  // namespace tv
