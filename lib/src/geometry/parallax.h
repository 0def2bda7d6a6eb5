// How far matches are from being explained by a rotation alone, and how much pixel noise adds to
// the normal equations of the translation's direction. Formulas: docs/algorithms/two_view.md,
// uncertainty and final refinement. Tests: test/unit/test_residuals.cc,
// test/property/test_covariance_statistics.cc.
#pragma once

#include <cstdint>

#include "geometry/essential.h"
#include "geometry/ray_pairs.h"

namespace tv {

// For each listed match the squared sine of the angle between R f0 and f1, or 2 where that angle is
// more than a right one.
void squared_sines(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& R,
                   double* sines_sq);

// J is the Jacobian of Sampson's residuals by the direction of the translation, with the two
// parameters along b1 and b2 of tangent_basis. This is the part of J' J that noise of one pixel in
// each coordinate adds. At a low parallax it is considerable, because the entries b . (R f0 x f1) /
// |gradient of the residual| of J are as small as the parallax. The caller subtracts it from J' J,
// times the variance of the noise in square pixels. block: the entries (0, 0), (0, 1) and (1, 1) of
// the 2x2 matrix.
void direction_noise(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                     double block[3]);

}  // namespace tv
