#include "robust/kind.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/chance.h"

namespace tv {
namespace {

// Whether the matches that a rival H does not explain agree on an epipole more often than chance
// explains. If the vector d by which H misses a match had a random direction, the match would lie
// in the epipolar band with probability (2/pi) asin(w / |d|), w the band's half width. By Hoeffding
// (1963), of n such matches k or more do with probability at most exp(-n KL(k/n || mean)).
// inlier[i]: whether match i is an inlier of the epipolar model. True: there is a translation, or
// depth off the plane.
bool leaves_parallax(const Matches& matches, const Mat3& H, const uint8_t* inlier,
                     double threshold_px) {
  const double limit = kTransferThresholdScale * threshold_px;
  const double half_width = 1.4142135623730951 * threshold_px;
  int unexplained = 0, agreeing = 0;
  double expected = 0;
  for (int i = 0; i < matches.num_unique(); ++i) {
    const TransferResidual residual = transfer_residual(matches.pairs, i, H);
    if (residual.r_sq <= limit * limit) continue;
    ++unexplained;
    agreeing += inlier[i] != 0;
    const double sigma1 = matches.sigma(1, i);  // which d is in units of
    const double ratio =
        half_width * half_width * matches.sigma_sq(i) / (sigma1 * sigma1 * residual.d_sq);
    expected += ratio < 1 ? (2 / kPi) * asin(std::sqrt(ratio)) : 1.0;
  }
  if (unexplained < 3 || agreeing < 3) return false;
  const double n = unexplained, share = agreeing / n, chance = expected / n;
  if (share <= chance) return false;
  const double divergence =
      share * log(share / chance) +
      (agreeing < unexplained ? (1 - share) * log((1 - share) / (1 - chance)) : 0.0);
  // The epipole was not given, but chosen as the best intersection of two of these matches: hence
  // the number of pairs.
  return log_binomial(unexplained, 2) - n * divergence < kLogMeaningful;
}

// Whether the support moves along the epipolar lines by more than noise. The residual of a rotation
// has two dimensions, the epipolar residual has one: under a rotation alone the sum S of the
// differences of their squares is about as large as the sum of the squared epipolar residuals (1.3
// times, since the search turns the epipole to where the residuals happen to be smallest; in one of
// 300 pairs more than the limit), and a parallax of p deviations of the noise adds p^2 / 2 times as
// much. leaves_parallax tests the matches that the rotation does not explain; this function tests
// those that it explains.
bool moves_along_lines(const Fit& f, const Mat3& R) {
  if (!f.out->epipolar.has_pose) return false;
  const double limit = kTransferThresholdScale * f.threshold;
  double across = 0, along = 0;
  int n = 0;
  transfer_squares(f.matches.pairs, f.support, f.num_support, R, f.values);
  for (int k = 0; k < f.num_support; ++k) {
    const double r_sq = f.values[k];
    if (r_sq > limit * limit) continue;
    const double epipolar_sq = sampson_sq(f.matches.pairs, f.support[k], f.out->epipolar.M);
    across += epipolar_sq;
    along += r_sq - epipolar_sq;
    ++n;
  }
  // Equal pictures leave residuals of rounding alone, about 1e-13 px, which prove no motion.
  constexpr double kRounding = 1e-6;  // thresholds, root mean square
  const double rounding = kRounding * f.threshold * (kRounding * f.threshold);
  return n > 0 && along > (1.8 + 40.0 / n) * across + n * rounding;
}

}  // namespace

// Chooses the kind of the first of these that holds: no motion, pure rotation, degenerate, a
// homography, an epipolar model.
tv_kind choose_kind(Fit& f, const Rivals& rivals, int sample_size) {
  const EpipolarModel& epipolar = f.out->epipolar;
  const bool calibrated = f.problem.calibrated;
  const int n = f.matches.pairs.num;
  // A model is possible only if its own number of inliers is more than chance explains.
  const double disc =
      std::min(1.0, kPi * kTransferThresholdScale * kTransferThresholdScale * 2 * f.threshold *
                        f.threshold / f.matches.area_px * sigma_means(f.matches).s_sq);
  const bool rotation_meaningful =
      rivals.has_rotation &&
      log_false_alarms(n, rivals.rotation_inliers, 2, 1, disc) < kLogMeaningful;
  const bool still_meaningful =
      log_false_alarms(n, rivals.identity_inliers, 1, 1, disc) < kLogMeaningful;
  const bool homography_meaningful =
      rivals.has_homography &&
      log_false_alarms(n, rivals.homography_inliers, 4, 1, disc) < kLogMeaningful;
  bool epipolar_meaningful = false;
  if (epipolar.found && f.num_support > sample_size) {
    const int models = (sample_size == 5 ? 10 : 3) * f.problem.options.num_trials;
    const double limit = meaningful_chance(n, f.num_support, sample_size, models);
    epipolar_meaningful = chance_of_agreement(f.matches, epipolar.M, f.threshold,
                                              f.problem.options.seed, limit) < limit;
  }
  // A rival determines the kind when it explains most of the epipolar model's inliers (or half of
  // all matches where there is no such model, since a failed search is no proof of a rotation) and
  // the matches that it does not explain do not agree on an epipole. Under a rotation, the matches
  // that it explains must not move along the epipolar lines either.
  const double most = epipolar.found ? kRivalShare * f.num_support : kRivalShareAlone * n;
  const bool rotation_enough = rotation_meaningful && rivals.rotation_inliers > most &&
                               !leaves_parallax(f.matches, rivals.R, f.out->inlier, f.threshold) &&
                               !moves_along_lines(f, rivals.R);
  const bool homography_enough = homography_meaningful && rivals.homography_inliers > most &&
                                 !leaves_parallax(f.matches, rivals.H, f.out->inlier, f.threshold);
  const int rival_inliers = calibrated ? rivals.rotation_inliers : rivals.homography_inliers;
  const bool still = still_meaningful && 20 * rivals.identity_inliers >= 19 * rival_inliers &&
                     (calibrated ? rotation_enough : homography_enough);
  if (still) return TV_KIND_NO_MOTION;
  if (rotation_enough) return TV_KIND_PANORAMIC;
  if (!epipolar_meaningful && !homography_enough) return TV_KIND_DEGENERATE;
  if (!calibrated) {
    return homography_enough ? TV_KIND_PLANAR_OR_PANORAMIC : TV_KIND_UNCALIBRATED;
  }
  if (!epipolar.has_pose) return TV_KIND_DEGENERATE;
  return homography_enough ? TV_KIND_PLANAR : TV_KIND_CALIBRATED;
}

}  // namespace tv
