#include "robust/camera_misfit.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/sampson.h"
#include "robust/ldlt.h"
#include "robust/m_estimate.h"

namespace tv {
namespace {

// The parameters, in this order: those of the pose; the turns of views 0 and 1 while their rows
// were exposed, in radians; the shift of the principal point, in focal lengths.
constexpr int kPose = PoseModel::kParameters, kTurns = 6, kCamera = kTurns + 2;
constexpr int kAll = kPose + kCamera;

// The standard deviation of the principal point, in focal lengths: that of a doubtful calibration.
constexpr double kCentreSigma = 0.01;
// Matches share errors that are no noise, of their alignment and of the lens: their information
// counts by this factor less, as for the focal length (robust/final_pose.cc), and a residual's
// deviation as at least this part of a threshold.
constexpr double kShare = 4, kLeastNoise = 0.05;
// Chi-square with six and with eight degrees of freedom exceeds this in one pair of a thousand.
constexpr double kTurnsEvidence = 22.457744, kCameraEvidence = 26.124482;

struct Sums {
  double upper[kAll][kAll], gradient[kAll];  // J' W J, of which the upper triangle, and J' W r
  double psi_sq, weight, slope;
};

// The pixels by which a turn of one radian about each axis moves the ray of match i in a view: the
// least squares solution of J d = e_k x f, with the part along the ray left out.
void pixels_by_turn(const PoseRefiner& f, int view, int i, double by[3][2]) {
  const RayPairs& pairs = f.matches.pairs;
  double* const* const ray = pairs.ray[view];
  const double x = ray[0][i], y = ray[1][i], z = ray[2][i];
  const double turned[3][3] = {{0, -z, y}, {z, 0, -x}, {-y, x, 0}};
  const double inverse_sigma = 1 / f.matches.sigma(view, i);
  double J[3][2];
  for (int r = 0; r < 3; ++r) {
    for (int k = 0; k < 2; ++k) J[r][k] = inverse_sigma * pairs.jacobian[view][2 * r + k][i];
  }
  double N[3] = {};
  for (int r = 0; r < 3; ++r) {
    N[0] += J[r][0] * J[r][0];
    N[1] += J[r][0] * J[r][1];
    N[2] += J[r][1] * J[r][1];
  }
  const double determinant = N[0] * N[2] - N[1] * N[1];
  for (int k = 0; k < 3; ++k) {
    // Rays on the plane z = 1 stay on it; on the sphere the turn is across the ray already.
    const double along = pairs.on_plane ? turned[k][2] : 0;
    const double d[3] = {turned[k][0] - along * x, turned[k][1] - along * y,
                         turned[k][2] - along * z};
    const double g0 = (J[0][0] * d[0] + J[1][0] * d[1]) + J[2][0] * d[2];
    const double g1 = (J[0][1] * d[0] + J[1][1] * d[1]) + J[2][1] * d[2];
    by[k][0] = (N[2] * g0 - N[1] * g1) / determinant;
    by[k][1] = (N[0] * g1 - N[1] * g0) / determinant;
  }
}

void sum_equations(const PoseRefiner& f, int count, const Pose& pose, const RobustLoss& loss,
                   Sums* sums) {
  *sums = Sums{};
  const Camera cameras[2] = {moved_camera(f.problem, 0, f.principal_point.shift_px),
                             moved_camera(f.problem, 1, f.principal_point.shift_px)};
  const Mat3 E = essential_from_pose(pose);
  Mat3 columns[kPose];
  pose_columns(pose, columns);
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  double curvature[2][9];
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
    double slopes[kAll];
    for (int p = 0; p < kPose; ++p) {
      slopes[p] = 0;
      for (int c = 0; c < 9; ++c) slopes[p] += s.by_entry[c] * columns[p].data()[c];
    }
    for (int v = 0; v < 2; ++v) {
      const tv_camera& camera = cameras[v].model;
      const double y = f.problem.pixels[v][2 * f.matches.order[i] + 1];
      const double time = (y + 0.5) / camera.height - 0.5;  // of the row, in readouts
      double by[3][2];
      pixels_by_turn(f, v, i, by);
      for (int k = 0; k < 3; ++k) {
        slopes[kPose + 3 * v + k] =
            -time * (views.by_view[v][0] * by[k][0] + views.by_view[v][1] * by[k][1]);
      }
    }
    slopes[kPose + kTurns] = s.by_point[0] * cameras[0].model.fx;
    slopes[kPose + kTurns + 1] = s.by_point[1] * cameras[0].model.fy;
    const double q = s.residual * s.residual * inverse_sq, weight = 1 / (1 + q);
    sums->psi_sq += q * weight * weight;
    sums->weight += weight;
    sums->slope += (1 - q) * weight * weight;
    for (int r = 0; r < kAll; ++r) {
      const double weighted = weight * slopes[r];
      sums->gradient[r] += weighted * s.residual;
      for (int c = r; c < kAll; ++c) sums->upper[r][c] += weighted * slopes[c];
    }
  }
  sums->psi_sq *= loss.scale_px * loss.scale_px;
}

// The pose's step that goes with the step `asked` of the cameras' parameters.
void step_of_pose(const double G[kPose][kCamera], const double* asked, int num, double stretch,
                  double step[kPose]) {
  for (int r = 0; r < kPose; ++r) {
    step[r] = 0;
    for (int q = 0; q < num; ++q) step[r] += stretch * (G[r][q] * asked[q]);
  }
}

// The pose's block of the sums, inverted. False: it is singular.
bool invert_pose(const Sums& sums, double inverse[kPose * kPose]) {
  double of_pose[kPose * (kPose + 1) / 2];
  for (int r = 0, slot = 0; r < kPose; ++r) {
    for (int c = r; c < kPose; ++c) of_pose[slot++] = sums.upper[r][c];
  }
  return invert_symmetric(kPose, of_pose, inverse);
}

}  // namespace

void add_camera_misfit(const PoseRefiner& f, int count, const Pose& pose, const RobustLoss& loss,
                       CameraMisfit* misfit, double covariance[25]) {
  *misfit = CameraMisfit{};
  misfit->given_turn_sigma_rad =
      std::sqrt(std::max(std::max(covariance[0], covariance[6]), covariance[12]));
  const double turn_sigma = f.problem.options.readout_turn_sigma_rad;
  if (!(turn_sigma > 0) || count <= 2 * kAll) return;
  // Another principal point of one of two cameras is nearly a rotation of that view.
  const bool has_centre = f.problem.one_camera && !f.principal_point.is_free;
  const int num = has_centre ? kCamera : kTurns;
  Sums sums;
  sum_equations(f, count, pose, loss, &sums);
  double inverse[kPose * kPose];
  if (!invert_pose(sums, inverse)) return;
  // The pose's slopes G by the cameras' parameters, and what it leaves of information and gradient.
  double G[kPose][kCamera], gradient[kCamera], packed[kCamera * (kCamera + 1) / 2];
  const double least = kLeastNoise * f.threshold_px;
  const double variance = kShare * std::max(sums.psi_sq / sums.weight, least * least);
  for (int q = 0; q < num; ++q) {
    gradient[q] = sums.gradient[kPose + q];
    for (int r = 0; r < kPose; ++r) {
      G[r][q] = 0;
      for (int c = 0; c < kPose; ++c) G[r][q] -= inverse[kPose * r + c] * sums.upper[c][kPose + q];
      gradient[q] += G[r][q] * sums.gradient[r];
    }
  }
  for (int q = 0, slot = 0; q < num; ++q) {
    for (int c = q; c < num; ++c) {
      double left = sums.upper[kPose + q][kPose + c];
      for (int r = 0; r < kPose; ++r) left += sums.upper[r][kPose + q] * G[r][c];
      const double sigma = q < kTurns ? turn_sigma : kCentreSigma;
      packed[slot++] = left + (c == q ? variance / (sigma * sigma) : 0);
    }
  }
  double left_open[kCamera * kCamera];
  if (!invert_symmetric(num, packed, left_open)) return;
  const double stretch = stretch_of(sums.weight, sums.slope);
  double asked[kCamera], evidence = 0;
  for (int q = 0; q < num; ++q) {
    asked[q] = 0;
    for (int c = 0; c < num; ++c) asked[q] -= left_open[num * q + c] * gradient[c];
    evidence -= gradient[q] * asked[q];
  }
  misfit->chi2 = evidence * stretch / variance;
  if (!(misfit->chi2 > (has_centre ? kCameraEvidence : kTurnsEvidence))) return;
  double step[kPose], of_step[25], grown[25];
  step_of_pose(G, asked, num, stretch, step);
  for (int r = 0; r < kPose; ++r) {
    for (int c = 0; c < kPose; ++c) {
      of_step[kPose * r + c] = step[r] * step[c];
      double open = 0;
      for (int q = 0; q < num * num; ++q) open += G[r][q / num] * left_open[q] * G[c][q % num];
      grown[kPose * r + c] = covariance[kPose * r + c] + of_step[kPose * r + c] + variance * open;
    }
  }
  if (!all_finite(grown, 25)) return;
  std::copy(grown, grown + 25, covariance);
  misfit->turn_rad = rotation_sigma(of_step);
  misfit->direction_rad = direction_sigma(pose.t, of_step);
}

}  // namespace tv
