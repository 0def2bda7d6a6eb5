// Elementary functions whose results have the same bits on every CPU. Each function reduces its
// argument to a short interval, with constants stored in two or three parts (W. J. Cody, W. Waite,
// "Software Manual for the Elementary Functions", 1980), sums a Taylor series there, and adds the
// rounding error of the reduction in the last addition, so that a single rounding dominates the
// error. Series lengths and error bounds: docs/algorithms/math.md; test: test/unit/test_math.cc.
#include "base/math.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

namespace tv {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

uint64_t bits_of(double x) {
  uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}

double double_of(uint64_t bits) {
  double x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

// 2^exponent, for exponents in [-1022, 1023]: the result is then a normal number.
double power_of_two(int exponent) {
  return double_of(static_cast<uint64_t>(exponent + 1023) << 52);
}

int nearest_int(double x) { return static_cast<int>(x + __builtin_copysign(0.5, x)); }

// An unevaluated sum: high is the rounded value and low the rounding error.
struct Pair {
  double high, low;
};

// Knuth's TwoSum: a + b as a Pair without any error, whichever of the two is larger.
Pair exact_sum(double a, double b) {
  const double sum = a + b;
  const double b_seen = sum - a;
  const double a_seen = sum - b_seen;
  return {sum, (a - a_seen) + (b - b_seen)};
}

// ---- sine and cosine ----

// pi/2 as a sum of parts of 33, 33 and 53 bits. The first two parts times an integer up to 2^20 are
// exact in a double.
constexpr double kHalfPi1 = 0x1.921fb54400000p+0;
constexpr double kHalfPi2 = 0x1.0b4611a600000p-34;
constexpr double kHalfPi3 = 0x1.3198a2e037073p-69;
constexpr double kTwoOverPi = 0x1.45f306dc9c883p-1;
constexpr double kMaxAngle = 1048576.0;

// Taylor series at 0 for |r| <= pi/4; the first omitted term is below 2^-63 of the result. `low` is
// the rounding error of r: the angle is r + low.
double sine_series(double r, double low) {
  const double z = r * r;
  double p = 1.0 / 355687428096000.0;
  p = p * z - 1.0 / 1307674368000.0;
  p = p * z + 1.0 / 6227020800.0;
  p = p * z - 1.0 / 39916800.0;
  p = p * z + 1.0 / 362880.0;
  p = p * z - 1.0 / 5040.0;
  p = p * z + 1.0 / 120.0;
  p = p * z - 1.0 / 6.0;
  return r + (r * z * p + low * (1.0 - 0.5 * z));
}

double cosine_series(double r, double low) {
  const double z = r * r;
  double p = -1.0 / 6402373705728000.0;
  p = p * z + 1.0 / 20922789888000.0;
  p = p * z - 1.0 / 87178291200.0;
  p = p * z + 1.0 / 479001600.0;
  p = p * z - 1.0 / 3628800.0;
  p = p * z + 1.0 / 40320.0;
  p = p * z - 1.0 / 720.0;
  p = p * z + 1.0 / 24.0;
  const double half_z = 0.5 * z;
  const double head = 1.0 - half_z;
  return head + (((1.0 - head) - half_z) + (z * z * p - r * low));
}

// ---- arctangent ----

// kAtanEighths[i] is atan(i / 8).
constexpr Pair kAtanEighths[9] = {{0.0, 0.0},
                                  {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
                                  {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                  {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
                                  {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                  {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
                                  {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                  {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
                                  {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}};
constexpr Pair kPiParts = {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53};
constexpr Pair kHalfPiParts = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};

// atan(z) - z by Taylor series for |z| <= 1/8; the first omitted term is below 2^-64 of z.
double atan_series_beyond_first(double z) {
  const double s = z * z;
  double p = -1.0 / 19.0;
  p = p * s + 1.0 / 17.0;
  p = p * s - 1.0 / 15.0;
  p = p * s + 1.0 / 13.0;
  p = p * s - 1.0 / 11.0;
  p = p * s + 1.0 / 9.0;
  p = p * s - 1.0 / 7.0;
  p = p * s + 1.0 / 5.0;
  p = p * s - 1.0 / 3.0;
  return z * s * p;
}

// atan(smaller / larger) as an unevaluated sum, for finite arguments with 0 <= smaller <= larger
// and 0 < larger: atan(c) + atan((smaller - c larger) / (larger + c smaller)), where c is the
// multiple of 1/8 nearest to the ratio.
Pair atan_of_ratio(double smaller, double larger) {
  const double ratio = smaller / larger;
  if (ratio < 0.125) return {ratio, atan_series_beyond_first(ratio)};
  const int eighth = static_cast<int>(8.0 * ratio + 0.5);
  // The scale keeps the products below clear of overflow and of subnormal numbers. The two
  // arguments are within a factor of 8 of each other here.
  const double scale = larger > 0x1p1000 ? 0x1p-100 : larger < 0x1p-800 ? 0x1p200 : 1.0;
  const double y = smaller * scale;
  const double x = larger * scale;
  const double c = eighth * 0.125;
  // c x is subtracted as two exact products, so that cancellation loses no bits.
  const double x_head = double_of(bits_of(x) & ~UINT64_C(0x7ffffff));
  const double numerator = (y - c * x_head) - c * (x - x_head);
  const double z = numerator / (x + c * y);
  const Pair& base = kAtanEighths[eighth];
  const Pair sum = exact_sum(base.high, z);
  return {sum.high, sum.low + (base.low + atan_series_beyond_first(z))};
}

Pair subtract(const Pair& a, const Pair& b) {
  const Pair difference = exact_sum(a.high, -b.high);
  return {difference.high, difference.low + (a.low - b.low)};
}

// ---- exponential and logarithm ----

constexpr double kLn2High =
    0x1.62e42fefa2000p-1;  // 40 bits: its product with any exponent is exact
constexpr double kLn2Low = 0x1.9ef35793c7673p-41;
constexpr double kOneOverLn2 = 0x1.71547652b82fep+0;

// exp(r) - 1 - r for |r| <= ln(2)/2; the first omitted term is below 2^-57.
double exp_series_beyond_second(double r) {
  double p = 1.0 / 6227020800.0;
  p = p * r + 1.0 / 479001600.0;
  p = p * r + 1.0 / 39916800.0;
  p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0;
  p = p * r + 1.0 / 40320.0;
  p = p * r + 1.0 / 5040.0;
  p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0;
  p = p * r + 1.0 / 24.0;
  p = p * r + 1.0 / 6.0;
  p = p * r + 1.0 / 2.0;
  return r * r * p;
}

// log((1 + s) / (1 - s)) / s - 2 as a series in z = s^2, for |s| <= 0.1716.
double log_series(double z) {
  double p = 2.0 / 23.0;
  p = p * z + 2.0 / 21.0;
  p = p * z + 2.0 / 19.0;
  p = p * z + 2.0 / 17.0;
  p = p * z + 2.0 / 15.0;
  p = p * z + 2.0 / 13.0;
  p = p * z + 2.0 / 11.0;
  p = p * z + 2.0 / 9.0;
  p = p * z + 2.0 / 7.0;
  p = p * z + 2.0 / 5.0;
  p = p * z + 2.0 / 3.0;
  return z * p;
}

double clamp_to_one(double x) { return x > 1.0 ? 1.0 : x < -1.0 ? -1.0 : x; }

}  // namespace

void sincos(double angle_rad, double* sine, double* cosine) {
  if (!(angle_rad >= -kMaxAngle && angle_rad <= kMaxAngle)) {
    *sine = kNaN;
    *cosine = kNaN;
    return;
  }
  const int quadrant = nearest_int(angle_rad * kTwoOverPi);
  double r = angle_rad;
  double low = 0.0;
  if (quadrant != 0) {
    const double first = angle_rad - quadrant * kHalfPi1;  // this difference is exact
    const Pair second = exact_sum(first, -(quadrant * kHalfPi2));
    const double tail = second.low - quadrant * kHalfPi3;
    r = second.high + tail;
    low = (second.high - r) + tail;
  }
  const double s = sine_series(r, low);
  const double c = cosine_series(r, low);
  // A quarter of a turn makes sine and cosine (c, -s). Without a branch, because the quadrants of
  // keypoints are random.
  const uint64_t turns = static_cast<uint64_t>(quadrant), odd = 0 - (turns & 1);
  const uint64_t swapped = (bits_of(s) ^ bits_of(c)) & odd;
  *sine = double_of((bits_of(s) ^ swapped) ^ (turns & 2) << 62);
  *cosine = double_of((bits_of(c) ^ swapped) ^ ((turns + 1) & 2) << 62);
}

double tan(double angle_rad) {
  double sine, cosine;
  sincos(angle_rad, &sine, &cosine);
  return sine / cosine;
}

double atan2(double y, double x) {
  if (y != y || x != x) return kNaN;
  double size_y = y < 0 ? -y : y;
  double size_x = x < 0 ? -x : x;
  // Beside an infinite size, a finite one counts as 0.
  if (size_y == kInfinity || size_x == kInfinity) {
    size_y = size_y == kInfinity ? 1.0 : 0.0;
    size_x = size_x == kInfinity ? 1.0 : 0.0;
  }
  if (size_x == 0.0 && size_y == 0.0) return 0.0;
  Pair angle;
  if (size_y <= size_x) {
    angle = atan_of_ratio(size_y, size_x);
    if (x < 0) angle = subtract(kPiParts, angle);
  } else {
    angle = atan_of_ratio(size_x, size_y);
    if (x < 0) angle = {-angle.high, -angle.low};
    angle = subtract(kHalfPiParts, angle);
  }
  const double size = angle.high + angle.low;
  return y < 0 ? -size : size;
}

double atan(double x) { return atan2(x, 1.0); }

// Computes 1 - x^2 as (1 - x)(1 + x), which does not cancel near 1.
double acos(double x) {
  const double c = clamp_to_one(x);
  return atan2(std::sqrt((1.0 - c) * (1.0 + c)), c);
}

double asin(double x) {
  const double s = clamp_to_one(x);
  return atan2(s, std::sqrt((1.0 - s) * (1.0 + s)));
}

double exp(double x) {
  if (x != x) return kNaN;
  if (x > 709.79) return kInfinity;
  if (x < -745.2) return 0.0;
  const int exponent = nearest_int(x * kOneOverLn2);
  const double head = x - exponent * kLn2High;  // this difference is exact
  const double tail = exponent * kLn2Low;
  const double r = head - tail;
  const double low = (head - r) - tail;
  const double value = 1.0 + (r + (low * (1.0 + r) + exp_series_beyond_second(r)));
  if (exponent > 1022) return value * power_of_two(exponent - 1) * 2.0;
  if (exponent >= -1021) return value * power_of_two(exponent);
  return value * power_of_two(exponent + 100) * 0x1p-100;  // a subnormal is rounded only here
}

double log(double x) {
  if (!(x > 0.0)) return x == 0.0 ? -kInfinity : kNaN;
  if (x == kInfinity) return kInfinity;
  int exponent = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= 0x1p54;
    exponent = -54;
  }
  // Splits x = 2^exponent m with m in [sqrt(1/2), sqrt(2)).
  uint64_t bits = bits_of(x);
  exponent += static_cast<int>(bits >> 52) - 1023;
  bits = (bits & UINT64_C(0xfffffffffffff)) | UINT64_C(0x3ff0000000000000);
  double m = double_of(bits);
  if (m > 1.4142135623730951) {
    m *= 0.5;
    exponent += 1;
  }
  // log(1 + f) = f - (f^2/2 - s (f^2/2 + R)), s = f / (2 + f), R = log_series(s^2). The small terms
  // are added first.
  const double f = m - 1.0;
  const double s = f / (2.0 + f);
  const double half_square = 0.5 * f * f;
  const double r = log_series(s * s);
  return exponent * kLn2High + (f - (half_square - (s * (half_square + r) + exponent * kLn2Low)));
}

bool all_finite(const double* values, int num_values) {
  for (int i = 0; i < num_values; ++i) {
    if (!is_finite(values[i])) return false;
  }
  return true;
}

}  // namespace tv
