// The focal length of the one camera that saw both views, refined with the pose. Both functions are
// for a pair with refines_focal_length (robust/calibration.h). docs/algorithms/covariance.md.
#pragma once

#include "robust/fit.h"

namespace tv {

// In place of search_two_view: searches the pose at seven focal lengths within 1.5 deviations of
// the given one. A pose that was found at a wrong one is often at a minimum of its own, which no
// refinement leaves. Writes the pose that the matches and the prior make most probable to *model;
// the problem's cameras and the rays are then of its focal length.
void search_focal_length(TwoViewProblem& problem, Matches* matches, Arena& arena,
                         TwoViewModel* model);

// After search_focal_length: refines pose and focal length together, with the deviation of the
// calibration as a prior; cameras and rays follow. A focal length that was found to be as given
// stays so, unless the matches would lower its deviation by a fifth.
TVK_NOINLINE void place_focal_length(Fit& f);

}  // namespace tv
