// The entry points of the absolute pose: they validate, call pose/absolute_pose.h and write the
// result.
#include "twoview/absolute_pose.h"

#include <cstring>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "pose/absolute_pose.h"

namespace tv {
namespace {

constexpr tv_absolute_pose_options kDefaults = {
    sizeof(tv_absolute_pose_options), 10000, 0, 0, 4.0, 0.9999, 20130814, {0, 0, 0}, {0, 0, 0}, 0};

tv_status read_matches(const tv_pixel_points* given, tv_pixel_points* matches) {
  if (given == nullptr) return TV_ERR_NULL;
  *matches = tv_pixel_points{};
  const tv_status status = read_sized(given, matches);
  if (status != TV_OK) return status;
  if (matches->num < 0) return TV_ERR_ARGUMENT;
  if (matches->num > 0 && (matches->pixels == nullptr || matches->points == nullptr)) {
    return TV_ERR_NULL;
  }
  for (int32_t i = 0; matches->sigmas != nullptr && i < matches->num; ++i) {
    if (!is_finite(matches->sigmas[i])) return TV_ERR_NOT_FINITE;
    if (!within(matches->sigmas[i], kLeastSigma, kLargestSigma)) return TV_ERR_ARGUMENT;
  }
  return TV_OK;
}

tv_status read_options(const tv_absolute_pose_options* given, tv_absolute_pose_options* options) {
  *options = kDefaults;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  const tv_absolute_pose_options& o = *options;
  if (!is_finite(o.max_error_px) || !is_finite(o.confidence) || !is_finite(o.gravity_sigma_rad)) {
    return TV_ERR_NOT_FINITE;
  }
  const bool valid = o.max_error_px > 0 && o.max_error_px <= 1e9 && o.confidence >= 0 &&
                     o.confidence < 1 && within(o.max_iterations, 1, 1000000) &&
                     within(o.fixed_iterations, 0, 1000000) && o.reserved == 0;
  const tv_status gravity =
      check_gravity(o.gravity_in_world, o.gravity_in_camera, o.gravity_sigma_rad);
  return gravity == TV_OK && !valid ? TV_ERR_ARGUMENT : gravity;
}

}  // namespace
}  // namespace tv

void tv_pixel_points_init_sized(tv_pixel_points* matches, size_t struct_size) {
  tv::init_zeros(matches, struct_size);
}

void tv_absolute_pose_options_init_sized(tv_absolute_pose_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_absolute_pose_init_sized(tv_absolute_pose* result, size_t struct_size) {
  tv::init_zeros(result, struct_size);
}

tv_status tv_estimate_absolute_pose(tv_context* context, const tv_camera* camera,
                                    const tv_pixel_points* matches,
                                    const tv_absolute_pose_options* options,
                                    tv_absolute_pose* result, uint8_t* inlier_mask) {
  if (context == nullptr || result == nullptr) return TV_ERR_NULL;
  tv_pixel_points given;
  tv_absolute_pose_options checked;
  tv_status status = tv::read_matches(matches, &given);
  if (status == TV_OK) status = tv::check_sized(result);
  if (status == TV_OK) status = tv::read_options(options, &checked);
  if (status != TV_OK) return status;
  if (given.num > context->limits.max_matches ||
      !tv::made_for(*context, TV_PURPOSE_ABSOLUTE_POSE)) {
    return TV_ERR_LIMITS;
  }
  status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(given.num);
  const tv::Bytes arrays[] = {{inlier_mask, n},
                              {result, result->struct_size},
                              {given.pixels, 16 * n},
                              {given.points, 24 * n},
                              {given.ratios, 4 * n},
                              {given.sigmas, 4 * n},
                              {matches, matches->struct_size},
                              {options, options != nullptr ? options->struct_size : 0},
                              {camera, sizeof(tv_camera)}};
  if (tv::outputs_overlap(arrays, 2, 9)) return TV_ERR_OVERLAP;
  tv::ArenaScope scope(context->arena);
  tv::Sightings sightings;
  tv::AbsolutePoseSearch search;
  const tv::SightingInput input{context->kernels, tv::prepare_camera(*camera),
                                given.pixels,     given.points,
                                given.ratios,     given.sigmas,
                                given.num};
  {
    tv::StageTimer timer(context, TV_STAGE_ESTIMATE);
    tv::prepare_sightings(input, context->arena, &sightings);
    tv::search_absolute_pose(sightings, checked, given.ratios != nullptr, context->arena, &search);
  }
  tv::StageTimer timer(context, TV_STAGE_REFINE);
  tv_absolute_pose packed{};
  packed.num_matches = given.num;
  packed.num_iterations = search.num_iterations;
  packed.seed = checked.seed;
  if (inlier_mask != nullptr) std::memset(inlier_mask, 0, n);
  tv::finish_absolute_pose(input, sightings, checked, search, context->arena, &packed, inlier_mask);
  tv::write_sized(packed, result);
  return TV_OK;
}
