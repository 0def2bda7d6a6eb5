#include "dense/fraction.h"

#include <cmath>

namespace tv {
namespace {

constexpr int32_t kReach = 3, kSide = 2 * kReach + 1, kSamples = kSide * kSide;
constexpr double kLeastContrast = 4.0;  // variance of a window, squared grey levels
constexpr double kLeastSimilarity = 0.7;
constexpr double kMostChange = 1.0;
// The standard deviation is multiplied by kExcess, since residuals of neighbouring pixels are
// correlated, and has a floor that stands for what the model leaves out (measured:
// docs/decisions/0027-dense.md).
constexpr double kExcess = 2.0, kFloor = 0.12;

}  // namespace

bool refine_step(const RowPair& rows, int32_t x, int32_t y, int32_t step, Refined* refined) {
  const int32_t width1 = rows.width + rows.num_steps - 1;
  if (x <= kReach || y < kReach || x + kReach + 1 >= rows.width || y + kReach >= rows.height)
    return false;
  const int32_t x1 = x + step;
  if (x1 <= kReach || x1 + kReach + 1 >= width1) return false;
  // Sums over the window: a of image 0, b of image 1, g their mean slope along the row, times 4.
  int32_t sum_a = 0, sum_b = 0, sum_g = 0, aa = 0, bb = 0, gg = 0, ab = 0, ag = 0, bg = 0;
  for (int32_t v = -kReach; v <= kReach; ++v) {
    const uint8_t* p = rows.pixels0 + static_cast<ptrdiff_t>(y + v) * rows.width + x;
    const uint8_t* q = rows.pixels1 + static_cast<ptrdiff_t>(y + v) * width1 + x1;
    for (int32_t u = -kReach - 1; u <= kReach + 1; ++u)
      if (p[u] == 0 || q[u] == 0) return false;
    for (int32_t u = -kReach; u <= kReach; ++u) {
      const int32_t a = p[u], b = q[u], g = p[u + 1] - p[u - 1] + q[u + 1] - q[u - 1];
      sum_a += a, sum_b += b, sum_g += g;
      aa += a * a, bb += b * b, gg += g * g, ab += a * b, ag += a * g, bg += b * g;
    }
  }
  const double n = kSamples;
  const auto centred = [&](int32_t product, int32_t s, int32_t r) {
    return static_cast<double>(product) - static_cast<double>(s) * static_cast<double>(r) / n;
  };
  const double caa = centred(aa, sum_a, sum_a), cbb = centred(bb, sum_b, sum_b);
  const double cgg = centred(gg, sum_g, sum_g) / 16, cab = centred(ab, sum_a, sum_b);
  const double cag = centred(ag, sum_a, sum_g) / 4, cbg = centred(bg, sum_b, sum_g) / 4;
  if (!(caa > kLeastContrast * n && cbb > kLeastContrast * n && cab > 0)) return false;
  // b + change g = gain a + offset, by least squares over change, gain and offset.
  const double pivot = cgg - cag * cag / caa;
  if (!(pivot > 0.05 * cgg && pivot > n * 0.5)) return false;
  const double change = (cab * cag / caa - cbg) / pivot;
  if (!(change >= -kMostChange && change <= kMostChange)) return false;
  const double gain = (cab + change * cag) / caa;
  if (!(gain > 0.2 && gain < 5)) return false;
  // What remains of image 1 after the change, and of it without image 0.
  const double moved = cbb + 2 * change * cbg + change * change * cgg;
  const double rest = moved - gain * gain * caa;
  const double alike = gain * std::sqrt(caa / moved);
  if (!(alike >= kLeastSimilarity)) return false;
  const double noise = (rest > 0 ? rest : 0) / (n - 3) + 0.1;
  refined->step = step + change;
  refined->sigma = std::sqrt(kExcess * kExcess * noise / pivot + kFloor * kFloor);
  refined->similarity = alike < 1 ? alike : 1;
  return true;
}

}  // namespace tv
