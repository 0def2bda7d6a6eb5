// Small symmetric systems, by the factorisation A = L D L' without pivoting (G. Golub, C. Van Loan,
// "Matrix computations", 4.1): the damped step of Levenberg-Marquardt, the inverse, and the case of
// three rows. A is given as its packed upper triangle, row by row, and is not negative. Tests:
// test/unit/test_residuals.cc, test/unit/test_bundle_ceres.cc, and through their callers.
#pragma once

namespace tv {

inline constexpr int kMostParameters = 9;  // the most rows that A may have

// Solves (A + lambda (diag(A) + 1e-9 d I)) step = -gradient, where d is the largest entry of
// diag(A). False when this matrix is not positive definite.
bool solve_damped(int num, const double* upper, const double* gradient, double lambda,
                  double* step);

// The inverse of A, full and row-major. False when A is singular to 13 digits.
bool invert_symmetric(int num, const double* upper, double* inverse);

// Solves V x = -g for V with the entries xx xy xz yy yz zz, without the loops of solve_damped: its
// sums have another order, so it gives other last bits than solve_damped with lambda 0 does.
bool solve_symmetric3(const double V[6], const double g[3], double x[3]);

}  // namespace tv
