// What follows the search, in this order: the model is refined over all of its inliers, rivals are
// fitted, the kind is chosen and with it the pose, the evidence is measured, and the covariance is
// completed with it. robust/verdict.cc judges the evidence afterwards.
#include <algorithm>
#include <cmath>

#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/covariance.h"
#include "robust/evidence.h"
#include "robust/fit.h"
#include "robust/kind.h"
#include "robust/m_estimate.h"
#include "robust/place_focal_length.h"
#include "robust/place_principal_point.h"
#include "robust/planar_pose.h"
#include "robust/refine.h"
#include "robust/two_view.h"

namespace tv {

size_t two_view_scratch_bytes(int max_matches) {
  const size_t n = static_cast<size_t>(max_matches);
  const size_t finish = 2 * arena_bytes<int32_t>(n) + arena_bytes<uint8_t>(n) +
                        arena_bytes<double>(n) +
                        std::max(rivals_bytes(max_matches), evidence_bytes(max_matches));
  return arena_bytes<uint8_t>(n) + matches_bytes(max_matches) +
         std::max(search_bytes(max_matches), finish);
}

namespace {

Mat3 refined_fundamental(const Fit& f, const Mat3& start) {
  FundamentalModel model = fundamental_model(start);
  for (int round = 0; round < kFinalRounds; ++round) {
    const int count = near_matches(f.matches.pairs, f.matches.pairs.num, model.matrix(),
                                   kFinalNear * f.threshold, f.indices);
    if (count < 7) break;
    refine(f.matches.pairs, f.indices, count, final_loss(f.refiner, model.matrix(), count),
           kFinalIterations, &model);
  }
  return model.matrix().normalized();
}

void refine_epipolar(Fit& f) {
  EpipolarModel& epipolar = f.out->epipolar;
  if (epipolar.has_pose) {
    epipolar.pose = refined_pose(f.refiner, epipolar.pose);
    place_focal_length(f);
    place_principal_point(f);
    epipolar.M = essential_from_pose(epipolar.pose);
  } else {
    epipolar.M = refined_fundamental(f, epipolar.M);
  }
  collect_support(f);
}

// The pose, homography, inliers and covariance that a pair of this kind has.
void take_kind(Fit& f, tv_kind kind, const Rivals& rivals) {
  TwoViewOutcome& out = *f.out;
  switch (kind) {
    case TV_KIND_PLANAR:
      choose_planar_pose(f, rivals);
      out.evidence->essential_inliers = f.num_support;
      out.has_R = out.has_t = true;
      break;
    case TV_KIND_CALIBRATED: {
      PoseUncertainty uncertainty;
      if (uncertainty_of(f.refiner, out.epipolar.pose, &uncertainty)) {
        store_uncertainty(uncertainty, &out);
      }
      out.has_R = out.has_t = true;
      break;
    }
    case TV_KIND_PANORAMIC:
      out.epipolar.pose.R = out.H = rivals.R;
      out.has_R = true;
      inliers_of_transfer(f, out.H);
      break;
    case TV_KIND_NO_MOTION:
      if (f.problem.calibrated) {
        out.epipolar.pose.R = out.H = Mat3::Identity();
        out.has_R = true;
      }
      inliers_of_transfer(f, out.H);
      break;
    case TV_KIND_PLANAR_OR_PANORAMIC: inliers_of_transfer(f, out.H); break;
    case TV_KIND_DEGENERATE:
      std::fill(out.inlier, out.inlier + f.matches.num_all, uint8_t{0});
      break;
    case TV_KIND_UNCALIBRATED: break;
  }
}

}  // namespace

void finish_two_view(TwoViewProblem& problem, const TwoViewModel& model, Arena& arena,
                     Matches* all_matches, TwoViewOutcome* outcome) {
  Matches& matches = *all_matches;
  const size_t n = static_cast<size_t>(matches.num_all);
  outcome->inlier = arena_alloc<uint8_t>(arena, n);
  for (size_t i = 0; i < n; ++i) outcome->inlier[i] = 0;
  ArenaScope scope(arena);
  const double threshold = problem.options.max_error_px;
  int32_t* indices = arena_alloc<int32_t>(arena, n);
  double* values = arena_alloc<double>(arena, n);
  int32_t* support = arena_alloc<int32_t>(arena, n);
  Fit f{problem,
        matches,
        threshold,
        indices,
        values,
        support,
        0,
        PoseRefiner{problem, matches, threshold, gravity_of(problem), {}, indices, values, false},
        outcome};
  TwoViewOutcome& out = *outcome;
  out.epipolar = model.epipolar;
  if (out.epipolar.found) {
    refine_epipolar(f);
    Evidence& evidence = *out.evidence;
    (problem.calibrated ? evidence.essential_inliers : evidence.fundamental_inliers) =
        f.num_support;
  }
  if (f.num_support < 5) {  // no epipolar model: a rival may still explain the matches
    f.num_support = f.matches.pairs.num;
    for (int i = 0; i < f.matches.pairs.num; ++i) f.support[i] = i;
    out.epipolar.found = false;
  }
  const double least_share = out.epipolar.found ? kRivalShare : kRivalShareAlone;
  const Rivals rivals = find_rivals(matches, f.support, f.num_support, problem.calibrated,
                                    least_share, f.threshold, problem.options.seed, arena);
  out.evidence->rotation_inliers = rivals.rotation_inliers;
  out.evidence->homography_inliers = rivals.homography_inliers;
  if (!out.epipolar.found) f.num_support = 0;
  const int sample_size = least_matches(problem.options.method);
  const tv_kind kind = choose_kind(f, rivals, sample_size);
  out.evidence->kind = kind;
  out.H = rivals.H;
  out.has_H = kind == TV_KIND_PLANAR || kind == TV_KIND_PLANAR_OR_PANORAMIC;
  take_kind(f, kind, rivals);
  measure_evidence(f, arena);
  const double growth =
      growth_by_disagreement(out.evidence->num_different_inliers, out.evidence->num_different);
  out.evidence->direction_sigma_rad *= std::sqrt(growth);
  for (int k = 0; k < 25; ++k) {
    out.covariance[k] *= growth;
    out.alternative_covariance[k] *= growth;
  }
}

}  // namespace tv
