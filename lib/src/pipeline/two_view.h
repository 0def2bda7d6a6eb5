// The whole way of a pair's matches to its estimate: the canonical order of the views, search and
// finish, and what stands still in the pictures.
#pragma once

#include "pipeline/context.h"
#include "robust/two_view.h"

namespace tv {

// An estimate, in the canonical order of the views. It refers to the caller's arrays and to the
// arena, and lies in the caller's frame, which is deep enough below the search.
struct PairEstimate {
  TwoViewProblem problem;  // its cameras are those that the outcome refers to
  Matches matches;
  TwoViewModel model;
  TwoViewOutcome outcome;
  bool swapped;   // the canonical order is the reverse of the caller's
  int num_still;  // matches that stand still, and were left out
};

// Estimates from checked input. Given of *estimate: problem.options, and outcome.evidence, which is
// Evidence{}; all else is zero. The cameras are both null or both checked. The results lie in the
// context's arena, whose scope is the caller's.
void estimate_pair(tv_context* context, const tv_camera* camera0, const tv_camera* camera1,
                   const tv_pixel_pairs& pairs, PairEstimate* estimate);

}  // namespace tv
