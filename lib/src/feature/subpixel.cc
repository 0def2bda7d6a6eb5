// Moves corners to the maximum of the determinant of the Hessian near them. Formulas:
// docs/algorithms/fast.md; test: test/unit/test_subpixel.cc.
#include "feature/subpixel.h"

namespace tv {
namespace {

constexpr int32_t kPitch = 8;  // of the determinants, which cover 7 x 7 pixels
constexpr int32_t kMiddle = 3;
constexpr int32_t kMaxSteps = 2;
constexpr double kMaxShift = 1.0;

// The place of the largest of nine determinants around `place`; of equal ones, `place` if it is
// one of them, else the first in raster order.
int32_t largest_of_nine(const int32_t* determinants, int32_t place) {
  int32_t best = place, largest = determinants[place];
  for (int32_t v = -kPitch; v <= kPitch; v += kPitch) {
    for (int32_t u = -1; u <= 1; ++u) {
      // Without a branch: which one is the largest cannot be predicted.
      const int32_t determinant = determinants[place + v + u];
      best = determinant > largest ? place + v + u : best;
      largest = determinant > largest ? determinant : largest;
    }
  }
  return best;
}

}  // namespace

bool find_peak(const int32_t* determinants, int32_t x, int32_t y, Peak* peak) {
  int32_t place = kMiddle * kPitch + kMiddle;
  for (int32_t step = 0;; ++step) {
    const int32_t next = largest_of_nine(determinants, place);
    if (next == place) break;
    if (step == kMaxSteps) return false;
    place = next;
  }

  // The quadratic c(u, v) = .. + gx u + gy v + hxx u^2/2 + hxy u v + hyy v^2/2 has central
  // differences of the determinants as its coefficients.
  const auto at = [&](int32_t u, int32_t v) {
    return static_cast<double>(determinants[place + kPitch * v + u]);
  };
  const double gx = 0.5 * (at(1, 0) - at(-1, 0)), hxx = at(1, 0) - 2.0 * at(0, 0) + at(-1, 0);
  const double gy = 0.5 * (at(0, 1) - at(0, -1)), hyy = at(0, 1) - 2.0 * at(0, 0) + at(0, -1);
  const double hxy = 0.25 * (at(1, 1) - at(-1, 1) - at(1, -1) + at(-1, -1));
  const double determinant = hxx * hyy - hxy * hxy;
  if (hxx >= 0.0 || determinant <= 0.0) return false;  // the quadratic has no maximum
  const double dx = (hxy * gy - hyy * gx) / determinant;
  const double dy = (hxy * gx - hxx * gy) / determinant;
  if (dx > kMaxShift || dx < -kMaxShift || dy > kMaxShift || dy < -kMaxShift) return false;
  peak->pixel_x = x + place % kPitch - kMiddle;
  peak->pixel_y = y + place / kPitch - kMiddle;
  peak->x = peak->pixel_x + dx;
  peak->y = peak->pixel_y + dy;
  return true;
}

}  // namespace tv
