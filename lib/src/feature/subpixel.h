// Where, below a pixel, a corner is.
#pragma once

#include "image/pyramid.h"

namespace tv {

// The point that the gradients around pixel (x, y) are most nearly perpendicular to (W. Foerstner,
// E. Guelch, "A fast operator for detection and precise location of distinct points", 1987). The
// pixel itself where the gradients do not settle it, or where it would move by more than a pixel and
// a half.
void refine_corner(const Level& level, int32_t x, int32_t y, double* refined_x, double* refined_y);

}  // namespace tv
