// The focal length of the one camera that saw both views, refined with the pose where the options
// call it uncertain. docs/algorithms/covariance.md.
#pragma once

#include "robust/fit.h"

namespace tv {

// Whether one camera saw both views, and its focal length has a standard deviation above
// kUncertainFocal. The two functions below are for such a pair.
bool has_uncertain_focal_length(const TwoViewProblem& problem);

// In place of search_two_view: searches the pose at seven focal lengths within 1.5 deviations of
// the given one. A pose that was found at a wrong one is often at a minimum of its own, which no
// refinement leaves. Writes the pose that the matches and the prior make most probable to *model;
// the problem's cameras and the rays are then of its focal length.
void search_focal_length(TwoViewProblem& problem, Matches* matches, Arena& arena,
                         TwoViewModel* model);

// Then refines pose and focal length together, with that deviation as a prior; the cameras and the
// rays follow. A focal length that was found as given stays so where the matches would not lower
// its deviation by a fifth.
TVK_NOINLINE void place_focal_length(Fit& f);

}  // namespace tv
