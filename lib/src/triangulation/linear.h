// The four linear methods: Linear-LS, Iterative-LS, Linear-Eigen, Iterative-Eigen. R. Hartley,
// P. Sturm, "Triangulation", CVIU 68(2), 1997. Derivation: docs/algorithms/triangulation.md.
#pragma once

#include "triangulation/triangulation_pair.h"

namespace tv {

// The point in camera 0's frame for a baseline of 1. An iterative method that does not converge
// within ten reweightings returns the point of its linear one. A point at infinity is returned as
// coordinates that are not finite.
Vec3 solve_least_squares(const TriangulationPair& pair, const RayFrame& frame0,
                         const RayFrame& frame1, bool iterative);
Vec3 solve_eigen(const TriangulationPair& pair, const RayFrame& frame0, const RayFrame& frame1,
                 bool iterative);

}  // namespace tv
