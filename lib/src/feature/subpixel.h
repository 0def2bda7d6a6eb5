// Refinement of corner positions to a fraction of a pixel.
#pragma once

#include <cstdint>

namespace tv {

// A local maximum of the determinant of the Hessian (kernel hessian_determinants).
struct Peak {
  int32_t pixel_x, pixel_y;  // the pixel of the level with the largest determinant
  double x, y;               // the maximum itself, at most 1 from that pixel along x and y
};

// Looks for a maximum near the pixel (x, y) of a level, of which the kernel made the determinants:
// moves at most twice to the largest of the eight neighbours, then fits a quadratic to
// the pixel and its neighbours. Returns false, and leaves *peak alone, when that pixel is not the
// largest of nine, or the quadratic has no maximum within 1 pixel along x and y.
bool find_peak(const int32_t* determinants, int32_t x, int32_t y, Peak* peak);

}  // namespace tv
