// Where, below a pixel, corners are.
#pragma once

#include "image/pyramid.h"

namespace tv {

struct Position {
  double x, y;
};

inline constexpr int32_t kRefineBlock = 64;

// positions: at most kRefineBlock pixels of the level. Each becomes the top of the quadratic that
// fits the segment test's contrast (the score before the threshold) at the pixel and its eight
// neighbours best, by least squares; it stays where the fit has no top within 0.75 pixel of it, or
// where a circle would leave the image.
void refine_corners(const tvk_table& kernels, const Level& level, int32_t arc, Position* positions,
                    int32_t count);

}  // namespace tv
