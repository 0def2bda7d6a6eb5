#include "feature/subpixel.h"

#include <algorithm>

#include "kernels/kernels.h"

namespace tv {
namespace {

constexpr double kMaxShift = 0.75;

constexpr int8_t kCircleX[16] = {0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1};
constexpr int8_t kCircleY[16] = {3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1, 0, 1, 2, 3};

// By how much the best arc is brighter or darker than the centre; unlike the score it falls below 0
// where there is no corner, as a neighbour of a corner may.
int32_t segment_contrast(const uint8_t* centre, int64_t stride, int32_t arc) {
  int32_t low[16], high[16], low4[16], high4[16];
  for (int32_t i = 0; i < 16; ++i) {
    low[i] = high[i] = centre[kCircleY[i] * stride + kCircleX[i]] - *centre;
  }
  for (int32_t i = 0; i < 16; ++i) {
    const int32_t b = (i + 1) & 15, c = (i + 2) & 15, d = (i + 3) & 15;
    low4[i] = std::min(std::min(low[i], low[b]), std::min(low[c], low[d]));
    high4[i] = std::max(std::max(high[i], high[b]), std::max(high[c], high[d]));
  }
  int32_t contrast = -255;
  for (int32_t i = 0; i < 16; ++i) {
    // Three runs of four cover an arc of 9 to 12 pixels.
    const int32_t j = (i + 4) & 15, k = (i + arc - 4) & 15;
    contrast = std::max(contrast, std::min(std::min(low4[i], low4[j]), low4[k]));
    contrast = std::max(contrast, -std::max(std::max(high4[i], high4[j]), high4[k]));
  }
  return contrast;
}

}  // namespace

void refine_corner(const Level& level, int32_t arc, int32_t x, int32_t y, double* refined_x,
                   double* refined_y) {
  *refined_x = x;
  *refined_y = y;
  constexpr int32_t rim = TVK_CIRCLE_RADIUS + 1;
  if (x < rim || y < rim || x + rim >= level.width || y + rim >= level.height) return;
  int32_t c[3][3];
  for (int32_t j = 0; j < 3; ++j) {
    for (int32_t i = 0; i < 3; ++i) {
      const uint8_t* centre = level.data + (y + j - 1) * level.stride + x + i - 1;
      c[j][i] = segment_contrast(centre, level.stride, arc);
    }
  }
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
