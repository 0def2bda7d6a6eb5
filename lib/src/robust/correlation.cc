#include "robust/correlation.h"

#include <algorithm>
#include <utility>

#include "base/math.h"
#include "robust/ldlt.h"

namespace tv {
namespace {

constexpr int kLevels = 3, kBlocks = 1 << kLevels, kPose = PoseModel::kParameters;
constexpr int kMost = PlaneModel::kParameters, kPacked = kMost * (kMost + 1) / 2;

// kappa counts from the first value on, and in full from the first plus the second. In pairs whose
// errors are independent, kappa seldom exceeds it.
constexpr double kFirstKappa = 1.35, kKappaWidth = 0.2;
constexpr double kJackknives = 4;  // docs/decisions/0024-honest-covariance.md

// Splits indices[0 .. count) at the mean of the coordinate that extends farthest; returns where.
int split(const PoseRefiner& f, int32_t* indices, int count) {
  double widest = -1, at = 0;
  int chosen = 0;
  const auto coordinate = [&f](int32_t i, int c) {
    return f.problem.pixels[c / 2][2 * f.matches.order[i] + c % 2];
  };
  for (int c = 0; c < 4 && count > 0; ++c) {
    double low = coordinate(indices[0], c), high = low, sum = 0;
    for (int k = 0; k < count; ++k) {
      const double x = coordinate(indices[k], c);
      low = std::min(low, x);
      high = std::max(high, x);
      sum += x;
    }
    if (!(high - low > widest)) continue;
    widest = high - low;
    chosen = c;
    at = sum / count;
  }
  int first = 0, last = count;
  while (first < last) {
    if (coordinate(indices[first], chosen) <= at) {
      ++first;
    } else {
      std::swap(indices[first], indices[--last]);
    }
  }
  return first;
}

struct BlockSums {
  double upper[kBlocks + 1][kPacked], gradient[kBlocks + 1][kMost];  // the last is that of all
};

// The packed upper triangle times a vector.
void multiply(int num, const double* upper, const double* x, double* product) {
  for (int r = 0; r < num; ++r) product[r] = 0;
  for (int r = 0, slot = 0; r < num; ++r) {
    for (int c = r; c < num; ++c, ++slot) {
      product[r] += upper[slot] * x[c];
      if (c != r) product[c] += upper[slot] * x[r];
    }
  }
}

// tr(M A M A) of a full symmetric M and a packed A.
double trace_of_square(int num, const double* M, const double* upper) {
  double product[kMost * kMost], sum = 0;
  for (int r = 0; r < num; ++r) multiply(num, upper, M + num * r, product + num * r);  // M A
  for (int r = 0; r < num; ++r) {
    for (int c = 0; c < num; ++c) sum += product[num * r + c] * product[num * c + r];
  }
  return sum;
}

double trace_of_product(int num, const double* M, const double* upper) {
  double sum = 0;
  for (int r = 0, slot = 0; r < num; ++r) {
    for (int c = r; c < num; ++c) sum += (c == r ? 1 : 2) * M[num * r + c] * upper[slot++];
  }
  return sum;
}

double add_jackknife(int num, BlockSums& sums, const PoseUncertainty& uncertainty,
                     double covariance[25]) {
  const int packed = num * (num + 1) / 2;
  double *const all = sums.upper[kBlocks], *const slope = sums.gradient[kBlocks];
  for (int b = 0; b < kBlocks; ++b) {
    for (int k = 0; k < packed; ++k) all[k] += sums.upper[b][k];
    for (int k = 0; k < num; ++k) slope[k] += sums.gradient[b][k];
  }
  double inverse[kMost * kMost], step[kMost], jackknife[kPose * kPose] = {};
  if (!invert_symmetric(num, all, inverse) || !solve_damped(num, all, slope, 0, step)) return 1;
  double measured = 0, expected = 0;
  for (int b = 0; b < kBlocks; ++b) {
    double *const left = sums.upper[b], *const of_left = sums.gradient[b], without[kMost];
    expected += trace_of_product(num, inverse, left) - trace_of_square(num, inverse, left);
    for (int r = 0; r < num; ++r) {
      for (int c = 0; c < num; ++c) measured += of_left[r] * inverse[num * r + c] * of_left[c];
    }
    for (int k = 0; k < packed; ++k) left[k] = all[k] - left[k];
    for (int k = 0; k < num; ++k) of_left[k] = slope[k] - of_left[k];
    // Where the matches of the other blocks do not determine the model, the curvature of all blocks
    // is used in place of theirs.
    if (!solve_damped(num, left, of_left, 0, without)) solve_damped(num, all, of_left, 0, without);
    for (int r = 0; r < kPose; ++r) {
      for (int c = 0; c < kPose; ++c) {
        jackknife[kPose * r + c] += (without[r] - step[r]) * (without[c] - step[c]);
      }
    }
  }
  const double w = uncertainty.mean_weight, s = uncertainty.mean_slope;
  const double kappa = measured * w / (expected * uncertainty.variance_px * s * s);
  if (!(kappa > kFirstKappa)) return 1;
  const double share = std::min(1.0, (kappa - kFirstKappa) / kKappaWidth);
  const double factor = kJackknives * share * (kBlocks - 1) / kBlocks * (w / s) * (w / s);
  double before[kPose * (kPose + 1) / 2], information[kPose * kPose], growth = 0;
  for (int r = 0, slot = 0; r < kPose; ++r) {
    for (int c = r; c < kPose; ++c) before[slot++] = covariance[kPose * r + c];
  }
  if (!invert_symmetric(kPose, before, information)) return 1;
  for (int k = 0; k < kPose * kPose; ++k) {
    if (!is_finite(jackknife[k])) return 1;
    growth += factor * jackknife[k] * information[k];
  }
  for (int k = 0; k < kPose * kPose; ++k) covariance[k] += factor * jackknife[k];
  return 1 + growth / kPose;
}

// One of the two models; the other is null. Called by its type and not through a pointer, so that
// rules/stack sees what is called.
struct EitherModel {
  const PoseModel* pose;
  const PlaneModel* plane;
};

double normal_equations(const EitherModel& model, const RayPairs& pairs, const int32_t* indices,
                        int count, const RobustLoss& loss, double* upper, double* gradient) {
  if (model.pose != nullptr) {
    return model.pose->normal_equations(pairs, indices, count, loss, upper, gradient);
  }
  return model.plane->normal_equations(pairs, indices, count, loss, upper, gradient);
}

TVK_NOINLINE double add_of_model(const PoseRefiner& f, int count, const EitherModel& model,
                                 const RobustLoss& loss, const PoseUncertainty& uncertainty,
                                 double covariance[25]) {
  BlockSums sums = {};
  int ends[kBlocks + 1] = {};
  ends[kBlocks] = count;
  for (int step = kBlocks; step > 1; step /= 2) {
    for (int b = 0; b < kBlocks; b += step) {
      ends[b + step / 2] = ends[b] + split(f, f.indices + ends[b], ends[b + step] - ends[b]);
    }
  }
  for (int b = 0; b < kBlocks; ++b) {
    if (ends[b + 1] == ends[b]) continue;
    normal_equations(model, f.matches.pairs, f.indices + ends[b], ends[b + 1] - ends[b], loss,
                     sums.upper[b], sums.gradient[b]);
  }
  const int num = model.pose != nullptr ? PoseModel::kParameters : PlaneModel::kParameters;
  return add_jackknife(num, sums, uncertainty, covariance);
}

}  // namespace

double add_correlation(const PoseRefiner& f, int count, const PoseModel& model,
                       const RobustLoss& loss, const PoseUncertainty& uncertainty,
                       double covariance[25]) {
  return add_of_model(f, count, {&model, nullptr}, loss, uncertainty, covariance);
}

double add_correlation(const PoseRefiner& f, int count, const PlaneModel& model,
                       const RobustLoss& loss, const PoseUncertainty& uncertainty,
                       double covariance[25]) {
  return add_of_model(f, count, {nullptr, &model}, loss, uncertainty, covariance);
}

}  // namespace tv
