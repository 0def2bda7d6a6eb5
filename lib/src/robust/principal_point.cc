#include "robust/principal_point.h"

#include <cmath>

#include "geometry/sampson.h"
#include "robust/ldlt.h"

namespace tv {
namespace {

constexpr int kPose = PoseModel::kParameters, kAll = kShiftedParameters;

// Where row r of the packed upper triangle of kAll parameters begins, at its diagonal.
constexpr int row_of(int r) { return r * kAll - r * (r - 1) / 2; }

}  // namespace

void shifted_equations(const TwoViewProblem& problem, const Matches& matches,
                       const int32_t* indices, int count, const GravityPoseModel& model,
                       const PrincipalPoint& point, const RobustLoss& loss, double noise_px,
                       ShiftedEquations* equations) {
  double *const upper = equations->upper, *const gradient = equations->gradient;
  double of_pose[kPose * (kPose + 1) / 2];
  model.normal_equations(matches.pairs, indices, count, loss, of_pose, gradient);
  for (int r = 0, slot = 0; r < kPose; ++r) {
    for (int c = r; c < kPose; ++c) upper[row_of(r) + c - r] = of_pose[slot++];
  }
  for (int k = 0; k < 2; ++k) {
    const double weight =
        point.is_free ? noise_px * noise_px / (point.sigma_px[k] * point.sigma_px[k]) : 0;
    gradient[kPose + k] = weight * point.shift_px[k];
    for (int c = k; c < 2; ++c) upper[row_of(kPose + k) + c - k] = c == k ? weight : 0;
  }
  const Mat3 E = essential_from_pose(model.pose);
  const Camera cameras[2] = {moved_camera(problem, 0, point.shift_px),
                             moved_camera(problem, 1, point.shift_px)};
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  double with_entries[2][9] = {}, with_point[3] = {}, curvature[2][9];
  for (int m = 0; m < count; ++m) {
    const int i = indices[m];
    const bool bends = ray_curvature(problem, matches, cameras[0], 0, i, curvature[0]) &&
                       ray_curvature(problem, matches, cameras[1], 1, i, curvature[1]);
    const double sigmas[2] = {matches.sigma(0, i), matches.sigma(1, i)};
    SampsonSlopes s;
    if (!sampson_slopes(matches.pairs, i, E, bends ? curvature : nullptr, sigmas, &s)) continue;
    const double weight =
        loss.kind == Loss::kCauchy ? 1 / (1 + s.residual * s.residual * inverse_sq) : 1;
    for (int k = 0; k < 2; ++k) {
      const double weighted = weight * s.by_point[k];
      gradient[kPose + k] += weighted * s.residual;
      for (int c = k; c < 2; ++c) with_point[k + c] += weighted * s.by_point[c];
      for (int e = 0; e < 9; ++e) with_entries[k][e] += weighted * s.by_entry[e];
    }
  }
  Mat3 columns[kPose];
  pose_columns(model.pose, columns);
  for (int k = 0; k < 2; ++k) {
    for (int c = k; c < 2; ++c) upper[row_of(kPose + k) + c - k] += with_point[k + c];
    for (int p = 0; p < kPose; ++p) {
      double sum = 0;
      for (int e = 0; e < 9; ++e) sum += with_entries[k][e] * columns[p].data()[e];
      upper[row_of(p) + kPose + k - p] = sum;
    }
  }
}

bool eliminate_pose(const ShiftedEquations& equations, double information[3], double gradient[2]) {
  constexpr double kDetermined = 1e-12;  // least share of an information that the pose may leave
  ShiftedEquations e = equations;
  double* const upper = e.upper;
  for (int p = 0; p < kPose; ++p) {
    const double* const row = upper + row_of(p) - p;
    if (!(row[p] > 0)) return false;
    for (int r = p + 1; r < kAll; ++r) {
      const double factor = row[r] / row[p];
      e.gradient[r] -= factor * e.gradient[p];
      for (int c = r; c < kAll; ++c) upper[row_of(r) + c - r] -= factor * row[c];
    }
  }
  for (int k = 0; k < 2; ++k) gradient[k] = e.gradient[kPose + k];
  for (int k = 0; k < 3; ++k) information[k] = upper[row_of(kPose) + k];
  const double *const before = equations.upper + row_of(kPose), *const s = information;
  return s[0] > kDetermined * before[0] && s[2] - s[1] / s[0] * s[1] > kDetermined * before[2];
}

bool add_shift_variance(const TwoViewProblem& problem, const Matches& matches,
                        const int32_t* indices, int count, const GravityPoseModel& model,
                        const PrincipalPoint& point, double variance_px, double covariance[25]) {
  ShiftedEquations equations;
  double all[kAll * kAll], alone[kPose * kPose], of_pose[kPose * (kPose + 1) / 2];
  shifted_equations(problem, matches, indices, count, model, point, kLeastSquares,
                    std::sqrt(variance_px), &equations);
  for (int r = 0, slot = 0; r < kPose; ++r) {
    for (int c = r; c < kPose; ++c) of_pose[slot++] = equations.upper[row_of(r) + c - r];
  }
  if (!invert_symmetric(kAll, equations.upper, all) || !invert_symmetric(kPose, of_pose, alone)) {
    return false;
  }
  for (int r = 0; r < kPose; ++r) {
    for (int c = 0; c < kPose; ++c) {
      covariance[kPose * r + c] += variance_px * (all[kAll * r + c] - alone[kPose * r + c]);
    }
  }
  return true;
}

}  // namespace tv
