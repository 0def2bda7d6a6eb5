// The solver for fundamental matrices from seven matched rays.
#pragma once

#include "geometry/camera.h"

namespace tv {

// Writes the matrices M of rank 2 with f1' M f0 = 0 for all seven matches, each of Frobenius norm 1
// and of either sign. Returns their number: at most three, and 0 for a degenerate sample. Rays may
// have any positive length.
int fundamental_7pt(const Vec3 rays0[7], const Vec3 rays1[7], Mat3 models[3]);

}  // namespace tv
