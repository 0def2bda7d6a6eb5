// The principal point of the one camera that saw both views, refined with the pose where the
// matches contradict the calibration's. docs/algorithms/principal_point.md.
#pragma once

#include "robust/fit.h"

namespace tv {

// Where one camera saw both views and the matches contradict its principal point, pose and
// principal point are refined together, and the rays follow.
TVK_NOINLINE void place_principal_point(Fit& f);

}  // namespace tv
