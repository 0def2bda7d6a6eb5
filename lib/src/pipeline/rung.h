// One rung of effort: the keypoints of both images, their matches, an estimate from them, and its
// judgement, to which the descriptors add their evidence. docs/algorithms/effort.md.
#pragma once

#include "feature/tilts.h"
#include "pipeline/pair_arrays.h"
#include "robust/verdict.h"
#include "twoview/bundle.h"

namespace tv {

// The views and the options of one reconstruction, all checked and read.
struct PairTask {
  tv_view views[2];
  tv_feature_options features;
  tv_match_options match;
  tv_estimate_options estimate;
  tv_guided_options guided;
  tv_bundle_options bundle;
  tv_reconstruct_options options;  // but for the options of stages, which are those above
};

// What the rungs found so far; the arrays are in PairArrays.
struct Attempt {
  int32_t rung;                      // the last one, which all that follows is of
  int32_t num_rungs;                 // how many were run, this one included
  uint64_t rung_ns[kMaxEffort + 1];  // the time of each
  int32_t num_keypoints[2];
  int32_t num_found;  // matches of descriptors
  int32_t num_matches,
      num_left_out;  // of these, what is estimated from, and those beyond the limit
  PairResult estimate;
};

// Runs the rung that *attempt names.
void run_rung(tv_context* context, const PairTask& task, PairArrays& arrays, Attempt* attempt);

// Where squeezed views found the matches: keeps one match a place, the most precise one, as its
// alignment and the sizes of its keypoints say; and before all others those of `first`, which are
// among `matches`, both by ascending idx0. Returns how many are left.
int32_t merge_places(const PairArrays& arrays, Arena& arena, const tv_correspondence* first,
                     int32_t num_first, tv_correspondence* matches, int32_t num_matches);

// Estimates from these matches, with the evidence, but without the judgement, which is zeros.
// num_rungs: those of an Attempt. Writes arrays.pairs.
void estimate_from(tv_context* context, const PairTask& task, const tv_correspondence* matches,
                   int32_t num_matches, PairArrays& arrays, int32_t num_rungs, PairResult* result,
                   uint8_t* inlier_mask);

// Sets arrays.pair, for the stages that follow. Call it for each estimate that is kept.
void keep_pair(const tv_two_view& estimate, const PairTask& task, PairArrays& arrays);

}  // namespace tv
