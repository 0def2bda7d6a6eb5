// The focal length of the one camera that saw both views, refined with the pose where the options
// call it uncertain. docs/algorithms/covariance.md.
#pragma once

#include "robust/fit.h"

namespace tv {

// Where one camera saw both views, and its focal length has a standard deviation above
// kUncertainFocal, pose and focal length are refined together with that deviation as a prior, and
// the problem's cameras and the rays follow. The focal length stays as given where the matches
// would not lower its deviation by a fifth.
TVK_NOINLINE void place_focal_length(Fit& f);

}  // namespace tv
