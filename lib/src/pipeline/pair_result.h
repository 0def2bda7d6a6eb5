// What a caller is given of a pair's estimate: in the caller's order of the views, with the
// matrices of pixels; and, apart from it, what it was judged by.
#pragma once

#include "pipeline/two_view.h"

namespace tv {

// A result, and the evidence of its judgement.
struct PairResult {
  tv_two_view view;
  Evidence evidence;
};

// Writes all of *result but its judgement, which becomes zeros.
void write_estimate(const PairEstimate& estimate, tv_two_view* result);
void write_judgement(const Judgement& judgement, tv_two_view* result);
void write_evidence(const Evidence& evidence, tv_evidence* written);

// Whether the result has a rotation and a translation.
inline bool is_full_pose(const tv_two_view& result) {
  return result.has_R != 0 && result.has_t != 0;
}

// Copies the judgement and the evidence of the first estimate to *again, an estimate that
// takes_guided_estimate accepted.
void keep_judgement(const PairResult& first, PairResult* again);

// Writes a byte for each match: 1 for an inlier, else 0.
void write_inliers(const PairEstimate& estimate, uint8_t* inlier_mask);

// The cameras and the motion of a result, as tv_corrected_pair gives them.
tv_camera_pair corrected_pair(const tv_two_view& result, const tv_camera& camera0,
                              const tv_camera& camera1);

}  // namespace tv
