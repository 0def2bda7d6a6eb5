#include "robust/final_pose.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "base/order.h"
#include "geometry/homography_4pt.h"
#include "geometry/parallax.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/calibration.h"
#include "robust/camera_misfit.h"
#include "robust/correlation.h"
#include "robust/estimators.h"
#include "robust/ldlt.h"
#include "robust/m_estimate.h"
#include "robust/refine.h"

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();

// The scale of Cauchy's loss, in standard deviations of the noise as median_noise_px estimates it.
// It follows the noise and not the threshold, because the noise of sub-pixel matches is far below a
// threshold of 1 px. It is used for a fundamental matrix and for the covariance of a pose.
constexpr double kFinalScale = 1.5;

// A wrong match near an epipolar line may lie anywhere along it, and a correct one lies where its
// depth puts it. Matches whose parallax exceeds kFarParallax times the 90 % quantile take no part.
constexpr double kFarParallax = 3;
constexpr int kParallaxSample = 128;  // matches that the quantile is computed from

// A pose is refined at the one of these scales, in standard deviations, at which Huber's estimate
// of the variance, sum psi^2 / (sum psi')^2, is least: with heavy tails that is a small one, with
// normal noise a large one. The covariance is still computed at kFinalScale, since a variance that
// was chosen for being small is biased low. docs/decisions/0002-robust-loop.md has the
// measurements.
constexpr double kScales[] = {1, 1.5, 2, 3};
constexpr double kLargestScale = 2;  // largest scale of the loss, in thresholds

// The matches' information on the focal length is divided by this: a lens, a rolling shutter and
// wrong matches move it by more than the spread of the residuals tells.
constexpr double kFocalShare = 4;
// What is left of a refined focal length's variance at the least, over that of its prior: three
// tenths of the standard deviation.
constexpr double kFocalFloor = 0.09;

// Writes the matches that take part in a pose's final refinement to f.indices; returns how many.
int near_pose(const PoseRefiner& f, const Pose& pose) {
  const int count = near_matches(f.matches.pairs, f.matches.pairs.num, pose,
                                 kFinalNear * f.threshold_px, f.threshold_px, f.indices);
  if (count < 10) return count;
  const int sampled = std::min(count, kParallaxSample);
  double sample[kParallaxSample];
  squared_sines(f.matches.pairs, f.indices, count, pose.R, f.values);
  for (int k = 0; k < sampled; ++k) {
    sample[k] = f.values[static_cast<int64_t>(k) * count / sampled];
  }
  const double limit =
      kFarParallax * kFarParallax * nth_smallest(sample, sampled, sampled * 9 / 10);
  int kept = 0;
  for (int k = 0; k < count; ++k) {
    const int i = f.indices[k];
    if (f.values[k] <= limit) f.indices[kept++] = i;
  }
  return kept;
}

// The loss of least estimated variance over the listed matches.
struct BestLoss {
  RobustLoss loss;
  double taken;    // sqrt(sum psi^2 / sum psi'), in pixels: the standard deviation of a residual
                   // under this loss, with which a prior is weighed against the matches
  double stretch;  // the factor of refine on each step
};

BestLoss best_loss(const PoseRefiner& f, const Mat3& M, int count) {
  const double sigma = median_noise_px(f, M, count);
  sampson_squares(f.matches.pairs, f.indices, count, M, f.values);
  double least = 0;
  BestLoss best{};
  for (const double factor : kScales) {
    const double scale = std::max(kLeastScale * f.threshold_px,
                                  std::min(factor * sigma, kLargestScale * f.threshold_px));
    const double inverse_sq = 1 / (scale * scale);
    double psi_sq = 0, slope = 0, weights = 0;
    for (int k = 0; k < count; ++k) {
      const double q = f.values[k] * inverse_sq, weight = 1 / (1 + q);
      psi_sq += f.values[k] * weight * weight;
      slope += (1 - q) * weight * weight;
      weights += weight;
    }
    if (factor != kScales[0] && !(slope > 0 && psi_sq < least * slope * slope)) continue;
    least = slope > 0 ? psi_sq / (slope * slope) : kInfinity;
    best.loss = RobustLoss{Loss::kCauchy, scale};
    best.taken = slope > 0 ? std::sqrt(psi_sq / slope) : sigma;
    best.stretch = stretch_of(weights, slope);
  }
  return best;
}

Pose refined_with(const PoseRefiner& f, const Pose& start, const GravityPrior& gravity) {
  GravityPoseModel model{start, &gravity};
  for (int round = 0; round < kFinalRounds; ++round) {
    const int count = near_pose(f, model.pose);
    if (count < 5) break;
    const BestLoss best = best_loss(f, essential_from_pose(model.pose), count);
    model.noise_px = best.taken;
    refine(f.matches.pairs, f.indices, count, best.loss, kFinalIterations, &model,
           kFinalGains[round], best.stretch);
  }
  return model.pose;
}

// The matches that an uncertainty is computed from: f.indices[0 .. count), and their loss.
struct Listed {
  int count;
  RobustLoss loss;
};

// The uncertainty of a pose that was refined without gravity, from the matches' own noise.
bool uncertainty_without_gravity(const PoseRefiner& f, const Pose& pose,
                                 PoseUncertainty* uncertainty, Listed* listed) {
  const int count = near_pose(f, pose);
  *listed = Listed{count, final_loss(f, essential_from_pose(pose), count)};
  if (!pose_uncertainty(f.matches.pairs, f.indices, count, pose, listed->loss.scale_px,
                        kFinalNear * f.threshold_px, uncertainty)) {
    return false;
  }
  if (!f.principal_point.is_free) return true;
  return add_shift_variance(f.problem, f.matches, f.indices, count, GravityPoseModel{pose},
                            f.principal_point, uncertainty->variance_px, uncertainty->covariance);
}

// The prior of gravity, with a weight below 1 where it contradicts the pose that the matches alone
// give.
GravityPrior tested_gravity(const PoseRefiner& f, const Pose& start) {
  GravityPrior gravity = f.gravity;
  if (!gravity.known) return gravity;
  const Pose alone = refined_with(f, start, GravityPrior{});
  PoseUncertainty uncertainty;
  Listed listed;
  if (uncertainty_without_gravity(f, alone, &uncertainty, &listed)) {
    gravity.weight = gravity_weight(gravity, alone.R, uncertainty.covariance);
  }
  return gravity;
}

// ---- a pose and a plane ----

// Writes the matches that the plane explains to f.indices; returns how many.
int near_plane(const PoseRefiner& f, const Mat3& H) {
  const double limit = kFinalNear * kTransferThresholdScale * f.threshold_px;
  int near = 0;
  transfer_squares(f.matches.pairs, 0, f.matches.pairs.num, H, f.values);
  for (int i = 0; i < f.matches.pairs.num; ++i) {
    if (f.values[i] <= limit * limit) f.indices[near++] = i;
  }
  return near;
}

// The loss for two-dimensional residuals, half of which lie within 1.1774 deviations.
RobustLoss plane_loss(const PoseRefiner& f, const Mat3& H, int count) {
  transfer_squares(f.matches.pairs, f.indices, count, H, f.values);
  const double scale = kPlaneScale * std::sqrt(median(f.values, count)) / 1.1774100225154747;
  return RobustLoss{Loss::kCauchy,
                    std::max(kLeastScale * f.threshold_px, std::min(scale, 2 * f.threshold_px))};
}

// If gravity contradicts one of two motions and not the other, only the other is left. Returns how
// many are.
int exclude_by_gravity(const double from_gravity[2], PlaneFit* fit) {
  for (int k = 0; k < 2; ++k) {
    if (from_gravity[k] > kEvidence && from_gravity[1 - k] < kEvidence) {
      fit->pose[0] = fit->pose[1 - k];
      fit->certain[0] = fit->certain[1 - k];
      fit->uncertainty[0] = fit->uncertainty[1 - k];
      return 1;
    }
  }
  return 2;
}

}  // namespace

double median_noise_px(const PoseRefiner& f, const Mat3& M, int count) {
  int within = 0;
  sampson_squares(f.matches.pairs, f.indices, count, M, f.values);
  for (int k = 0; k < count; ++k) {
    const double r_sq = f.values[k];
    if (r_sq <= f.threshold_px * f.threshold_px) f.values[within++] = r_sq;
  }
  if (within == 0) return f.threshold_px;
  return 1.4826 * std::sqrt(median(f.values, within));
}

RobustLoss final_loss(const PoseRefiner& f, const Mat3& M, int count) {
  const double scale = kFinalScale * median_noise_px(f, M, count);
  return RobustLoss{Loss::kCauchy,
                    std::max(kLeastScale * f.threshold_px, std::min(scale, f.threshold_px))};
}

Pose refined_pose(const PoseRefiner& f, const Pose& start) {
  return refined_with(f, start, tested_gravity(f, start));
}

namespace {

// The equations of pose and principal point together over the matches near the pose.
struct JointEquations {
  ShiftedEquations sums;
  double noise_px;  // the standard deviation of a residual under the loss
  double stretch;   // the factor of refine on each step
};

// Returns how many matches take part in the equations, 0 when there are too few.
int joint_equations(const PoseRefiner& f, const Pose& pose, const GravityPrior& gravity,
                    JointEquations* e) {
  const int count = near_pose(f, pose);
  if (count <= kShiftedParameters) return 0;
  const BestLoss best = best_loss(f, essential_from_pose(pose), count);
  // The residuals of exact input are rounding errors and no evidence, so the noise counts as at
  // least 0.02 thresholds.
  e->noise_px = std::max(best.taken, kLeastScale * f.threshold_px);
  e->stretch = best.stretch;
  shifted_equations(f.problem, f.matches, f.indices, count, GravityPoseModel{pose, &gravity},
                    f.principal_point, best.loss, e->noise_px, &e->sums);
  return count;
}

}  // namespace

bool principal_point_is_off(const PoseRefiner& f, const Pose& pose, const double sigma_px[2],
                            PrincipalPointTest* test) {
  JointEquations e;
  double s[3], g[2], step[2], determinant;  // s, g: information and gradient of the shift
  const int left = joint_equations(f, pose, GravityPrior{}, &e) - kShiftedParameters;
  if (left <= 0 || !eliminate_pose(e.sums, s, g)) return false;
  const double noise_sq = e.noise_px * e.noise_px;
  // Takes the step and returns the evidence for it: twice the logarithm of the factor by which it
  // makes the matches likelier, to first order. This is chi-square with two degrees of freedom
  // where the principal point is correct (C. R. Rao's score test, 1948), or less because of a
  // prior. With the noise estimated from the matches themselves its half follows F(2, left), whose
  // tail is (1 + evidence / left)^(-left / 2).
  const auto tested_step = [&] {
    determinant = s[0] * s[2] - s[1] * s[1];
    step[0] = (s[1] * g[1] - s[2] * g[0]) / determinant;
    step[1] = (s[1] * g[0] - s[0] * g[1]) / determinant;
    const double evidence = -(g[0] * step[0] + g[1] * step[1]) * e.stretch / noise_sq;
    return left * log(1 + evidence / left);
  };
  test->chi2 = tested_step();
  const double variance = noise_sq * e.stretch / determinant;
  const double covariance[3] = {variance * s[2], -variance * s[1], variance * s[0]};
  std::copy(covariance, covariance + 3, test->covariance);
  for (int k = 0; k < 2; ++k) test->asked_px[k] = e.stretch * step[k];
  if (!(sigma_px[0] > 0)) return false;
  for (int k = 0; k < 2; ++k) s[2 * k] += noise_sq / (sigma_px[k] * sigma_px[k]);
  return tested_step() > kEvidence;  // of one in a thousand pairs with a correct one
}

bool move_together(const PoseRefiner& f, Pose* pose, double shift_px[2]) {
  JointEquations e;
  double step[kShiftedParameters];
  if (joint_equations(f, *pose, tested_gravity(f, *pose), &e) == 0 ||
      !solve_damped(kShiftedParameters, e.sums.upper, e.sums.gradient, 0, step)) {
    return false;
  }
  *pose = PoseModel{*pose}.stepped(step).pose;
  for (int k = 0; k < 2; ++k) shift_px[k] = step[PoseModel::kParameters + k];
  return true;
}

bool step_focal_length(const PoseRefiner& f, double* growth, Pose* pose, double* step) {
  constexpr int kNum = PoseModel::kParameters + 1;
  constexpr double kStays = 0.64;  // the share of the prior's variance that is left
  const double sigma = calibration_of(f.problem, 0).focal_sigma;
  const double log_scale = f.problem.focal_log_scale;
  const GravityPrior gravity = tested_gravity(f, *pose);
  if (*growth == 0) {
    PoseUncertainty uncertainty;
    Listed listed;
    if (!uncertainty_without_gravity(f, *pose, &uncertainty, &listed)) return false;
    *growth = add_correlation(f, listed.count, PoseModel{*pose}, listed.loss, uncertainty,
                              uncertainty.covariance);
  }
  const int count = near_pose(f, *pose);
  if (count <= kNum) return false;
  const BestLoss best = best_loss(f, essential_from_pose(*pose), count);
  const double noise_px = std::max(best.taken, kLeastScale * f.threshold_px);
  CalibrationEquations e;
  CalibrationSlopes slopes;
  double gradient[kNum], of_pose[15], upper[kNum * (kNum + 1) / 2], steps[kNum], information;
  calibration_equations(f, count, *pose, best.loss, &e);
  if (!pose_slopes(f.problem, e, &slopes, &information)) return false;
  GravityPoseModel{*pose, &gravity, noise_px}.normal_equations(f.matches.pairs, f.indices, count,
                                                               best.loss, of_pose, gradient);
  const double prior = kFocalShare * *growth * noise_px * noise_px / (sigma * sigma);
  if (log_scale == 0 && !(prior < kStays * (prior + information))) return false;
  for (int r = 0, slot = 0, from = 0; r < PoseModel::kParameters; ++r) {
    for (int c = r; c < PoseModel::kParameters; ++c) upper[slot++] = of_pose[from++];
    upper[slot++] = e.with_pose[0][r] + e.with_pose[kOfView][r];
  }
  upper[kNum * (kNum + 1) / 2 - 1] = e.focal_sq + prior;
  gradient[kNum - 1] = e.focal_gradient + prior * log_scale;
  if (!solve_damped(kNum, upper, gradient, 0, steps)) return false;
  *pose = PoseModel{*pose}.stepped(steps).pose;
  *step = steps[kNum - 1];
  return true;
}

bool uncertainty_of(const PoseRefiner& f, const Pose& pose, PoseUncertainty* uncertainty) {
  const GravityPrior gravity = tested_gravity(f, pose);
  Listed listed;
  double *const noise = uncertainty->covariance, shared[25], all[25];
  if (f.problem.focal_is_ambiguous) return false;
  if (!uncertainty_without_gravity(f, pose, uncertainty, &listed)) return false;
  std::copy(noise, noise + 25, shared);
  const double growth =
      add_correlation(f, listed.count, PoseModel{pose}, listed.loss, *uncertainty, shared);
  std::copy(shared, shared + 25, all);
  const double sigma = calibration_of(f.problem, 0).focal_sigma;
  uncertainty->focal_sigma = sigma;
  CalibrationEquations e;
  CalibrationSlopes slopes;
  double information;
  if (has_calibration_sigmas(f.problem)) {
    calibration_equations(f, listed.count, pose, listed.loss, &e);
    if (!pose_slopes(f.problem, e, &slopes, &information)) return false;
    double variance = -1;
    if (f.focal_is_free) {
      const double of_matches = information / (kFocalShare * growth * uncertainty->mean_weight *
                                               uncertainty->variance_px);
      variance = std::min(1 / (of_matches + 1 / (sigma * sigma)) + kFocalFloor * (sigma * sigma),
                          sigma * sigma);
      for (double* c : {noise, shared}) add_calibration(f.problem, slopes, variance, true, c);
      uncertainty->focal_sigma = std::sqrt(variance);
    }
    // What a refined principal point adds is in the covariance already.
    add_calibration(f.problem, slopes, variance, f.principal_point.is_free, all);
  }
  add_camera_misfit(f, listed.count, pose, listed.loss, &uncertainty->misfit, all);
  if (gravity.known) {
    for (double* c : {noise, shared, all}) add_gravity_information(gravity, pose.R, c);
  }
  // Focal lengths that are not refined count in the verdict where they are uncertain.
  const bool counts = !refines_focal_length(f.problem) &&
                      std::max(sigma, calibration_of(f.problem, 1).focal_sigma) > kUncertainFocal;
  uncertainty->sigma_rad = std::max(largest_sigma(noise), counts ? rotation_sigma(all) : 0);
  uncertainty->direction_sigma_rad = direction_sigma(pose.t, counts ? all : shared);
  std::copy(all, all + 25, noise);
  return all_finite(noise, 25);
}

int refine_on_plane(const PoseRefiner& f, const Mat3& H, const Vec3& mean_ray0, PlaneFit* fit) {
  PlanarPose planar[2];
  if (decompose_homography(H, mean_ray0, planar) == 0) return 0;
  PlaneModel model{planar[0].pose, planar[0].baseline_over_depth * planar[0].normal};
  RobustLoss loss{};
  int count = 0;
  for (int round = 0; round < kFinalRounds; ++round) {
    count = near_plane(f, model.matrix());
    if (count < 8) return 0;
    loss = plane_loss(f, model.matrix(), count);
    refine(f.matches.pairs, f.indices, count, loss, kFinalIterations, &model);
  }
  const int num = decompose_homography(model.matrix(), mean_ray0, planar);
  count = near_plane(f, model.matrix());
  if (count < 8) return 0;
  double from_gravity[2] = {};
  PlaneModel twins[2];
  for (int k = 0; k < num; ++k) {
    twins[k] = PlaneModel{planar[k].pose, planar[k].baseline_over_depth * planar[k].normal};
    fit->pose[k] = twins[k].pose;
    fit->certain[k] = plane_uncertainty(f.matches.pairs, f.indices, count, twins[k], loss.scale_px,
                                        &fit->uncertainty[k]);
  }
  for (int k = 0; k < num; ++k) {
    if (!fit->certain[k]) continue;
    PoseUncertainty& uncertainty = fit->uncertainty[k];
    uncertainty.misfit = CameraMisfit{};
    double *const noise = uncertainty.covariance, shared[25], all[25];
    std::copy(noise, noise + 25, shared);
    add_correlation(f, count, twins[k], loss, uncertainty, shared);
    std::copy(shared, shared + 25, all);
    uncertainty.focal_sigma = calibration_of(f.problem, 0).focal_sigma;
    if (has_calibration_sigmas(f.problem)) {
      CalibrationSlopes slopes;
      plane_slopes(f.problem, twins[k].matrix(), mean_ray0, twins[k].pose, &slopes);
      add_calibration(f.problem, slopes, -1, false, all);
    }
    if (f.gravity.known) {
      GravityPrior gravity = f.gravity;
      from_gravity[k] = gravity_distance_sq(gravity, twins[k].pose.R, noise);
      gravity.weight = gravity_weight(gravity, twins[k].pose.R, noise);
      Pose with_shared = fit->pose[k], with_all = fit->pose[k];
      add_gravity(gravity, &fit->pose[k], noise);
      add_gravity(gravity, &with_shared, shared);
      add_gravity(gravity, &with_all, all);
    }
    uncertainty.sigma_rad = largest_sigma(noise);
    uncertainty.direction_sigma_rad = direction_sigma(fit->pose[k].t, shared);
    std::copy(all, all + 25, noise);
    fit->certain[k] = all_finite(noise, 25);
  }
  return num == 2 ? exclude_by_gravity(from_gravity, fit) : num;
}

}  // namespace tv
