// The pose of a pair whose matches a plane explains: which of the two motions that a plane allows,
// and the other one as the alternative.
#pragma once

#include "robust/fit.h"
#include "robust/rivals.h"

namespace tv {

// A plane allows two motions. Where the plane explains at least 85 % of the support, they are
// refined together with the plane. Otherwise each is refined as a pose, and the epipolar model's
// pose is a third candidate. The candidate of lowest cost becomes the pose; the matches of the
// plane do not count, since both motions explain them. Another one that differs from it and has at
// least 90 % as many inliers becomes the alternative. Not inlined, so that its stack frame is in
// use only while it runs.
TVK_NOINLINE void choose_planar_pose(Fit& f, const Rivals& rivals);

}  // namespace tv
