// The points of a bundle adjustment, one at a time: how each follows a step of the pose, and how it
// is brought to its least error at a fixed pose. Derivations: docs/algorithms/bundle.md. Tests:
// test/unit/test_bundle_ceres.cc, test/api/test_bundle_api.c.
#pragma once

#include "robust/bundle_match.h"

namespace tv {

// The i-th match's point after a step of the pose that leads from old_frame to frame. Its
// linearised answer to the step is nearly always good. Where it is not, or where a camera does not
// see the point any more, the point is brought to its least error anew: first from where it was,
// then, if this does not help, from the match's rays. `careful`: no growth of the error is accepted
// without this. False where no place is found at which both cameras see the point.
bool try_point(const BundleProblem& problem, const BundleFrame& old_frame, const BundleFrame& frame,
               const double step[5], bool careful, const BundleMatch& match, int32_t i,
               BundleMatch* out);

// Moves the i-th match's point nearer to its least error at the present pose while this gains
// anything, and returns its elimination. What is left to gain is about |error|^2 - r^2. This is
// next to nothing for a good match, since the projections are nearly linear over its few pixels;
// only the points of wrong matches take several steps, and without these the whole adjustment would
// converge as slowly as they do.
Elimination polish_point(const BundleProblem& problem, const BundleFrame& frame, int32_t i,
                         BundleMatch* match);

}  // namespace tv
