#include "geometry/polynomial.h"

#include <cmath>

namespace tv {
namespace {

// Sturm's chain of a polynomial: p[0] = p, p[1] = p', p[k-1] = (a[k] z + b[k]) p[k] - c[k] p[k+1],
// c > 0. Only the quotients are kept: evaluation from the chain's constant end takes three
// multiplications a link. (D. G. Hook, P. R. McAree, "Using Sturm sequences to bracket real roots
// of polynomial equations", Graphics Gems, 1990, with the quotients in place of the polynomials.)
struct SturmChain {
  int length;  // number of links; fewer than the degree where roots are repeated
  double slope[kMaxDegree], offset[kMaxDegree], scale[kMaxDegree];
  double last;  // sign of the chain's last polynomial, a constant
};

// p holds the coefficients, the lowest power first; p[degree] is not 0.
SturmChain sturm_chain(const double* p, int degree) {
  double previous[kMaxDegree + 1], current[kMaxDegree + 1];
  for (int i = 0; i <= degree; ++i) previous[i] = p[i];
  for (int i = 0; i < degree; ++i) current[i] = (i + 1) * p[i + 1] / (degree * p[degree]);
  const double sign = p[degree] < 0 ? -1.0 : 1.0;  // p' is scaled to leading coefficient +-1
  for (int i = 0; i < degree; ++i) current[i] *= sign;
  SturmChain chain;
  chain.length = 0;
  chain.last = sign;
  // The polynomial `current` has degree d and leading coefficient +-1 throughout.
  for (int d = degree - 1; d >= 0; --d) {
    const double lead = current[d];  // 1 or -1
    const double slope = previous[d + 1] * lead;
    const double offset =
        d > 0 ? (previous[d] - slope * current[d - 1]) * lead : previous[0] * lead;
    chain.slope[chain.length] = slope;
    chain.offset[chain.length] = offset;
    chain.scale[chain.length] = 0;
    ++chain.length;
    chain.last = lead;
    if (d == 0) break;
    // -remainder = slope z current + offset current - previous, of degree below d
    double remainder[kMaxDegree];
    for (int i = 0; i < d; ++i) {
      remainder[i] = (offset * current[i] + (i > 0 ? slope * current[i - 1] : 0.0)) - previous[i];
    }
    const double lead_size = std::fabs(remainder[d - 1]);
    if (!(lead_size > 1e-300)) break;
    chain.scale[chain.length - 1] = lead_size;
    const double inverse = 1.0 / lead_size;
    for (int i = 0; i <= d; ++i) previous[i] = current[i];
    for (int i = 0; i < d - 1; ++i) current[i] = remainder[i] * inverse;
    current[d - 1] = remainder[d - 1] < 0 ? -1.0 : 1.0;
  }
  return chain;
}

// How often the chain's sign changes at z. The number of distinct real roots in (low, high] is
// sign_changes at low less that at high.
int sign_changes(const SturmChain& chain, double z) {
  double next = 0, current = chain.last;
  int changes = 0;
  for (int k = chain.length - 1; k >= 0; --k) {
    const double quotient = chain.slope[k] * z + chain.offset[k];
    const double previous = quotient * current - chain.scale[k] * next;
    changes += (previous < 0) != (current < 0);
    next = current;
    current = previous;
  }
  return changes;
}

double polynomial_value(const double* p, int degree, double z, double* derivative) {
  double value = p[degree], slope = 0;
  for (int i = degree - 1; i >= 0; --i) {
    slope = slope * z + value;
    value = value * z + p[i];
  }
  *derivative = slope;
  return value;
}

// The one root in (low, high], by Newton's method with bisection where a step leaves the bracket.
double bracketed_root(const double* p, int degree, double low, double high) {
  double slope;
  const double at_low = polynomial_value(p, degree, low, &slope);
  const double at_high = polynomial_value(p, degree, high, &slope);
  const bool low_negative = at_low < 0;
  if (low_negative == (at_high < 0)) {  // within rounding, the root is an end of the bracket
    return std::fabs(at_low) < std::fabs(at_high) ? low : high;
  }
  double z = 0.5 * (low + high);
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double value = polynomial_value(p, degree, z, &slope);
    if ((value < 0) == low_negative) {
      low = z;
    } else {
      high = z;
    }
    const double newton = z - value / slope;
    const bool inside = newton > low && newton < high;
    const double next = inside ? newton : 0.5 * (low + high);
    const double step = std::fabs(next - z);
    z = next;
    // Newton's method squares its error: after a step this short, the next one would be below
    // rounding.
    if (step <= (inside ? 1e-9 : 1e-15) * (1 + std::fabs(z))) break;
  }
  return z;
}

}  // namespace

int real_roots(const double* p, int degree, double* roots) {
  if (!(std::fabs(p[degree]) > 1e-300) || !(std::fabs(p[degree]) < 1e300)) return 0;
  const SturmChain chain = sturm_chain(p, degree);
  struct Interval {
    double low, high;
    int changes_low, changes_high;
  };
  Interval stack[64];
  constexpr double kBound = 1e6;
  int depth = 0, num_roots = 0;
  stack[depth++] = {-kBound, kBound, sign_changes(chain, -kBound), sign_changes(chain, kBound)};
  while (depth > 0) {
    const Interval interval = stack[--depth];
    const int count = interval.changes_low - interval.changes_high;
    if (count <= 0) continue;
    const double width = interval.high - interval.low;
    // Newton's method starts only in a bracket that is at most 0.5 plus the root's size wide.
    const double size = std::fabs(interval.high) > std::fabs(interval.low)
                            ? std::fabs(interval.low)
                            : std::fabs(interval.high);
    const bool tiny = width <= 1e-12 * (1 + size);
    if (tiny || (count == 1 && width <= 0.5 + size)) {
      roots[num_roots++] = tiny ? 0.5 * (interval.low + interval.high)
                                : bracketed_root(p, degree, interval.low, interval.high);
      if (num_roots == degree) break;
      continue;
    }
    double middle;
    if (interval.low < 0 && interval.high > 0) {
      middle = 0;
    } else if (width <= 2) {
      middle = 0.5 * (interval.low + interval.high);
    } else {  // about the geometric mean: roots are like tangents of evenly spread angles
      const double low = interval.low < 0 ? -interval.high : interval.low;
      const double high = interval.low < 0 ? -interval.low : interval.high;
      const double size_middle =
          low < 1 ? 1.0 : (high > 16 * low ? 4 * low : std::sqrt(low * high));
      middle = interval.low < 0 ? -size_middle : size_middle;
    }
    const int changes = sign_changes(chain, middle);
    stack[depth++] = {middle, interval.high, changes, interval.changes_high};
    stack[depth++] = {interval.low, middle, interval.changes_low, changes};
  }
  return num_roots;
}

}  // namespace tv
