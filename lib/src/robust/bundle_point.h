// The points of a bundle adjustment, one at a time: how each follows a step of the pose, and how it
// is brought to its least error at a fixed pose. Derivations: docs/algorithms/bundle.md. Tests:
// test/unit/test_bundle_ceres.cc, test/api/test_bundle_api.c.
#pragma once

#include "robust/bundle_match.h"

namespace tv {

// The i-th match's point after a step of the pose that leads from old_frame to frame. Nearly always
// the point moves by linear_step. Where its error then grows too much, or a camera no longer sees
// it, its error is minimised at the new pose: from its old position, and, if that fails, from the
// match's rays. `careful`: this is done at any growth of the error. False where no position is
// found that both cameras see.
bool try_point(const BundleProblem& problem, const BundleFrame& old_frame, const BundleFrame& frame,
               const double step[5], bool careful, const BundleMatch& match, int32_t i,
               BundleMatch* out);

// Moves the i-th match's point at the present pose, by at most four steps, while one can be
// expected to lower its squared error by more than a millionth, and does lower it; returns the
// point's elimination. What can be expected is |error|^2 - r^2, r the elimination's: the error that
// no position of the point removes. For a correct match this is nearly 0, since the projections are
// nearly linear over its few pixels. Points of wrong matches take several steps; without these
// steps the whole adjustment would converge slowly.
Elimination polish_point(const BundleProblem& problem, const BundleFrame& frame, int32_t i,
                         BundleMatch* match);

}  // namespace tv
