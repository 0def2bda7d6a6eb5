// Elementary functions whose results have the same bits on every CPU. They use only + - * /, sqrt
// and integer operations in a fixed order, and are compiled without contraction
// (-ffp-contract=off). The library calls them instead of libm's, of which it uses only sqrt.
//
// Errors are below 1 ulp (atan2 below 1.5; asin, acos and tan below 2.5). A NaN argument gives NaN.
// Formulas, bounds and tests: docs/algorithms/math.md.
#pragma once

namespace tv {

inline constexpr double kPi = 3.14159265358979323846;

// True when x is neither infinite nor NaN.
inline bool is_finite(double x) { return x - x == 0.0; }
bool all_finite(const double* values, int num_values);

double atan2(double y, double x);  // in (-pi, pi]; atan2(0, 0) = 0; -0 counts as 0
double atan(double x);
void sincos(double angle_rad, double* sine, double* cosine);  // |angle| <= 2^20, else NaN
double tan(double angle_rad);                                 // for |angle| < pi/2
double acos(double x);                                        // x is clamped to [-1, 1]
double asin(double x);                                        // x is clamped to [-1, 1]
double exp(double x);
double log(double x);  // log(0) = -inf; NaN for x < 0

}  // namespace tv
