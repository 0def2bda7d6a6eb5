// Moves corners to the maximum of the contrast around them. Test: test/unit/test_subpixel.cc.
#include "feature/subpixel.h"

#include "kernels/kernels.h"

namespace tv {
namespace {

constexpr double kMaxShift = 0.75;

// Moves the position to the maximum of the quadratic c(u, v) = .. + gx u + gy v + hxx u^2/2 + hxy u
// v + hyy v^2/2 that is fitted to the nine values by least squares, row by row. All coefficients
// are 12 times their value, which makes them integers. Contrasts are in -255..255, so that every
// product fits 32 bits.
void move_to_top(const int16_t* c, Position* position) {
  const int32_t left = c[0] + c[3] + c[6], middle_x = c[1] + c[4] + c[7],
                right = c[2] + c[5] + c[8];
  const int32_t top = c[0] + c[1] + c[2], middle_y = c[3] + c[4] + c[5],
                bottom = c[6] + c[7] + c[8];
  const int32_t gx = 2 * (right - left), hxx = 4 * (left - 2 * middle_x + right);
  const int32_t gy = 2 * (bottom - top), hyy = 4 * (top - 2 * middle_y + bottom);
  const int32_t hxy = 3 * (c[8] - c[6] - c[2] + c[0]);
  const int32_t determinant = hxx * hyy - hxy * hxy;
  if (hxx >= 0 || determinant <= 0) return;  // the quadratic has no maximum
  const double scale = 1.0 / determinant;
  const double dx = (hxy * gy - hyy * gx) * scale, dy = (hxy * gx - hxx * gy) * scale;
  if (dx > kMaxShift || dx < -kMaxShift || dy > kMaxShift || dy < -kMaxShift) return;
  position->x += dx;
  position->y += dy;
}

}  // namespace

void refine_corners(const tvk_table& kernels, const Level& level, int32_t arc, Position* positions,
                    int32_t count) {
  constexpr int32_t rim = TVK_CIRCLE_RADIUS + 1;
  const uint8_t* centres[kRefineBlock] = {};
  int16_t contrasts[9 * kRefineBlock];
  Position* refined[kRefineBlock];
  int32_t inside = 0;
  for (int32_t k = 0; k < count; ++k) {
    const int32_t x = static_cast<int32_t>(positions[k].x),
                  y = static_cast<int32_t>(positions[k].y);
    if (x < rim || y < rim || x + rim >= level.width || y + rim >= level.height) continue;
    refined[inside] = &positions[k];
    centres[inside++] = level.data + y * level.stride + x;
  }
  kernels.fast_contrasts(centres, inside, level.stride, arc, contrasts);
  for (int32_t k = 0; k < inside; ++k) move_to_top(contrasts + 9 * k, refined[k]);
}

}  // namespace tv
