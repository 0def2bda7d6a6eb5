// The solver for a pure rotation from two matched rays.
#pragma once

#include "geometry/camera.h"

namespace tv {

// The rotation R with R f0 ~ f1 for both matches, with the errors shared evenly: the one that takes
// the bisector, the difference and the normal of the rays of view 0 to those of view 1 (after M.
// Brown, R. Hartley, D. Nister, "Minimal solutions for panoramic stitching", 2007, with known focal
// lengths). False when the two rays of a view are parallel or opposed.
bool rotation_2pt(const Vec3 rays0[2], const Vec3 rays1[2], Mat3* R);

}  // namespace tv
