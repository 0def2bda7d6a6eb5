#include "robust/calibration.h"

#include <cmath>

#include "geometry/homography_4pt.h"
#include "geometry/sampson.h"
#include "robust/ldlt.h"

namespace tv {
namespace {

constexpr int kPose = PoseModel::kParameters, kAll = 2 * kOfView;

// The standard deviation of a view's k-th parameter.
double sigma_of(const TwoViewProblem& problem, int view, int k) {
  const tv_estimate_options& o = problem.options;
  if (k == 0) return view == 0 ? o.focal_sigma0 : o.focal_sigma1;
  return view == 0 ? o.center_sigma0 : o.center_sigma1;
}

}  // namespace

bool has_calibration_sigmas(const TwoViewProblem& problem) {
  const tv_estimate_options& o = problem.options;
  return problem.calibrated &&
         (o.focal_sigma0 > 0 || o.focal_sigma1 > 0 || o.center_sigma0 > 0 || o.center_sigma1 > 0);
}

void calibration_equations(const PoseRefiner& f, int count, const Pose& pose,
                           const RobustLoss& loss, CalibrationEquations* equations) {
  CalibrationEquations& e = *equations;
  double gradient[kPose], with_entries[kAll][9] = {}, curvature[2][9];
  PoseModel{pose}.normal_equations(f.matches.pairs, f.indices, count, loss, e.of_pose, gradient);
  const Camera cameras[2] = {moved_camera(f.problem, 0, f.principal_point.shift_px),
                             moved_camera(f.problem, 1, f.principal_point.shift_px)};
  const Mat3 E = essential_from_pose(pose);
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  e.focal_sq = e.focal_gradient = 0;
  for (int m = 0; m < count; ++m) {
    const int i = f.indices[m];
    const bool bends = ray_curvature(f.problem, f.matches, cameras[0], 0, i, curvature[0]) &&
                       ray_curvature(f.problem, f.matches, cameras[1], 1, i, curvature[1]);
    const double sigmas[2] = {f.matches.sigma(0, i), f.matches.sigma(1, i)};
    SampsonSlopes s;
    SampsonViewSlopes views;
    if (!sampson_slopes(f.matches.pairs, i, E, bends ? curvature : nullptr, sigmas, &s, &views)) {
      continue;
    }
    const double weight = 1 / (1 + s.residual * s.residual * inverse_sq);
    double both = 0;
    for (int v = 0; v < 2; ++v) {
      const tv_camera& camera = cameras[v].model;
      const double* const pixel = f.problem.pixels[v] + 2 * f.matches.order[i];
      const double* const by = views.by_view[v];
      const double slopes[kOfView] = {
          (by[0] * (pixel[0] - camera.cx) + by[1] * (pixel[1] - camera.cy)) + views.by_scale[v],
          by[0] * camera.fx, by[1] * camera.fy};
      both += slopes[0];
      for (int k = 0; k < kOfView; ++k) {
        const double weighted = weight * slopes[k];
        double* const sums = with_entries[kOfView * v + k];
        for (int c = 0; c < 9; ++c) sums[c] += weighted * s.by_entry[c];
      }
    }
    e.focal_sq += weight * both * both;
    e.focal_gradient += weight * both * s.residual;
  }
  Mat3 columns[kPose];
  pose_columns(pose, columns);
  for (int q = 0; q < kAll; ++q) {
    for (int p = 0; p < kPose; ++p) {
      double sum = 0;
      for (int c = 0; c < 9; ++c) sum += with_entries[q][c] * columns[p](c / 3, c % 3);
      e.with_pose[q][p] = sum;
    }
  }
}

bool pose_slopes(const TwoViewProblem& problem, const CalibrationEquations& e,
                 CalibrationSlopes* slopes, double* focal_information) {
  double inverse[kPose * kPose];
  if (!invert_symmetric(kPose, e.of_pose, inverse)) return false;
  *focal_information = e.focal_sq;
  for (int q = 0; q < kAll; ++q) {
    double with[kPose];
    for (int p = 0; p < kPose; ++p) {
      with[p] = e.with_pose[q][p];
      if (problem.one_camera) with[p] += q < kOfView ? e.with_pose[q + kOfView][p] : -with[p];
    }
    for (int r = 0; r < kPose; ++r) {
      double sum = 0;
      for (int c = 0; c < kPose; ++c) sum -= inverse[kPose * r + c] * with[c];
      slopes->by[q][r] = sum;
      if (q == 0) *focal_information += sum * with[r];
    }
  }
  return true;
}

void plane_slopes(const TwoViewProblem& problem, const Mat3& H, const Vec3& mean_ray0,
                  const Pose& pose, CalibrationSlopes* slopes) {
  constexpr double kStep = 1e-5;
  Vec3 b[2];
  tangent_basis(pose.t, &b[0], &b[1]);
  for (int q = 0; q < kAll; ++q) {
    double* const by = slopes->by[q];
    for (int p = 0; p < kPose; ++p) by[p] = 0;
    if (problem.one_camera && q >= kOfView) continue;
    for (const int sign : {-1, 1}) {
      // K'^-1 K and its inverse, to first order.
      Mat3 to = Mat3::Identity(), back = Mat3::Identity();
      for (int k = 0; k < 2; ++k) {
        const int k1 = q % kOfView == 0 ? k : 2;
        if (q % kOfView != 0 && k != q % kOfView - 1) continue;
        to(k, k1) -= sign * kStep;
        back(k, k1) += sign * kStep;
      }
      Mat3 moved = H;
      if (problem.one_camera || q >= kOfView) moved = to * moved;
      if (problem.one_camera || q < kOfView) moved = moved * back;
      PlanarPose found[2];
      const int num = decompose_homography(moved, mean_ray0, found);
      const Pose* nearest = nullptr;
      double least = 0;
      for (int k = 0; k < num; ++k) {
        const double far =
            (found[k].pose.R - pose.R).squaredNorm() + (found[k].pose.t - pose.t).squaredNorm();
        if (nearest != nullptr && far >= least) continue;
        least = far;
        nearest = &found[k].pose;
      }
      if (nearest == nullptr) continue;
      const Mat3 turn = nearest->R * pose.R.transpose();
      const double scale = sign / (2 * kStep);
      for (int p = 0; p < 3; ++p) {
        by[p] += scale * 0.5 * (turn((p + 2) % 3, (p + 1) % 3) - turn((p + 1) % 3, (p + 2) % 3));
      }
      for (int p = 0; p < 2; ++p) by[3 + p] += scale * b[p].dot(nearest->t);
    }
  }
}

void add_calibration(const TwoViewProblem& problem, const CalibrationSlopes& slopes,
                     double focal_variance, bool only_focal, double covariance[25]) {
  for (int q = 0; q < (problem.one_camera ? kOfView : kAll); ++q) {
    if (only_focal && q != 0) continue;
    const double sigma = sigma_of(problem, q / kOfView, q % kOfView);
    const double variance = q == 0 && focal_variance >= 0 ? focal_variance : sigma * sigma;
    for (int r = 0; r < kPose; ++r) {
      for (int c = 0; c < kPose; ++c) {
        covariance[kPose * r + c] += variance * (slopes.by[q][r] * slopes.by[q][c]);
      }
    }
  }
}

}  // namespace tv
