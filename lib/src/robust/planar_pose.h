// The pose of a pair whose matches a plane explains: which of the two motions that a plane allows,
// and the other one as the alternative.
#pragma once

#include "robust/fit.h"
#include "robust/rivals.h"

namespace tv {

// A plane allows two motions. Where the plane explains nearly all of the support they are fitted
// together with it; where there is more than the plane, each is refined as a pose, and the epipolar
// model's own competes with them. The one of lowest cost is the pose, and a second one that is
// different and not clearly worse the alternative. Not inlined, so that its stack frame is in use
// only while it runs.
TVK_NOINLINE void choose_planar_pose(Fit& f, const Rivals& rivals);

}  // namespace tv
