// The matrix M of rank 2 with f1' M f0 = 0 from eight matched rays: a fundamental matrix. For rays
// of calibrated cameras it approximates an essential matrix, whose two equal singular values it
// does not enforce. Also the nearest matrix of rank 2.
#pragma once

#include "geometry/camera.h"

namespace tv {

// Rays are points of the plane z = 1, or unit vectors. M has rank 2, Frobenius norm 1 and either
// sign; its rank is enforced after the linear solution, so f1' M f0 = 0 holds exactly only for
// exact matches. False for a degenerate sample.
bool fundamental_8pt(const Vec3 rays0[8], const Vec3 rays1[8], Mat3* M);

// The matrix of rank 2 nearest to M in Frobenius norm, scaled to norm 1. False when M is zero.
bool nearest_rank2(const Mat3& M, Mat3* rank2);

}  // namespace tv
