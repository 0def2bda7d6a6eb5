// Elementary functions whose bits are equal on every CPU: only + - * /, sqrt and integer
// operations, in a written order, compiled without contraction. Nothing from libm but sqrt.
//
// Errors are below 1 ulp (atan2 below 1.5; asin, acos and tan below 2.5); NaN in gives NaN out.
// Formulas, bounds and tests: docs/algorithms/math.md.
#pragma once

namespace tv {

inline constexpr double kPi = 3.14159265358979323846;

// Neither infinite nor NaN.
inline bool is_finite(double x) { return x - x == 0.0; }
bool all_finite(const double* values, int num_values);

double atan2(double y, double x);  // (-pi, pi]; atan2(0, 0) = 0; -0 counts as 0
double atan(double x);
void sincos(double angle_rad, double* sine, double* cosine);  // |angle| up to 2^20, NaN beyond
double tan(double angle_rad);                                 // |angle| < pi/2
double acos(double x);                                        // x is clamped to [-1, 1]
double asin(double x);                                        // x is clamped to [-1, 1]
double exp(double x);
double log(double x);  // x > 0; log(0) = -inf, NaN below

}  // namespace tv
