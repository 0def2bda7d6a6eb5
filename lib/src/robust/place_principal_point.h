// The principal point of the one camera that saw both views: tested, and, where the caller allows
// it, refined with the pose. docs/algorithms/principal_point.md.
#pragma once

#include "robust/fit.h"

namespace tv {

// Where one camera saw both views, its principal point is tested. Where the matches contradict it
// and the options give it a deviation, pose and principal point are refined together, and the rays
// follow.
TVK_NOINLINE void place_principal_point(Fit& f);

}  // namespace tv
