// The entry points of two-view estimation: they validate, call pipeline/two_view.h, and write the
// result of pipeline/pair_result.h with the judgement of robust/verdict.h.
#include "api/two_view.h"

#include <algorithm>

#include "api/camera_pair.h"
#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "base/math.h"
#include "pipeline/pair_result.h"

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
                                           {},
                                           {},
                                           kReadoutTurn,
                                           0,
                                           0};

constexpr double kMostSigma = 0.5;

// Checks how uncertain the cameras are, and how far they may turn.
tv_status check_calibrations(const tv_estimate_options& options) {
  constexpr uint32_t kRefined = TV_REFINE_FOCAL_LENGTH | TV_REFINE_PRINCIPAL_POINT;
  const tv_calibration *const c0 = &options.calibration0, *const c1 = &options.calibration1;
  const uint32_t refine = c0->refine | c1->refine;
  if ((refine & ~kRefined) != 0 || c0->reserved != 0 || c1->reserved != 0) return TV_ERR_ARGUMENT;
  const double most_of_center = (refine & TV_REFINE_PRINCIPAL_POINT) != 0 ? 0.1 : kMostSigma;
  for (const tv_calibration* c : {c0, c1}) {
    if (!is_finite(c->focal_sigma) || !is_finite(c->center_sigma)) return TV_ERR_NOT_FINITE;
    if (!within(c->focal_sigma, 0.0, kMostSigma) || !within(c->center_sigma, 0.0, most_of_center)) {
      return TV_ERR_ARGUMENT;
    }
  }
  if (!is_finite(options.readout_turn_sigma_rad)) return TV_ERR_NOT_FINITE;
  return within(options.readout_turn_sigma_rad, 0.0, kMostSigma) ? TV_OK : TV_ERR_ARGUMENT;
}

// Writes the result. Not inlined, so that its stack frame is not in use during the search.
__attribute__((noinline)) void pack(const PairEstimate& estimate, tv_two_view* result) {
  tv_two_view packed;
  write_estimate(estimate, &packed);
  write_judgement(judge(*estimate.outcome.evidence), &packed);
  write_sized(packed, result);
}

// Whether an output shares a byte with another argument. Not inlined, for the same reason.
__attribute__((noinline)) bool arrays_overlap(
    const tv_pixel_pairs& given, const tv_pixel_pairs* pairs, const tv_estimate_options* options,
    const tv_camera* camera0, const tv_camera* camera1, const tv_two_view* result,
    const tv_evidence* evidence, const uint8_t* inlier_mask) {
  const size_t n = static_cast<size_t>(given.num);
  const Bytes arrays[] = {{inlier_mask, n},
                          {result, result->struct_size},
                          {evidence, evidence != nullptr ? evidence->struct_size : 0},
                          {given.pixels0, 16 * n},
                          {given.pixels1, 16 * n},
                          {given.ratios, 4 * n},
                          {given.sigmas0, 4 * n},
                          {given.sigmas1, 4 * n},
                          {pairs, pairs->struct_size},
                          {options, options != nullptr ? options->struct_size : 0},
                          {camera0, sizeof(tv_camera)},
                          {camera1, sizeof(tv_camera)}};
  return outputs_overlap(arrays, 3, 12);
}

}  // namespace

void pack_evidence(const Evidence& evidence, tv_evidence* written) {
  if (written == nullptr) return;
  tv_evidence packed;
  write_evidence(evidence, &packed);
  write_sized(packed, written);
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
      !is_finite(checked->gravity_sigma_rad)) {
    return TV_ERR_NOT_FINITE;
  }
  const bool in_range = checked->max_error_px > 0 && checked->max_error_px <= 1e9 &&
                        checked->confidence >= 0 && checked->confidence < 1 &&
                        checked->max_iterations >= 1 && checked->max_iterations <= 1000000 &&
                        checked->fixed_iterations >= 0 && checked->fixed_iterations <= 1000000 &&
                        checked->num_trials >= 0 && checked->num_trials <= 10000 &&
                        checked->reserved == 0;
  const bool with_gravity = checked->gravity_sigma_rad > 0;
  const bool method_known = checked->method == TV_SOLVER_EIGHT_POINT ||
                            checked->method == TV_SOLVER_SEVEN_POINT ||
                            (checked->method == TV_SOLVER_FIVE_POINT && calibrated) ||
                            (checked->method == TV_SOLVER_UPRIGHT && calibrated && with_gravity);
  if (!in_range || !method_known) return TV_ERR_ARGUMENT;
  checked->num_trials = std::max(checked->num_trials, 1);
  const tv_status sigmas = check_calibrations(*checked);
  return sigmas != TV_OK
             ? sigmas
             : check_gravity(checked->gravity0, checked->gravity1, checked->gravity_sigma_rad);
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

void tv_evidence_init_sized(tv_evidence* evidence, size_t struct_size) {
  tv::init_zeros(evidence, struct_size);
}

tv_status tv_corrected_pair(const tv_two_view* result, const tv_camera* camera0,
                            const tv_camera* camera1, tv_camera_pair* pair) {
  if (result == nullptr || camera0 == nullptr || camera1 == nullptr || pair == nullptr) {
    return TV_ERR_NULL;
  }
  tv_two_view found{};
  const tv_status status = tv::read_sized(result, &found);
  if (status != TV_OK) return status;
  *pair = tv::corrected_pair(found, *camera0, *camera1);
  return TV_OK;
}

tv_status tv_estimate_two_view(tv_context* context, const tv_camera* camera0,
                               const tv_camera* camera1, const tv_pixel_pairs* pairs,
                               const tv_estimate_options* options, tv_two_view* result,
                               tv_evidence* evidence, uint8_t* inlier_mask) {
  if (context == nullptr || result == nullptr) return TV_ERR_NULL;
  tv_pixel_pairs given;
  tv_status status = tv::read_pixel_pairs(pairs, &given);
  if (status == TV_OK) status = tv::check_sized(result);
  if (status == TV_OK && evidence != nullptr) status = tv::check_sized(evidence);
  if (status != TV_OK) return status;
  tv::PairEstimate estimate{};
  status = tv::read_estimate_options(options, camera0 != nullptr, &estimate.problem.options);
  if (status != TV_OK) return status;
  if (given.num > context->limits.max_matches || !tv::made_for(*context, TV_PURPOSE_ESTIMATE)) {
    return TV_ERR_LIMITS;
  }
  status = tv::check_optional_cameras(camera0, camera1);
  if (status != TV_OK) return status;
  if (tv::arrays_overlap(given, pairs, options, camera0, camera1, result, evidence, inlier_mask)) {
    return TV_ERR_OVERLAP;
  }
  tv::ArenaScope scope(context->arena);
  tv::Evidence measured;
  estimate.outcome.evidence = &measured;
  tv::estimate_pair(context, camera0, camera1, given, &estimate);
  tv::pack(estimate, result);
  tv::pack_evidence(measured, evidence);
  if (inlier_mask != nullptr) tv::write_inliers(estimate, inlier_mask);
  return TV_OK;
}
