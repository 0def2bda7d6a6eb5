// Refinement of corner positions to a fraction of a pixel.
#pragma once

#include "image/pyramid.h"

namespace tv {

struct Position {
  double x, y;
};

inline constexpr int32_t kRefineBlock = 64;

// Refines at most kRefineBlock positions, which are whole pixels of the level. A position moves to
// the maximum of a quadratic, fitted by least squares to the contrast of the segment test (kernel
// fast_contrasts) at the pixel and its eight neighbours. It stays unchanged if the fit has no
// maximum within 0.75 pixel along x and y, or if one of the nine circles would leave the image.
void refine_corners(const tvk_table& kernels, const Level& level, int32_t arc, Position* positions,
                    int32_t count);

}  // namespace tv
