#include "feature/subpixel.h"

#include "kernels/kernels.h"

namespace tv {
namespace {

constexpr double kMaxShift = 0.75;

}  // namespace

void refine_corner(const tvk_table& kernels, const Level& level, int32_t arc, int32_t x,
                   int32_t y, double* refined_x, double* refined_y) {
  *refined_x = x;
  *refined_y = y;
  constexpr int32_t rim = TVK_CIRCLE_RADIUS + 1;
  if (x < rim || y < rim || x + rim >= level.width || y + rim >= level.height) return;
  int32_t c[3][3];
  kernels.fast_contrasts(level.data + y * level.stride + x, level.stride, arc, c[0]);
  // Least squares over the nine values: c(u, v) = .. + gx u + gy v + hxx u^2/2 + hxy u v + hyy v^2/2,
  // all coefficients times 12 to stay in integers.
  int32_t gx = 0, gy = 0, hxx = 0, hyy = 0;
  for (int32_t k = 0; k < 3; ++k) {
    gx += 2 * (c[k][2] - c[k][0]);
    gy += 2 * (c[2][k] - c[0][k]);
    hxx += 4 * (c[k][0] - 2 * c[k][1] + c[k][2]);
    hyy += 4 * (c[0][k] - 2 * c[1][k] + c[2][k]);
  }
  const int32_t hxy = 3 * (c[2][2] - c[2][0] - c[0][2] + c[0][0]);
  const int64_t determinant = static_cast<int64_t>(hxx) * hyy - static_cast<int64_t>(hxy) * hxy;
  if (hxx >= 0 || determinant <= 0) return;  // no top
  const double scale = 1.0 / static_cast<double>(determinant);
  const double dx = static_cast<double>(static_cast<int64_t>(hxy) * gy -
                                        static_cast<int64_t>(hyy) * gx) * scale;
  const double dy = static_cast<double>(static_cast<int64_t>(hxy) * gx -
                                        static_cast<int64_t>(hxx) * gy) * scale;
  if (dx > kMaxShift || dx < -kMaxShift || dy > kMaxShift || dy < -kMaxShift) return;
  *refined_x = x + dx;
  *refined_y = y + dy;
}

}  // namespace tv
