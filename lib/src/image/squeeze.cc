// Squeezes an image row by row with the kernels squeeze_row and mix_rows. Formulas:
// docs/algorithms/effort.md; test: test/unit/test_squeeze.cc.
#include "image/squeeze.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace tv {
namespace {

constexpr int32_t kOne = 65536;      // a pixel of the image
constexpr int kRows = TVK_MIX_ROWS;  // the rows of the image that a squeezed row lies on at most

int32_t to_q16(double x) { return static_cast<int32_t>(x < 0 ? x * kOne - 0.5 : x * kOne + 0.5); }

int32_t magnitude(int32_t x) { return x < 0 ? -x : x; }

// The rows of the image that a squeezed row is the mean of: `first` and those after it, with
// weights that add up to 256.
struct Footprint {
  int32_t first;
  int32_t weights[kRows];
};

Footprint footprint(const Squeeze& squeeze, int32_t v) {
  const int64_t begin = static_cast<int64_t>(v) * squeeze.step_y, end = begin + squeeze.step_y;
  Footprint f{static_cast<int32_t>(begin / kOne), {}};
  int32_t rest = 256;
  for (int k = 0; k < kRows; ++k) {
    const int64_t low = std::max(begin, static_cast<int64_t>(f.first + k) * kOne);
    const int64_t high = std::min(end, static_cast<int64_t>(f.first + k + 1) * kOne);
    const int64_t share = std::max<int64_t>(high - low, 0) * 256 + squeeze.step_y / 2;
    f.weights[k] =
        high == end ? rest : std::min(rest, static_cast<int32_t>(share / squeeze.step_y));
    rest -= f.weights[k];
  }
  return f;
}

// Where column 0 begins on a line of the image, which is in half pixels from the upper edge.
int64_t begin_of(const Squeeze& squeeze, int64_t half_pixels) {
  return squeeze.first_x + squeeze.shear * half_pixels / 2;
}

// Writes a row of the mask. x is in 1 / kOne pixels from the left edge of the image.
void mask_row(const Squeeze& squeeze, const tv_image& image, const tv_image* mask, int32_t v,
              uint8_t* out) {
  const int64_t y = (2 * static_cast<int64_t>(v) + 1) * squeeze.step_y / 2;
  int64_t x = squeeze.first_x + squeeze.shear * y / kOne + squeeze.step_x / 2;
  const int64_t low = static_cast<int64_t>(kSqueezeMargin) * kOne;
  const int64_t high = static_cast<int64_t>(image.width - kSqueezeMargin) * kOne;
  const uint8_t* const given =
      mask == nullptr ? nullptr : mask->data + y / kOne * mask->stride_bytes;
  for (int32_t u = 0; u < squeeze.width; ++u, x += squeeze.step_x) {
    const bool inside = x >= low && x < high;
    out[u] = inside && (given == nullptr || given[x / kOne] != 0);
  }
}

}  // namespace

// With d the direction, lengths are kept by the metric M = I - (1 - 1 / tilt^2) d d'. Its Cholesky
// factor (a b; 0 c), M = factor' factor, maps the image to the squeezed one.
Squeeze make_squeeze(double tilt, double cosine, double sine, int32_t width, int32_t height) {
  const double lost = 1 - 1 / (tilt * tilt);
  const double a = std::sqrt(1 - lost * cosine * cosine);
  const double c = 1 / (tilt * a);
  Squeeze s{};
  s.step_x = std::max(kOne, to_q16(1 / a));
  s.step_y = std::max(kOne, to_q16(1 / c));
  s.shear = to_q16(lost * cosine * sine / (a * a));  // -b / a
  const int64_t sheared = static_cast<int64_t>(s.shear) * height;
  s.first_x = std::min<int64_t>(-sheared, 0);
  s.width = static_cast<int32_t>(
      (static_cast<int64_t>(width) * kOne + static_cast<int64_t>(magnitude(s.shear)) * height) /
      s.step_x);
  s.height = static_cast<int32_t>(static_cast<int64_t>(height) * kOne / s.step_y);
  return s;
}

void to_image(const Squeeze& s, double u, double v, double* x, double* y) {
  const double down = (v + 0.5) * s.step_y;  // from the upper edge
  const double right =
      (u + 0.5) * s.step_x + static_cast<double>(s.first_x) + s.shear * (down / kOne);
  *x = right / kOne - 0.5;
  *y = down / kOne - 0.5;
}

size_t squeeze_bytes(const Squeeze& s, int32_t width) {
  const size_t columns = static_cast<size_t>(s.width);
  return 2 * arena_bytes<uint8_t>(columns * static_cast<size_t>(s.height)) +
         kRows * arena_bytes<uint16_t>(columns) + arena_bytes<uint32_t>(static_cast<size_t>(width));
}

Squeezed squeeze_image(const tvk_set& set, const tv_image& image, const tv_image* mask,
                       const Squeeze& s, Arena& arena) {
  const size_t columns = static_cast<size_t>(s.width);
  const size_t pixels = columns * static_cast<size_t>(s.height);
  const tvk_squeeze_table& kernels = *tvk_squeeze_of(&set);
  uint8_t* const squeezed = arena_alloc<uint8_t>(arena, pixels);
  uint8_t* const masked = arena_alloc<uint8_t>(arena, pixels);
  ArenaScope scope(arena);
  uint16_t* rows[kRows];  // the squeezed columns of the image's rows; row y is in rows[y % kRows]
  for (uint16_t*& row : rows) row = arena_alloc<uint16_t>(arena, columns);
  uint32_t* const sums = arena_alloc<uint32_t>(arena, static_cast<size_t>(image.width));
  int32_t made = 0;
  for (int32_t v = 0; v < s.height; ++v) {
    const Footprint f = footprint(s, v);
    const uint16_t* taken[kRows];
    for (int k = 0; k < kRows; ++k) {
      const int32_t y = f.weights[k] != 0 ? f.first + k : f.first;
      for (; made <= y; ++made) {
        kernels.squeeze_row(image.data + made * image.stride_bytes, image.width,
                            begin_of(s, 2 * made + 1), s.step_x, s.width, sums, rows[made % kRows]);
      }
      taken[k] = rows[y % kRows];
    }
    kernels.mix_rows(taken, f.weights, s.width, squeezed + static_cast<size_t>(v) * columns);
    mask_row(s, image, mask, v, masked + static_cast<size_t>(v) * columns);
  }
  return Squeezed{{squeezed, s.width, s.height, s.width}, {masked, s.width, s.height, s.width}};
}

}  // namespace tv
