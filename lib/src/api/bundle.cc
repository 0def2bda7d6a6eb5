// The entry points of bundle adjustment and of points' covariances: they validate, call
// robust/bundle.h and robust/point_covariance.h, and write the results.
#include "twoview/bundle.h"

#include <cmath>
#include <cstring>

#include "api/sized.h"
#include "api/validate.h"
#include "geometry/essential.h"
#include "robust/bundle.h"
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

// Checks a pose. Writes it with t of unit length, and |t| to *baseline.
tv_status read_pose(const double R[9], const double t[3], Pose* pose, double* baseline) {
  if (!all_finite(R, 9) || !all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  if (!is_rotation(R)) return TV_ERR_ARGUMENT;
  double largest = 0.0;
  for (int i = 0; i < 3; ++i) largest = std::fabs(t[i]) > largest ? std::fabs(t[i]) : largest;
  if (largest == 0.0) return TV_ERR_ARGUMENT;
  const double x = t[0] / largest, y = t[1] / largest, z = t[2] / largest;
  const double length = std::sqrt(x * x + y * y + z * z);
  *baseline = largest * length;
  if (!is_finite(*baseline)) return TV_ERR_ARGUMENT;
  pose->t = Vec3(x / length, y / length, z / length);
  for (int i = 0; i < 9; ++i) pose->R(i / 3, i % 3) = R[i];
  return TV_OK;
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

tv_status tv_adjust_two_view(tv_context* context, const tv_camera* camera0,
                             const tv_camera* camera1, const tv_pixel_pairs* pairs,
                             const tv_bundle_options* options, double R[9], double t[3],
                             tv_point* points, tv_bundle_result* result) {
  if (context == nullptr || camera0 == nullptr || camera1 == nullptr || R == nullptr ||
      t == nullptr) {
    return TV_ERR_NULL;
  }
  tv_pixel_pairs matches;
  tv_status status = tv::read_pixel_pairs(pairs, &matches);
  if (status == TV_OK && result != nullptr) status = tv::check_sized(result);
  if (status != TV_OK) return status;
  const double *const pixels0 = matches.pixels0, *const pixels1 = matches.pixels1;
  const int32_t num_points = matches.num;
  if (num_points > 0 && points == nullptr) return TV_ERR_NULL;
  tv::BundleProblem problem{};
  status = tv::read_bundle_options(options, &problem.options);
  if (status != TV_OK) return status;
  if (num_points > context->limits.max_matches || !tv::made_for(*context, TV_PURPOSE_ADJUST)) {
    return TV_ERR_LIMITS;
  }
  if (tv_camera_check(camera0) != TV_OK || tv_camera_check(camera1) != TV_OK) return TV_ERR_CAMERA;
  tv::Pose pose;
  double baseline;
  status = tv::read_pose(R, t, &pose, &baseline);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_points);
  const tv::Bytes arrays[12] = {{points, n * sizeof(tv_point)},
                                {R, 9 * sizeof(double)},
                                {t, 3 * sizeof(double)},
                                {result, result != nullptr ? result->struct_size : 0},
                                {pixels0, 2 * n * sizeof(double)},
                                {pixels1, 2 * n * sizeof(double)},
                                {camera0, sizeof(tv_camera)},
                                {camera1, sizeof(tv_camera)},
                                {options, options != nullptr ? options->struct_size : 0},
                                {pairs, pairs->struct_size},
                                {matches.sigmas0, n * sizeof(float)},
                                {matches.sigmas1, n * sizeof(float)}};
  if (tv::outputs_overlap(arrays, 4, 12)) return TV_ERR_OVERLAP;
  tv::StageTimer timer(context, TV_STAGE_REFINE);
  problem.camera[0] = tv::prepare_camera(*camera0);
  problem.camera[1] = tv::prepare_camera(*camera1);
  problem.pixels[0] = pixels0;
  problem.pixels[1] = pixels1;
  problem.sigmas[0] = matches.sigmas0;
  problem.sigmas[1] = matches.sigmas1;
  problem.num = num_points;
  tv::BundleOutcome outcome;
  tv::adjust_two_view(problem, pose, baseline, context->arena, points, &outcome);
  if (outcome.moved) {  // if the pose has not changed, R and t keep their bits
    for (int i = 0; i < 9; ++i) R[i] = outcome.pose.R(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) t[i] = baseline * outcome.pose.t[i];
  }
  if (result != nullptr) tv::pack(outcome, result);
  return TV_OK;
}

tv_status tv_point_covariances(const tv_camera* camera0, const tv_camera* camera1,
                               const double R[9], const double t[3], const double* pose_covariance,
                               double noise_px, const tv_point* points, int32_t num_points,
                               double* covariances) {
  if (camera0 == nullptr || camera1 == nullptr || R == nullptr || t == nullptr ||
      (num_points > 0 && (points == nullptr || covariances == nullptr))) {
    return TV_ERR_NULL;
  }
  if (!tv::is_finite(noise_px)) return TV_ERR_NOT_FINITE;
  if (pose_covariance != nullptr && !tv::all_finite(pose_covariance, 25)) return TV_ERR_NOT_FINITE;
  if (num_points < 0 || noise_px < 0 || noise_px > tv::kLargest) return TV_ERR_ARGUMENT;
  if (tv_camera_check(camera0) != TV_OK || tv_camera_check(camera1) != TV_OK) return TV_ERR_CAMERA;
  tv::Pose pose;
  double baseline;
  const tv_status status = tv::read_pose(R, t, &pose, &baseline);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_points);
  const tv::Bytes arrays[7] = {{covariances, 9 * n * sizeof(double)},
                               {points, n * sizeof(tv_point)},
                               {pose_covariance, 25 * sizeof(double)},
                               {R, 9 * sizeof(double)},
                               {t, 3 * sizeof(double)},
                               {camera0, sizeof(tv_camera)},
                               {camera1, sizeof(tv_camera)}};
  if (tv::outputs_overlap(arrays, 1, 7)) return TV_ERR_OVERLAP;
  const tv::Camera cameras[2] = {tv::prepare_camera(*camera0), tv::prepare_camera(*camera1)};
  const tv::BundleFrame frame = tv::bundle_frame(pose);
  for (size_t i = 0; i < n; ++i) {
    tv::point_covariance(cameras, frame, baseline, pose_covariance, noise_px, points[i],
                         covariances + 9 * i);
  }
  return TV_OK;
}
