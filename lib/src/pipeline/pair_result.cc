#include "pipeline/pair_result.h"

#include <algorithm>
#include <cstring>

#include "base/math.h"
#include "geometry/essential.h"
#include "robust/calibration.h"
#include "robust/covariance.h"

namespace tv {
namespace {

// The inverse pose, R' and -R' t. The written order of operations gives the bits that are promised
// for exchanged views.
Pose inverse_pose(const Pose& pose) {
  Pose inverse;
  inverse.R = pose.R.transpose();
  for (int i = 0; i < 3; ++i) {
    inverse.t[i] =
        -((pose.R(0, i) * pose.t[0] + pose.R(1, i) * pose.t[1]) + pose.R(2, i) * pose.t[2]);
  }
  return inverse;
}

// H of the other direction: the adjugate, which is the inverse up to scale.
Mat3 adjugate(const Mat3& H) {
  Mat3 result;
  const Vec3 c0 = H.col(0), c1 = H.col(1), c2 = H.col(2);
  result.row(0) = c1.cross(c2).transpose();
  result.row(1) = c2.cross(c0).transpose();
  result.row(2) = c0.cross(c1).transpose();
  return result;
}

// Scales H to H[8] = 1, or to Frobenius norm 1 where |H[8]| is at most 1e-12 of the norm. False
// when H is zero or not finite.
bool scale_homography(Mat3* H) {
  const double norm = H->norm();
  if (!(norm > 0) || !is_finite(norm)) return false;
  *H /= norm;
  if ((*H)(2, 2) > 1e-12 || (*H)(2, 2) < -1e-12) *H /= Mat3(*H)(2, 2);
  return true;
}

void write_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                      bool swapped, double written[25]) {
  if (swapped) {
    invert_covariance(pose, inverse, covariance, written);
  } else {
    std::memcpy(written, covariance, 25 * sizeof covariance[0]);
  }
}

// The pose, its covariance, E, and the second motion of a plane, in the caller's order.
void write_pose(const PairEstimate& estimate, tv_two_view* result) {
  const TwoViewOutcome& outcome = estimate.outcome;
  const bool swapped = estimate.swapped;
  const Pose& pose = outcome.epipolar.pose;
  const Pose inverse = inverse_pose(pose);
  for (int k = 0; k < 3; ++k) result->t[k] = swapped ? inverse.t[k] : pose.t[k];
  const Mat3 E = essential_from_pose(pose).normalized();
  result->has_E = 1;
  write_matrix(swapped ? Mat3(E.transpose()) : E, result->E);
  result->has_covariance = outcome.has_covariance;
  if (outcome.has_covariance) {
    write_covariance(pose, inverse, outcome.covariance, swapped, result->covariance);
  }
  if (!outcome.evidence->has_alternative) return;
  const Pose other = swapped ? inverse_pose(outcome.alternative) : outcome.alternative;
  result->has_alternative = 1;
  write_matrix(other.R, result->alternative_R);
  for (int k = 0; k < 3; ++k) result->alternative_t[k] = other.t[k];
  result->has_alternative_covariance = outcome.has_alternative_covariance;
  if (outcome.has_alternative_covariance) {
    write_covariance(outcome.alternative, other, outcome.alternative_covariance, swapped,
                     result->alternative_covariance);
  }
}

// F and H, of pixels.
void write_matrices(const PairEstimate& estimate, tv_two_view* result) {
  const TwoViewOutcome& outcome = estimate.outcome;
  const Matches& matches = estimate.matches;
  const Mat3 inverse0 = inverse_intrinsics(matches.intrinsics[0]);
  if (outcome.has_t || outcome.evidence->kind == TV_KIND_UNCALIBRATED) {
    const Mat3 inverse1 = inverse_intrinsics(matches.intrinsics[1]);
    const Mat3 F = (inverse1.transpose() * outcome.epipolar.M * inverse0).normalized();
    result->has_F = 1;
    write_matrix(estimate.swapped ? Mat3(F.transpose()) : F, result->F);
  }
  if (outcome.has_H) {
    const Mat3 forward = matches.intrinsics[1] * outcome.H * inverse0;
    Mat3 H = estimate.swapped ? adjugate(forward) : forward;
    result->has_H = scale_homography(&H);
    if (result->has_H) write_matrix(H, result->H);
  }
}

}  // namespace

void write_estimate(const PairEstimate& estimate, tv_two_view* result) {
  const TwoViewProblem& problem = estimate.problem;
  const TwoViewOutcome& outcome = estimate.outcome;
  const Evidence& evidence = *outcome.evidence;
  tv_two_view& r = *result;
  r = tv_two_view{};
  r.struct_size = sizeof r;
  r.num_still = estimate.num_still;
  r.kind = evidence.kind;
  r.num_matches = problem.num;
  r.num_inliers = evidence.num_inliers;
  r.num_iterations = estimate.model.num_iterations;
  r.seed = problem.options.seed;
  r.median_parallax_rad = evidence.median_parallax_rad;
  r.rms_error_px = outcome.rms_error_px;
  r.noise_px = evidence.noise_px;
  for (int k = 0; k < 2; ++k) {
    r.principal_point_shift[k] = outcome.principal_point_shift_px[k];
  }
  r.focal_scale = outcome.focal_scale;
  r.focal_sigma = outcome.focal_sigma;
  if (outcome.has_covariance && !problem.one_camera) {
    r.focal_sigma = calibration_of(problem, estimate.swapped ? 1 : 0).focal_sigma;
  }
  const Mat3& R = outcome.epipolar.pose.R;
  r.has_R = outcome.has_R;
  r.has_t = outcome.has_t;
  if (outcome.has_R) write_matrix(estimate.swapped ? Mat3(R.transpose()) : R, r.R);
  if (outcome.has_t) write_pose(estimate, result);
  write_matrices(estimate, result);
}

void write_judgement(const Judgement& judgement, tv_two_view* result) {
  result->verdict = judgement.verdict;
  result->reasons = judgement.reasons;
  result->probability_wrong = judgement.probability_wrong;
}

void write_evidence(const Evidence& evidence, tv_evidence* written) {
  tv_evidence& w = *written;
  w = tv_evidence{};
  w.struct_size = sizeof w;
  w.num_places = least_places(evidence);
  w.essential_inliers = evidence.essential_inliers;
  w.fundamental_inliers = evidence.fundamental_inliers;
  w.homography_inliers = evidence.homography_inliers;
  w.rotation_inliers = evidence.rotation_inliers;
  w.coverage = coverage_of(evidence);
  w.agreement = evidence.agreement;
  if (evidence.kind == TV_KIND_CALIBRATED) {
    const PrincipalPointTest& test = evidence.principal_point;
    w.principal_point_chi2 = test.chi2;
    std::memcpy(w.principal_point_asked_px, test.asked_px, sizeof test.asked_px);
    std::memcpy(w.principal_point_asked_covariance, test.covariance, sizeof test.covariance);
  }
  if (!has_full_pose(evidence)) return;
  w.region_shift_rad = evidence.region_shift_rad;
  w.camera_chi2 = evidence.misfit.chi2;
  w.camera_turn_rad = evidence.misfit.turn_rad;
  w.camera_direction_rad = evidence.misfit.direction_rad;
}

void keep_judgement(const PairResult& first, PairResult* again) {
  again->view.verdict = first.view.verdict;
  again->view.reasons = first.view.reasons;
  again->view.probability_wrong = first.view.probability_wrong;
  const Evidence own = again->evidence;
  Evidence& kept = again->evidence;
  kept = first.evidence;
  // What is no judgement: how many inliers there are now, and where.
  kept.essential_inliers = own.essential_inliers;
  kept.fundamental_inliers = own.fundamental_inliers;
  kept.homography_inliers = own.homography_inliers;
  kept.rotation_inliers = own.rotation_inliers;
  std::copy(own.coverage, own.coverage + 2, kept.coverage);
}

void write_inliers(const PairEstimate& estimate, uint8_t* inlier_mask) {
  const Matches& matches = estimate.matches;
  std::memset(inlier_mask, 0, static_cast<size_t>(estimate.problem.num));
  for (int k = 0; k < matches.num_all; ++k) {
    inlier_mask[matches.order[k]] = estimate.outcome.inlier[k];
  }
}

tv_camera_pair corrected_pair(const tv_two_view& result, const tv_camera& camera0,
                              const tv_camera& camera1) {
  tv_camera_pair corrected{camera0, camera1, {}, {}};
  for (tv_camera* camera : {&corrected.camera0, &corrected.camera1}) {
    camera->cx += result.principal_point_shift[0];
    camera->cy += result.principal_point_shift[1];
    if (result.focal_scale > 0) {
      camera->fx *= result.focal_scale;
      camera->fy *= result.focal_scale;
    }
  }
  std::copy(result.R, result.R + 9, corrected.cam1_from_cam0_R);
  std::copy(result.t, result.t + 3, corrected.cam1_from_cam0_t);
  return corrected;
}

}  // namespace tv
