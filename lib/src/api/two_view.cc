// The entry points of two-view estimation: they validate, call pipeline/two_view.h, and write the
// result in the caller's order, with the judgement of robust/verdict.h.
#include "api/two_view.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "api/sized.h"
#include "api/validate.h"
#include "base/math.h"
#include "geometry/essential.h"
#include "pipeline/two_view.h"
#include "robust/covariance.h"

namespace tv {
namespace {

constexpr uint64_t kDefaultSeed = 20130814;  // any other constant would do as well

// 50 degrees a second in 23 ms, a camera in the hand or on a drone and a usual sensor.
constexpr double kReadoutTurn = 0.02;

constexpr tv_estimate_options kDefaults = {sizeof(tv_estimate_options),
                                           TV_SOLVER_AUTO,
                                           1.0,
                                           0.9999,
                                           10000,
                                           0,
                                           kDefaultSeed,
                                           {0, 0, 0},
                                           {0, 0, 0},
                                           0,
                                           0,
                                           0,
                                           0,
                                           0,
                                           0,
                                           kReadoutTurn,
                                           0,
                                           0};

// Checks the standard deviations of the cameras and of their turns, each in [0, 0.5].
tv_status check_calibration_sigmas(const tv_estimate_options& options) {
  for (const double sigma : {options.focal_sigma0, options.focal_sigma1, options.center_sigma0,
                             options.center_sigma1, options.readout_turn_sigma_rad}) {
    if (!is_finite(sigma)) return TV_ERR_NOT_FINITE;
    if (!(sigma >= 0 && sigma <= 0.5)) return TV_ERR_ARGUMENT;
  }
  return TV_OK;
}

tv_status read_estimate_options(const tv_estimate_options* options, bool calibrated,
                                tv_estimate_options* checked) {
  *checked = kDefaults;
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  if (checked->method == TV_SOLVER_AUTO) {
    checked->method = calibrated ? TV_SOLVER_FIVE_POINT : TV_SOLVER_EIGHT_POINT;
  }
  if (!is_finite(checked->max_error_px) || !is_finite(checked->confidence) ||
      !is_finite(checked->gravity_sigma_rad) || !is_finite(checked->principal_point_sigma)) {
    return TV_ERR_NOT_FINITE;
  }
  const bool in_range = checked->max_error_px > 0 && checked->max_error_px <= 1e9 &&
                        checked->confidence >= 0 && checked->confidence < 1 &&
                        checked->max_iterations >= 1 && checked->max_iterations <= 1000000 &&
                        checked->fixed_iterations >= 0 && checked->fixed_iterations <= 1000000 &&
                        checked->principal_point_sigma >= 0 &&
                        checked->principal_point_sigma <= 0.1 && checked->num_trials >= 0 &&
                        checked->num_trials <= 10000 && checked->reserved == 0;
  const bool with_gravity = checked->gravity_sigma_rad > 0;
  const bool method_known = checked->method == TV_SOLVER_EIGHT_POINT ||
                            checked->method == TV_SOLVER_SEVEN_POINT ||
                            (checked->method == TV_SOLVER_FIVE_POINT && calibrated) ||
                            (checked->method == TV_SOLVER_UPRIGHT && calibrated && with_gravity);
  if (!in_range || !method_known) return TV_ERR_ARGUMENT;
  checked->num_trials = std::max(checked->num_trials, 1);
  const tv_status sigmas = check_calibration_sigmas(*checked);
  return sigmas != TV_OK
             ? sigmas
             : check_gravity(checked->gravity0, checked->gravity1, checked->gravity_sigma_rad);
}

void store(const Mat3& m, double out[9]) {
  for (int k = 0; k < 9; ++k) out[k] = m(k / 3, k % 3);
}

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

void pack_covariance(const Pose& pose, const Pose& inverse, const double covariance[25],
                     bool swapped, double packed[25]) {
  if (swapped) {
    invert_covariance(pose, inverse, covariance, packed);
  } else {
    std::memcpy(packed, covariance, 25 * sizeof covariance[0]);
  }
}

// The pose, its covariance, E, and the second motion of a plane, in the caller's order.
void pack_pose(const PairEstimate& estimate, tv_two_view* packed) {
  const TwoViewOutcome& outcome = estimate.outcome;
  const bool swapped = estimate.swapped;
  const Pose& pose = outcome.epipolar.pose;
  const Pose inverse = inverse_pose(pose);
  for (int k = 0; k < 3; ++k) packed->t[k] = swapped ? inverse.t[k] : pose.t[k];
  const Mat3 E = essential_from_pose(pose).normalized();
  packed->has_E = 1;
  store(swapped ? Mat3(E.transpose()) : E, packed->E);
  packed->has_covariance = outcome.has_covariance;
  if (outcome.has_covariance) {
    pack_covariance(pose, inverse, outcome.covariance, swapped, packed->covariance);
  }
  packed->camera_chi2 = outcome.misfit.chi2;
  packed->camera_turn_rad = outcome.misfit.turn_rad;
  packed->camera_direction_rad = outcome.misfit.direction_rad;
  packed->region_shift_rad = outcome.evidence->region_shift_rad;
  if (!outcome.evidence->has_alternative) return;
  const Pose other = swapped ? inverse_pose(outcome.alternative) : outcome.alternative;
  packed->has_alternative = 1;
  store(other.R, packed->alternative_R);
  for (int k = 0; k < 3; ++k) packed->alternative_t[k] = other.t[k];
  packed->has_alternative_covariance = outcome.has_alternative_covariance;
  if (outcome.has_alternative_covariance) {
    pack_covariance(outcome.alternative, other, outcome.alternative_covariance, swapped,
                    packed->alternative_covariance);
  }
}

// F and H, of pixels.
void pack_matrices(const PairEstimate& estimate, tv_two_view* packed) {
  const TwoViewOutcome& outcome = estimate.outcome;
  const Matches& matches = estimate.matches;
  const Mat3 inverse0 = inverse_intrinsics(matches.intrinsics[0]);
  if (outcome.has_t || outcome.evidence->kind == TV_KIND_UNCALIBRATED) {
    const Mat3 inverse1 = inverse_intrinsics(matches.intrinsics[1]);
    const Mat3 F = (inverse1.transpose() * outcome.epipolar.M * inverse0).normalized();
    packed->has_F = 1;
    store(estimate.swapped ? Mat3(F.transpose()) : F, packed->F);
  }
  if (outcome.has_H) {
    const Mat3 forward = matches.intrinsics[1] * outcome.H * inverse0;
    Mat3 H = estimate.swapped ? adjugate(forward) : forward;
    packed->has_H = scale_homography(&H);
    if (packed->has_H) store(H, packed->H);
  }
}

// Not inlined, so that its stack frame is not in use during the search.
__attribute__((noinline)) void pack(const PairEstimate& estimate, tv_two_view* result) {
  const TwoViewProblem& problem = estimate.problem;
  const TwoViewOutcome& outcome = estimate.outcome;
  const Evidence& evidence = *outcome.evidence;
  tv_two_view packed{};
  packed.num_still = estimate.num_still;
  packed.kind = evidence.kind;
  packed.agreement = evidence.agreement;
  packed.num_places = std::min(evidence.num_places[0], evidence.num_places[1]);
  packed.num_matches = problem.num;
  packed.num_inliers = evidence.num_inliers;
  packed.num_iterations = estimate.model.num_iterations;
  packed.seed = problem.options.seed;
  packed.essential_inliers = outcome.essential_inliers;
  packed.fundamental_inliers = outcome.fundamental_inliers;
  packed.homography_inliers = outcome.homography_inliers;
  packed.rotation_inliers = outcome.rotation_inliers;
  packed.median_parallax_rad = evidence.median_parallax_rad;
  packed.rms_error_px = outcome.rms_error_px;
  packed.noise_px = evidence.noise_px;
  for (int k = 0; k < 2; ++k) {
    packed.principal_point_shift[k] = outcome.principal_point_shift_px[k];
  }
  if (evidence.kind == TV_KIND_CALIBRATED) {
    const PrincipalPointTest& test = outcome.principal_point_test;
    packed.principal_point_chi2 = test.chi2;
    std::memcpy(packed.principal_point_asked_px, test.asked_px, sizeof test.asked_px);
    std::memcpy(packed.principal_point_asked_covariance, test.covariance, sizeof test.covariance);
  }
  packed.coverage = coverage_of(evidence);
  packed.focal_scale = outcome.focal_scale;
  packed.focal_sigma = outcome.focal_sigma;
  if (outcome.has_covariance && !problem.one_camera) {
    packed.focal_sigma =
        estimate.swapped ? problem.options.focal_sigma1 : problem.options.focal_sigma0;
  }
  const Mat3& R = outcome.epipolar.pose.R;
  packed.has_R = outcome.has_R;
  packed.has_t = outcome.has_t;
  if (outcome.has_R) store(estimate.swapped ? Mat3(R.transpose()) : R, packed.R);
  if (outcome.has_t) pack_pose(estimate, &packed);
  pack_matrices(estimate, &packed);
  write_sized(packed, result);
}

// Whether an output shares a byte with another argument. Not inlined, for the same reason.
__attribute__((noinline)) bool arrays_overlap(const tv_pixel_pairs& given,
                                              const tv_pixel_pairs* pairs,
                                              const tv_estimate_options* options,
                                              const tv_camera* camera0, const tv_camera* camera1,
                                              const tv_two_view* result,
                                              const uint8_t* inlier_mask) {
  const size_t n = static_cast<size_t>(given.num);
  const Bytes arrays[] = {{inlier_mask, n},
                          {result, result->struct_size},
                          {given.pixels0, 16 * n},
                          {given.pixels1, 16 * n},
                          {given.ratios, 4 * n},
                          {given.sigmas0, 4 * n},
                          {given.sigmas1, 4 * n},
                          {pairs, pairs->struct_size},
                          {options, options != nullptr ? options->struct_size : 0},
                          {camera0, sizeof(tv_camera)},
                          {camera1, sizeof(tv_camera)}};
  return outputs_overlap(arrays, 2, 11);
}

}  // namespace

tv_status estimate_two_view(tv_context* context, const tv_camera* camera0, const tv_camera* camera1,
                            const tv_pixel_pairs* pairs, const tv_estimate_options* options,
                            tv_two_view* result, uint8_t* inlier_mask, Evidence* evidence) {
  if (context == nullptr || result == nullptr) return TV_ERR_NULL;
  tv_pixel_pairs given;
  tv_status status = read_pixel_pairs(pairs, &given);
  if (status == TV_OK) status = check_sized(result);
  if (status != TV_OK) return status;
  if ((camera0 == nullptr) != (camera1 == nullptr)) return TV_ERR_ARGUMENT;
  const bool calibrated = camera0 != nullptr;
  PairEstimate estimate{};
  status = read_estimate_options(options, calibrated, &estimate.problem.options);
  if (status != TV_OK) return status;
  if (given.num > context->limits.max_matches || !made_for(*context, TV_PURPOSE_ESTIMATE)) {
    return TV_ERR_LIMITS;
  }
  if (calibrated) {
    status = tv_camera_check(camera0);
    if (status == TV_OK) status = tv_camera_check(camera1);
    if (status != TV_OK) return status;
  }
  if (arrays_overlap(given, pairs, options, camera0, camera1, result, inlier_mask)) {
    return TV_ERR_OVERLAP;
  }
  ArenaScope scope(context->arena);
  estimate.outcome.evidence = evidence;
  estimate_pair(context, camera0, camera1, given, &estimate);
  pack(estimate, result);
  if (inlier_mask != nullptr) {
    const Matches& matches = estimate.matches;
    std::memset(inlier_mask, 0, static_cast<size_t>(given.num));
    for (int k = 0; k < matches.num_all; ++k) {
      inlier_mask[matches.order[k]] = estimate.outcome.inlier[k];
    }
  }
  return TV_OK;
}

void write_judgement(const Judgement& judgement, tv_two_view* result) {
  const int32_t verdict = judgement.verdict;
  const double wrong = judgement.probability_wrong;
  write_part(&verdict, sizeof verdict, offsetof(tv_two_view, verdict), result);
  write_part(&judgement.reasons, sizeof judgement.reasons, offsetof(tv_two_view, reasons), result);
  write_part(&wrong, sizeof wrong, offsetof(tv_two_view, probability_wrong), result);
}

}  // namespace tv

void tv_pixel_pairs_init_sized(tv_pixel_pairs* pairs, size_t struct_size) {
  tv::init_zeros(pairs, struct_size);
}

void tv_estimate_options_init_sized(tv_estimate_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_two_view_init_sized(tv_two_view* result, size_t struct_size) {
  tv::init_zeros(result, struct_size);
}

tv_status tv_corrected_pair(const tv_two_view* result, const tv_camera* camera0,
                            const tv_camera* camera1, tv_camera_pair* pair) {
  if (result == nullptr || camera0 == nullptr || camera1 == nullptr || pair == nullptr) {
    return TV_ERR_NULL;
  }
  tv_two_view found{};
  const tv_status status = tv::read_sized(result, &found);
  if (status != TV_OK) return status;
  tv_camera_pair corrected{*camera0, *camera1, {}, {}};
  for (tv_camera* camera : {&corrected.camera0, &corrected.camera1}) {
    camera->cx += found.principal_point_shift[0];
    camera->cy += found.principal_point_shift[1];
    if (found.focal_scale > 0) {
      camera->fx *= found.focal_scale;
      camera->fy *= found.focal_scale;
    }
  }
  std::copy(found.R, found.R + 9, corrected.cam1_from_cam0_R);
  std::copy(found.t, found.t + 3, corrected.cam1_from_cam0_t);
  *pair = corrected;
  return TV_OK;
}

tv_status tv_estimate_two_view(tv_context* context, const tv_camera* camera0,
                               const tv_camera* camera1, const tv_pixel_pairs* pairs,
                               const tv_estimate_options* options, tv_two_view* result,
                               uint8_t* inlier_mask) {
  tv::Evidence evidence;
  const tv_status status = tv::estimate_two_view(context, camera0, camera1, pairs, options, result,
                                                 inlier_mask, &evidence);
  if (status == TV_OK) tv::write_judgement(tv::judge(evidence), result);
  return status;
}
