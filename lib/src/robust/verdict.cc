#include "robust/verdict.h"

#include <algorithm>

#include "base/math.h"
#include "robust/belief.h"

namespace tv {
namespace {

// Fewer different inliers than this support no pose: five of them fit any pose exactly, and the
// others are too few to contradict a wrong one. COLMAP requires as many.
constexpr int kFewMatches = 15;
// The largest standard deviation of a pose that is "ok".
constexpr double kMostSigma = 1.25 * kPi / 180;
// The probability of a wrong pose, at the least, where descriptors are evidence against it.
constexpr double kWrongByDescriptors = 0.5;

bool is_refused(const Evidence& e) {
  return e.kind == TV_KIND_DEGENERATE || e.kind == TV_KIND_PANORAMIC || e.kind == TV_KIND_NO_MOTION;
}

// TOO_FEW_MATCHES: fewer than 15 different matches are inliers. Where no model was found, which
// leaves no inliers, fewer than 15 different matches were given.
bool too_few_matches(const Support& s, bool has_model) {
  return (has_model ? s.num_different_inliers : s.num_different) < kFewMatches;
}

// LOW_INLIER_RATIO, where there is no full pose of a pair, whose probability says it better: fewer
// than 25 % of the matches are inliers, or the residuals are uniform over the threshold, as random
// matches' are: the noise that is estimated from their median is then 0.74 thresholds, and more
// than 0.7 counts as uniform. Where no model was found, matches that are not too few have this
// reason: no model explains more of them than chance does.
bool low_inlier_ratio(const Support& s, bool has_model) {
  if (!has_model) return !too_few_matches(s, has_model);
  return 4 * s.num_inliers < s.num_matches || s.noise_px > 0.7 * s.threshold_px;
}

// CROWDED_MATCHES of all poses: the inliers lie in at most 4 of the 64 cells of a grid.
bool has_few_cells(double coverage) { return coverage < 4.5 / 64; }

// LOW_PARALLAX, in each of four cases (docs/decisions/0007-verdict-and-covariance.md):
// - The median parallax is below 3 thresholds, or below 10 standard deviations of the noise.
// - The noise gives the rotation or the direction of t a standard deviation above 1.25 degrees, or
//   an unknown one. Up to there an error of 5 degrees, which counts as wrong, is one of at least
//   four standard deviations.
// - The standard deviation of the direction, with the errors that matches share, is above 13.5
//   degrees: then it is off by more than 10 degrees with a probability of 46 per cent where its
//   error lies along one line, and of 58 per cent where it is alike in all directions.
// - The relative standard deviation of the focal length is above 1/8, and with it that of the shape
//   of all that is computed from the pose. A focal length of a data sheet has 0.1, which is enough;
//   one of which nothing was known begins at 0.5, and no pair brings it below 0.15 (final_pose.cc,
//   kFocalFloor).
bool low_parallax(const Evidence& e) {
  constexpr double kMostDirectionSigma = 13.5 * kPi / 180;
  constexpr double kMostFocalSigma = 0.125;
  const double least_px = std::max(3 * e.threshold_px, 10 * e.noise_px);
  return has_full_pose(e) &&
         (e.median_parallax_rad < least_px * e.pixel_angle_rad || !(e.sigma_rad <= kMostSigma) ||
          !(e.direction_sigma_rad <= kMostDirectionSigma) || e.focal_sigma > kMostFocalSigma);
}

// CROWDED_MATCHES: the inliers lie in at most 4 of the 64 cells of a grid on each of the two
// images; or, where there is a full pose, on a line of one of the images, to a root mean square of
// 3 thresholds; or the rotation turns by more than 2.5 degrees, half of what counts as wrong, when
// one region is left out. All three leave part of the pose to be extrapolated. One image in which
// the inliers are spread is enough, since its rays then constrain the pose: after a forward move or
// a change of scale by 2 the other image's lie in a quarter of the area, and the pose is as
// accurate (docs/decisions/0007-verdict-and-covariance.md).
bool crowded_matches(const Evidence& e) {
  const bool few_cells = e.num_inliers > 0 && has_few_cells(coverage_of(e));
  const double nearest = std::min(e.line_distance_px[0], e.line_distance_px[1]);
  constexpr double kMostShift = 2.5 * kPi / 180;
  return few_cells ||
         (has_full_pose(e) && (nearest < 3 * e.threshold_px || e.region_shift_rad > kMostShift));
}

// CAMERA_CONTRADICTED: the matches contradict the cameras as they were given, and with cameras that
// they do not contradict the direction would be another one by what counts as wrong, 10 degrees. A
// smaller difference is in the covariance. So is one of the rotation: a turn while the rows are
// read moves it by a degree or two, and only long lenses show more, because they leave it open
// (docs/decisions/0007-verdict-and-covariance.md). A camera that is only assumed is contradicted by
// any difference: what it lacks, most likely its lens, is none of those that were tried.
bool camera_contradicted(const Evidence& e) {
  const double most_rad = e.is_camera_assumed ? 0 : 10 * kPi / 180;
  return has_full_pose(e) && e.misfit.direction_rad > most_rad;
}

// The points lie as on a lattice: of the neighbours of a point, more have another point opposite
// than chance explains, by 3.3 standard deviations in the mean of both images. Where no second
// model was found, the inliers alone were examined, and more than half of their neighbours must
// have one.
bool on_a_lattice(const Evidence& e) {
  const double sigmas = 0.5 * (e.lattice_sigmas[0] + e.lattice_sigmas[1]);
  const double share = 0.5 * (e.lattice_share[0] + e.lattice_share[1]);
  return sigmas > 3.3 && (e.has_second_model || share > 0.5);
}

// The reasons of evidence that is certain, whatever the probability, as bits of tv_reason.
uint32_t reasons_of(const Evidence& e) {
  uint32_t reasons = 0;
  const bool has_model = e.kind != TV_KIND_DEGENERATE;
  if (too_few_matches(e, has_model)) reasons |= TV_REASON_TOO_FEW_MATCHES;
  if (!has_full_pose(e) && low_inlier_ratio(e, has_model)) reasons |= TV_REASON_LOW_INLIER_RATIO;
  if (e.kind == TV_KIND_DEGENERATE) return reasons;
  if (low_parallax(e)) reasons |= TV_REASON_LOW_PARALLAX;
  if (crowded_matches(e)) reasons |= TV_REASON_CROWDED_MATCHES;
  if (camera_contradicted(e)) reasons |= TV_REASON_CAMERA_CONTRADICTED;
  // Two motions of the plane explain the matches about equally well; both are reported.
  if (e.has_alternative) reasons |= TV_REASON_TWO_PLANAR_SOLUTIONS;
  // These two kinds are reasons by themselves: the translation is not determined, and so there is
  // no full pose.
  if (e.kind == TV_KIND_PANORAMIC) reasons |= TV_REASON_PURE_ROTATION;
  if (e.kind == TV_KIND_NO_MOTION) reasons |= TV_REASON_NO_MOTION;
  // A second model is the same scene, matched one period of a lattice off, or a motion of its own.
  // The matches on a lattice cannot show which of these models is the scene; the reason is
  // therefore given even where no second model was found. Matches that agree on the opposite
  // direction are the rest of a period, too.
  if (on_a_lattice(e) || e.has_opposite_motion) {
    reasons |= TV_REASON_REPEATED_STRUCTURE;
  } else if (e.has_second_model) {
    reasons |= TV_REASON_SECOND_MOTION;
  }
  if (is_refused(e)) return reasons;
  if (e.looks_repeated) reasons |= TV_REASON_REPEATED_STRUCTURE;
  // Pictures of which one is mirrored have no matches where the scene itself would match. Matches
  // exist only at corners that are symmetric, and a pose fits these, too.
  if (e.looks_mirrored) reasons |= TV_REASON_LOW_INLIER_RATIO;
  return reasons;
}

tv_verdict verdict_of(bool refused, uint32_t reasons) {
  return refused ? TV_VERDICT_REFUSED : reasons == 0 ? TV_VERDICT_OK : TV_VERDICT_DOUBTFUL;
}

}  // namespace

double coverage_of(const Evidence& e) { return std::max(e.coverage[0], e.coverage[1]); }

int least_places(const Evidence& e) { return std::min(e.num_places[0], e.num_places[1]); }

// Refused: the kind is degenerate, a pure rotation or no motion, so the caller has no translation
// to use. Ok: there is no reason. Doubtful: there is at least one. A full pose that is too probably
// wrong has the reasons of the evidence that makes it so.
Judgement judge(const Evidence& e) {
  uint32_t reasons = reasons_of(e);
  double probability_wrong = 1;
  if (has_full_pose(e)) {
    const Belief belief = belief_of(e);
    probability_wrong = belief.probability_wrong;
    if (!(probability_wrong <= kMostProbabilityWrong)) reasons |= belief.raised_by;
    if (e.looks_repeated || e.looks_mirrored) {
      probability_wrong = std::max(probability_wrong, kWrongByDescriptors);
    }
  }
  return {verdict_of(is_refused(e), reasons), reasons, probability_wrong};
}

// Refused: no pose has more inliers than chance explains. The rules are those of a pair, but for
// what a pair alone has. CROWDED_MATCHES is also said of points on a line, and of inliers that are
// together less than 3 thresholds wide: on what is so narrow in the image a turn about it is not
// seen.
Judgement judge(const AbsoluteEvidence& e) {
  uint32_t reasons = 0;
  if (!e.has_pose) {
    reasons = too_few_matches(e, false) ? TV_REASON_TOO_FEW_MATCHES
              : e.is_on_line            ? TV_REASON_CROWDED_MATCHES
                                        : TV_REASON_LOW_INLIER_RATIO;
    return {TV_VERDICT_REFUSED, reasons, 1};
  }
  if (e.has_alternative) reasons |= TV_REASON_TWO_PLANAR_SOLUTIONS;
  if (too_few_matches(e, true)) reasons |= TV_REASON_TOO_FEW_MATCHES;
  if (low_inlier_ratio(e, true)) reasons |= TV_REASON_LOW_INLIER_RATIO;
  if (!(e.sigma_rad <= kMostSigma)) reasons |= TV_REASON_LOW_PARALLAX;
  if (has_few_cells(e.coverage) || e.width_px < 3 * e.threshold_px) {
    reasons |= TV_REASON_CROWDED_MATCHES;
  }
  return {verdict_of(false, reasons), reasons, 0};
}

// Guided matching finds matches where the first estimate has their epipolar lines: their agreement
// with it is no evidence for it, and so the judgement and the measures that it is from stay those
// of the first. The second estimate is the more accurate one and replaces the first, unless it is
// of another kind, has fewer inliers, is judged worse, or has a second motion of the plane where
// the first has none (or the reverse): then the matches that were added contradict it.
bool takes_guided_estimate(const tv_two_view& first, const tv_two_view& again) {
  return again.has_R != 0 && again.has_t != 0 && again.kind == first.kind &&
         again.has_alternative == first.has_alternative && again.verdict >= first.verdict &&
         again.num_inliers >= first.num_inliers;
}

}  // namespace tv
