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

// The information that noise of one pixel in each coordinate alone adds to what the matches say
// about the direction of the translation. Its rows b . (R f0 x f1) / |gradient of the residual| are
// as small as the parallax. block: the entries (0, 0), (0, 1) and (1, 1) of its 2x2 block, for b1
// and b2 of tangent_basis.
void direction_noise(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                     double block[3]);

}  // namespace tv
