// The fundamental (or, up to projection, essential) matrix of eight matched rays.
#pragma once

#include "geometry/camera.h"

namespace tv {

// Rays on the plane z = 1, or unit vectors. M: f1' M f0 = 0, rank 2, Frobenius norm 1, either sign.
// False for a degenerate sample.
bool fundamental_8pt(const Vec3 rays0[8], const Vec3 rays1[8], Mat3* M);

// The matrix of rank 2 nearest to M in Frobenius norm, scaled to norm 1. False when M is zero.
bool nearest_rank2(const Mat3& M, Mat3* rank2);

}  // namespace tv
