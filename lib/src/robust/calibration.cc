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
  const tv_calibration& given = calibration_of(problem, view);
  return k == 0 ? given.focal_sigma : given.center_sigma;
}

}  // namespace

bool has_calibration_sigmas(const TwoViewProblem& problem) {
  const tv_calibration &a = calibration_of(problem, 0), &b = calibration_of(problem, 1);
  return problem.calibrated &&
         (a.focal_sigma > 0 || b.focal_sigma > 0 || a.center_sigma > 0 || b.center_sigma > 0);
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
      for (int c = 0; c < 9; ++c) sum += with_entries[q][c] * columns[p].data()[c];
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
    const int k = q % kOfView;  // 0: the focal length, 1: x of the principal point, 2: y
    for (const double step : {-kStep, kStep}) {
      Mat3 moved = H;  // K'^-1 K H of view 1 and H K^-1 K' of view 0, to first order
      for (int view = 0; view < 2; ++view) {
        if (!problem.one_camera && view != q / kOfView) continue;
        // View 1's camera changes rows, view 0's columns.
        const int along = view == 1 ? 1 : 3, across = 4 - along;
        for (int d = 0; d < 2; ++d) {
          if (k != 0 && d != k - 1) continue;
          const int third = k == 0 ? d : 2;
          double* const to = moved.data() + across * (view == 1 ? d : third);
          const double* const from = moved.data() + across * (view == 1 ? third : d);
          const double by_step = view == 1 ? -step : step;
          for (int i = 0; i < 3; ++i) to[along * i] += by_step * from[along * i];
        }
      }
      PlanarPose found[2];
      const int num = decompose_homography(moved, mean_ray0, found);
      double nearest = -8, deviation[kPose] = {};
      for (int n = 0; n < num; ++n) {
        const Pose& other = found[n].pose;
        double turn[3][3], along = 0;  // R_other R'; how alike both poses are
        for (int r = 0; r < 3; ++r) {
          along += other.t[r] * pose.t[r];
          for (int c = 0; c < 3; ++c) {
            turn[r][c] = 0;
            for (int j = 0; j < 3; ++j) turn[r][c] += other.R(r, j) * pose.R(c, j);
          }
          along += turn[r][r];
        }
        if (!(along > nearest)) continue;
        nearest = along;
        for (int p = 0; p < 3; ++p) {
          const int next = (p + 1) % 3, last = (p + 2) % 3;
          deviation[p] = 0.5 * (turn[last][next] - turn[next][last]);
        }
        for (int p = 0; p < 2; ++p) deviation[3 + p] = b[p].dot(other.t);
      }
      for (int p = 0; p < kPose; ++p) by[p] += deviation[p] / (2 * step);
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
