// Where, below a pixel, a corner is.
#pragma once

#include "image/pyramid.h"

namespace tv {

// The top of the quadratic that fits the segment test's contrast (the score before the threshold) at
// pixel (x, y) and its eight neighbours best, by least squares. The pixel itself where the fit has
// no top within 0.75 pixel of it, or where a circle would leave the image.
void refine_corner(const tvk_table& kernels, const Level& level, int32_t arc, int32_t x,
                   int32_t y, double* refined_x, double* refined_y);

}  // namespace tv
