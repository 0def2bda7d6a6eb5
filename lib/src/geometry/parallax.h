// How far matches are from being explained by a rotation alone, and how much pixel noise imitates
// that. Formulas: docs/algorithms/two_view.md, uncertainty and final refinement. Tests:
// test/unit/test_residuals.cc, test/property/test_covariance_statistics.cc.
#pragma once

#include <cstdint>

#include "geometry/essential.h"
#include "geometry/ray_pairs.h"

namespace tv {

// For each listed match the squared sine of the angle between R f0 and f1, or 2 where that angle is
// more than a right one.
void squared_sines(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& R,
                   double* sines_sq);

// The part of J' J, for the direction of the translation, that comes from noise of one pixel in
// each coordinate and not from the motion. At a low parallax it is considerable, because the rows b
// . (R f0 x f1) / |gradient of the residual| of J are as small as the parallax. Subtract it, times
// the variance of the noise. block: the entries (0, 0), (0, 1) and (1, 1) of this 2x2 block, for b1
// and b2 of tangent_basis.
void direction_noise(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                     double block[3]);

}  // namespace tv
