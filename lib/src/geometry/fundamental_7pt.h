// The solver for fundamental matrices from seven matched rays.
#pragma once

#include "geometry/camera.h"

namespace tv {

// Returns one to three matrices of rank 2, f1' M f0 = 0, Frobenius norm 1, either sign; 0 for a
// degenerate sample.
int fundamental_7pt(const Vec3 rays0[7], const Vec3 rays1[7], Mat3 models[3]);

}  // namespace tv
