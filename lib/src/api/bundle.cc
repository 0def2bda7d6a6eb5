// The entry points of bundle adjustment and of points' covariances: they validate, call
// pipeline/bundle.h and robust/point_covariance.h, and write the results.
#include "twoview/bundle.h"

#include <cmath>
#include <cstring>

#include "api/camera_pair.h"
#include "api/sized.h"
#include "api/validate.h"
#include "pipeline/bundle.h"
#include "robust/point_covariance.h"

namespace tv {
namespace {

constexpr tv_bundle_options kDefaults = {sizeof(tv_bundle_options), TV_LOSS_CAUCHY, 1.0, 50, 0};
constexpr double kLargest = 1e9;

tv_status read_bundle_options(const tv_bundle_options* options, tv_bundle_options* checked) {
  *checked = kDefaults;
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  const tv_bundle_options& o = *checked;
  if (!is_finite(o.loss_scale_px)) return TV_ERR_NOT_FINITE;
  const bool valid = o.loss >= TV_LOSS_NONE && o.loss <= TV_LOSS_CAUCHY && o.loss_scale_px > 0 &&
                     o.loss_scale_px <= kLargest && o.max_iterations >= 0 &&
                     o.max_iterations <= 1000 && o.hold_pose >= 0 && o.hold_pose <= 1;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

// Checks a pair, and reads its motion, whose baseline must be a number.
tv_status read_pair(const tv_camera_pair& pair, Motion* motion) {
  const tv_status status = check_pair(pair);
  if (status != TV_OK) return status;
  *motion = read_motion(pair);
  return is_finite(motion->baseline) ? TV_OK : TV_ERR_ARGUMENT;
}

double rms(double sum_sq, int num_points) {
  return num_points > 0 ? std::sqrt(sum_sq / (2.0 * num_points)) : 0.0;
}

void pack(const BundleOutcome& outcome, tv_bundle_result* result) {
  tv_bundle_result packed{};
  packed.num_points = outcome.num_points;
  packed.num_iterations = outcome.num_iterations;
  packed.converged = outcome.converged;
  packed.initial_cost = outcome.initial_cost;
  packed.final_cost = outcome.final_cost;
  packed.initial_rms_px = rms(outcome.initial_sum_sq, outcome.num_points);
  packed.rms_px = rms(outcome.final_sum_sq, outcome.num_points);
  packed.has_covariance = outcome.has_covariance;
  if (outcome.has_covariance) {
    std::memcpy(packed.covariance, outcome.covariance, sizeof packed.covariance);
    packed.noise_px = outcome.noise_px;
  }
  write_sized(packed, result);
}

}  // namespace
}  // namespace tv

void tv_bundle_options_init_sized(tv_bundle_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_bundle_result_init_sized(tv_bundle_result* result, size_t struct_size) {
  tv::init_zeros(result, struct_size);
}

tv_status tv_adjust_two_view(tv_context* context, const tv_pixel_pairs* pixels,
                             const tv_bundle_options* options, tv_camera_pair* pair,
                             tv_point* points, tv_bundle_result* result) {
  if (context == nullptr || pair == nullptr) return TV_ERR_NULL;
  tv_pixel_pairs matches;
  tv_status status = tv::read_pixel_pairs(pixels, &matches);
  if (status == TV_OK && result != nullptr) status = tv::check_sized(result);
  if (status != TV_OK) return status;
  if (matches.num > 0 && points == nullptr) return TV_ERR_NULL;
  tv_bundle_options checked;
  status = tv::read_bundle_options(options, &checked);
  if (status != TV_OK) return status;
  if (matches.num > context->limits.max_matches || !tv::made_for(*context, TV_PURPOSE_ADJUST)) {
    return TV_ERR_LIMITS;
  }
  tv::Motion motion;
  status = tv::read_pair(*pair, &motion);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(matches.num);
  const tv::Bytes arrays[9] = {{points, n * sizeof(tv_point)},
                               {pair, sizeof *pair},
                               {result, result != nullptr ? result->struct_size : 0},
                               {matches.pixels0, 2 * n * sizeof(double)},
                               {matches.pixels1, 2 * n * sizeof(double)},
                               {options, options != nullptr ? options->struct_size : 0},
                               {pixels, pixels->struct_size},
                               {matches.sigmas0, n * sizeof(float)},
                               {matches.sigmas1, n * sizeof(float)}};
  if (tv::outputs_overlap(arrays, 3, 9)) return TV_ERR_OVERLAP;
  tv::BundleOutcome outcome;
  tv::adjust_pair(context, matches, checked, motion, pair, points, &outcome);
  if (result != nullptr) tv::pack(outcome, result);
  return TV_OK;
}

tv_status tv_point_covariances(const tv_camera_pair* pair, const tv_point* points,
                               int32_t num_points, double noise_px, const double* pose_covariance,
                               double* covariances) {
  if (pair == nullptr || (num_points > 0 && (points == nullptr || covariances == nullptr))) {
    return TV_ERR_NULL;
  }
  if (!tv::is_finite(noise_px)) return TV_ERR_NOT_FINITE;
  if (pose_covariance != nullptr && !tv::all_finite(pose_covariance, 25)) return TV_ERR_NOT_FINITE;
  if (num_points < 0 || noise_px < 0 || noise_px > tv::kLargest) return TV_ERR_ARGUMENT;
  tv::Motion motion;
  const tv_status status = tv::read_pair(*pair, &motion);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_points);
  const tv::Bytes arrays[4] = {{covariances, 9 * n * sizeof(double)},
                               {points, n * sizeof(tv_point)},
                               {pose_covariance, 25 * sizeof(double)},
                               {pair, sizeof *pair}};
  if (tv::outputs_overlap(arrays, 1, 4)) return TV_ERR_OVERLAP;
  const tv::Camera cameras[2] = {tv::prepare_camera(pair->camera0),
                                 tv::prepare_camera(pair->camera1)};
  const tv::BundleFrame frame = tv::bundle_frame(motion.pose);
  for (size_t i = 0; i < n; ++i) {
    tv::point_covariance(cameras, frame, motion.baseline, pose_covariance, noise_px, points[i],
                         covariances + 9 * i);
  }
  return TV_OK;
}
