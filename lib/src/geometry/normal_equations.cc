#include "geometry/normal_equations.h"

#include "base/math.h"

namespace tv {
namespace {

// The sum over the lanes of one of the kernel's sums, in a fixed order.
inline double over_lanes(const double* x) {
  return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}

using SumsKernel = void (*)(const double* const*, const int32_t*, int32_t, int32_t, int32_t,
                            const double*, double, int32_t, double*);

// Calls the kernel for all matches and adds its lanes together. totals receives all of the kernel's
// num_sums sums but the last two; these give the loss, which is returned. The logarithms of
// Cauchy's loss are taken of products of at most kFactors factors, each at most 1 +
// TVK_LARGEST_LOSS, so that no product overflows.
double add_up(SumsKernel kernel, int num_sums, const RayPairs& pairs, const int32_t* indices,
              int count, const Mat3& M, const RobustLoss& loss, double* totals) {
  constexpr int kFactors = 64;
  const KernelArrays arrays = kernel_arrays(pairs);
  const KernelModel entries = kernel_model(M);
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  const bool cauchy = loss.kind == Loss::kCauchy;
  double sums[TVK_SAMPSON_SUMS][TVK_WIDTH] = {};
  double* products = sums[num_sums - 1];
  double cost = 0;
  for (int first = 0; first < count; first += TVK_WIDTH * kFactors) {
    const int some = count - first < TVK_WIDTH * kFactors ? count - first : TVK_WIDTH * kFactors;
    for (int l = 0; l < TVK_WIDTH; ++l) products[l] = 1;
    kernel(arrays.p, indices ? indices + first : nullptr, first, some, pairs.on_plane, entries.m,
           inverse_sq, cauchy, sums[0]);
    for (int l = 0; l < TVK_WIDTH && cauchy; ++l) cost += log(products[l]);
  }
  for (int k = 0; k < num_sums - 2; ++k) totals[k] = over_lanes(sums[k]);
  return cauchy ? cost : over_lanes(sums[num_sums - 2]);
}

// Written without a loop, in which each addition would wait for the one before.
double dot9(const double* a, const double* b) {
  return (((((((a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]) + a[3] * b[3]) + a[4] * b[4]) +
            a[5] * b[5]) +
           a[6] * b[6]) +
          a[7] * b[7]) +
         a[8] * b[8];
}

// From the normal equations of the matrix's nine entries (full, slope) to those of `num`
// parameters, where d matrix / d parameter p = columns[p].
void project(const double full[9][9], const double slope[9], const Mat3* columns, int num,
             double* upper, double* gradient) {
  double flat[9][9];
  for (int p = 0; p < num; ++p) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) flat[p][3 * r + c] = columns[p](r, c);
    }
  }
  for (int p = 0; p < num; ++p) {
    double product[9];
    for (int i = 0; i < 9; ++i) product[i] = dot9(full[i], flat[p]);
    gradient[p] = dot9(flat[p], slope);
    for (int r = p; r < num; ++r) *upper++ = dot9(flat[r], product);
  }
}

}  // namespace

double sampson_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                const Mat3& M, const Mat3* columns, int num_parameters,
                                const RobustLoss& loss, double* upper, double* gradient) {
  double totals[TVK_SAMPSON_SUMS - 2], full[9][9];
  const double cost =
      add_up(pairs.kernels->sampson_sums, TVK_SAMPSON_SUMS, pairs, indices, count, M, loss, totals);
  int slot = 0;
  for (int i = 0; i < 9; ++i) {
    for (int j = i; j < 9; ++j) full[i][j] = full[j][i] = totals[slot++];
  }
  project(full, totals + 45, columns, num_parameters, upper, gradient);
  return cost;
}

double transfer_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                 const Mat3& H, const Mat3* columns, int num_parameters,
                                 const RobustLoss& loss, double* upper, double* gradient) {
  static constexpr int kPlace[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  double totals[TVK_TRANSFER_SUMS - 2], full[9][9];
  const double cost = add_up(pairs.kernels->transfer_sums, TVK_TRANSFER_SUMS, pairs, indices, count,
                             H, loss, totals);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) {
      full[i][j] = totals[6 * kPlace[i / 3][j / 3] + kPlace[i % 3][j % 3]];
    }
  }
  if (columns != nullptr) {
    project(full, totals + 36, columns, num_parameters, upper, gradient);
    return cost;
  }
  int slot = 0;
  for (int p = 0; p < 9; ++p) {
    gradient[p] = totals[36 + p];
    for (int r = p; r < 9; ++r) upper[slot++] = full[p][r];
  }
  return cost;
}

}  // namespace tv
