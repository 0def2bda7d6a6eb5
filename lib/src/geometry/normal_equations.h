// Normal equations of robust least squares for a 3x3 model matrix over matches, for Sampson's
// distance and for the transfer residual, and the robust losses they are weighted with.
//
// The kernels add up the sums for the matrix's nine entries (kernels/sampson.h,
// kernels/transfer.h); here these are projected to a model's own parameters. Weights are those of
// iteratively reweighted least squares: the derivative of rho by q = r^2 / scale^2. Tests:
// test/unit/test_residuals.cc, against finite differences.
#pragma once

#include <cstdint>

#include "geometry/ray_pairs.h"

namespace tv {

// With q = r^2 / scale^2, kTruncated is min(q, 1), and kCauchy is log(1 + q) up to q =
// TVK_LARGEST_LOSS and constant from there on.
enum class Loss { kTruncated, kCauchy };

struct RobustLoss {
  Loss kind;
  double scale_px;
};

// Plain least squares, written as a truncated loss: no residual reaches this scale.
inline constexpr RobustLoss kLeastSquares{Loss::kTruncated, 1e140};

// Normal equations of sum rho(r_i^2) over the listed matches for a model matrix M with at most nine
// parameters, columns[p] = dM / dparameter p. With J the Jacobian of the residuals and W their
// weights, upper is the upper triangle of J' W J, packed row by row, and gradient is J' W r.
// Returns the sum of rho, in units of scale^2. indices null: matches 0 .. count - 1.
double sampson_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                const Mat3& M, const Mat3* columns, int num_parameters,
                                const RobustLoss& loss, double* upper, double* gradient);

// Like sampson_normal_equations, for the transfer residual of a matrix H. columns null: the
// parameters are H's nine entries.
double transfer_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                 const Mat3& H, const Mat3* columns, int num_parameters,
                                 const RobustLoss& loss, double* upper, double* gradient);

}  // namespace tv
