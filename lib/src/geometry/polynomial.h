// Real roots of polynomials of a small degree, by Sturm's theorem.
#pragma once

namespace tv {

constexpr int kMaxDegree = 10;

// Real roots within +-1e6, ascending; repeated ones once. `p` holds degree + 1 coefficients, the
// lowest power first, degree <= kMaxDegree. A leading coefficient of zero gives none. Returns their
// number.
int real_roots(const double* p, int degree, double* roots);

}  // namespace tv
