#include "feature/subpixel.h"

namespace tv {
namespace {

#ifndef TV_TUNE_SUBPIX_RADIUS
#define TV_TUNE_SUBPIX_RADIUS 3
#endif
constexpr int32_t kRadius = TV_TUNE_SUBPIX_RADIUS;
#ifndef TV_TUNE_SUBPIX_MAX
#define TV_TUNE_SUBPIX_MAX 1.5
#endif

// 16 exp(-(d / 2)^2) for d = -3..3, the product of two of them weighs a pixel.
constexpr int64_t kWeights[2 * 3 + 1] = {2, 6, 12, 16, 12, 6, 2};

}  // namespace

void refine_corner(const Level& level, int32_t x, int32_t y, double* refined_x,
                   double* refined_y) {
  *refined_x = x;
  *refined_y = y;
  if (x <= kRadius || y <= kRadius || x + kRadius + 1 >= level.width ||
      y + kRadius + 1 >= level.height) {
    return;
  }
  // Sum of w g g^T (p - q) = 0 over the pixels q; all sums are integers.
  int64_t xx = 0, xy = 0, yy = 0, bx = 0, by = 0;
  for (int32_t j = -kRadius; j <= kRadius; ++j) {
    const uint8_t* row = level.data + (y + j) * level.stride + x;
    for (int32_t i = -kRadius; i <= kRadius; ++i) {
      const int64_t w = kWeights[i + 3] * kWeights[j + 3];
      const int64_t gx = row[i + 1] - row[i - 1];
      const int64_t gy = row[i + level.stride] - row[i - level.stride];
      xx += w * gx * gx;
      xy += w * gx * gy;
      yy += w * gy * gy;
      bx += w * (gx * gx * i + gx * gy * j);
      by += w * (gx * gy * i + gy * gy * j);
    }
  }
  const double determinant = static_cast<double>(xx) * static_cast<double>(yy) -
                             static_cast<double>(xy) * static_cast<double>(xy);
  const double trace = static_cast<double>(xx + yy);
  if (determinant <= 0.01 * trace * trace) return;  // an edge, or nothing
  const double dx = (static_cast<double>(yy) * static_cast<double>(bx) -
                     static_cast<double>(xy) * static_cast<double>(by)) / determinant;
  const double dy = (static_cast<double>(xx) * static_cast<double>(by) -
                     static_cast<double>(xy) * static_cast<double>(bx)) / determinant;
  if (dx * dx + dy * dy > TV_TUNE_SUBPIX_MAX * TV_TUNE_SUBPIX_MAX) return;
  *refined_x = x + dx;
  *refined_y = y + dy;
}

}  // namespace tv
