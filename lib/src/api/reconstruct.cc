// The entry point tv_reconstruct: it validates, calls pipeline/reconstruct.h, and points to its
// results.
#include "pipeline/reconstruct.h"

#include <algorithm>
#include <cstddef>

#include "api/camera_pair.h"
#include "api/sized.h"
#include "api/two_view.h"
#include "api/validate.h"
#include "api/within.h"
#include "feature/sigmas.h"
#include "triangulation/triangulation.h"

namespace tv {
namespace {

constexpr tv_reconstruct_options kDefaults = {sizeof(tv_reconstruct_options),
                                              TV_TRIANGULATION_ITERATIVE_LS,
                                              nullptr,
                                              nullptr,
                                              nullptr,
                                              0,
                                              0,
                                              1.0,
                                              1,
                                              0,
                                              0,
                                              0};

tv_status read_reconstruct_options(const tv_reconstruct_options* options,
                                   tv_reconstruct_options* checked) {
  *checked = kDefaults;
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  constexpr size_t kWithAlignment = offsetof(tv_reconstruct_options, align_matches) + 4;
  if (options != nullptr && options->struct_size < kWithAlignment) checked->align_matches = 0;
  if (!is_finite(checked->sigma_by_size)) return TV_ERR_NOT_FINITE;
  const bool valid = is_triangulation_method(checked->triangulation) &&
                     (checked->guided_matching == 0 || checked->guided_matching == 1) &&
                     (checked->bundle_adjustment == 0 || checked->bundle_adjustment == 1) &&
                     checked->sigma_by_size >= 0 && checked->sigma_by_size <= kMostSigmaExponent &&
                     (checked->align_matches == 0 || checked->align_matches == 1) &&
                     checked->reserved == 0 && within(checked->effort, 0, kMaxEffort) &&
                     within(checked->max_effort, 0, kMaxEffort);
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_view(const tv_context& context, const tv_view& view) {
  const tv_image &image = view.image, *const mask = view.mask;
  const tv_camera* const camera = view.camera;
  tv_status status = check_image(context, &image);
  if (status == TV_OK) status = check_mask(mask, image);
  if (status != TV_OK) return status;
  if (camera != nullptr && (camera->width != image.width || camera->height != image.height)) {
    return TV_ERR_CAMERA;
  }
  const Bytes arrays[] = {{context.arena.memory, context.arena.size_bytes},
                          {image.data, image_bytes(image)},
                          mask != nullptr ? Bytes{mask->data, image_bytes(*mask)} : Bytes{}};
  return outputs_overlap(arrays, 1, 3) ? TV_ERR_OVERLAP : TV_OK;
}

// Checks the views, and reads the options of the stages.
tv_status read_stages(const tv_context& context, PairTask* task) {
  const tv_reconstruct_options& given = task->options;
  const tv_camera *const camera0 = task->views[0].camera, *const camera1 = task->views[1].camera;
  tv_status status = read_feature_options(context, given.feature, &task->features);
  for (const tv_view& view : task->views) {
    if (status == TV_OK) status = check_view(context, view);
  }
  if (status == TV_OK) status = read_match_options(given.match, &task->match);
  if (status == TV_OK) {
    status = read_estimate_options(given.estimate, camera0 != nullptr, &task->estimate);
  }
  tv_guided_options_init(&task->guided);
  tv_bundle_options_init(&task->bundle);
  return status != TV_OK ? status : check_optional_cameras(camera0, camera1);
}

// Reads and checks all that a reconstruction is given.
tv_status read_task(const tv_context& context, const tv_view* view0, const tv_view* view1,
                    const tv_reconstruct_options* options, PairTask* task) {
  tv_status status = read_sized(view0, &task->views[0]);
  if (status == TV_OK) status = read_sized(view1, &task->views[1]);
  if (status == TV_OK) status = read_reconstruct_options(options, &task->options);
  if (status != TV_OK) return status;
  if (task->views[0].reserved != 0 || task->views[1].reserved != 0) return TV_ERR_ARGUMENT;
  const tv_reconstruct_options& o = task->options;
  const uint32_t purposes = TV_PURPOSE_RECONSTRUCT |
                            (o.guided_matching != 0 ? TV_PURPOSE_MATCH_GUIDED : 0) |
                            (o.bundle_adjustment != 0 ? TV_PURPOSE_ADJUST : 0);
  if (!made_for(context, purposes)) return TV_ERR_LIMITS;
  if (std::max(o.effort, o.max_effort) > context.limits.max_effort) return TV_ERR_EFFORT;
  return read_stages(context, task);
}

void pack(const PairArrays& arrays, const Attempt& attempt, int32_t num_points,
          tv_reconstruction* reconstruction) {
  tv_reconstruction packed{};
  packed.effort = attempt.rung;
  packed.num_rungs = attempt.num_rungs;
  std::copy_n(attempt.rung_ns, attempt.num_rungs, packed.rung_ns);
  for (int v = 0; v < 2; ++v) {
    packed.tilts[v] = arrays.tilts[v];
    packed.num_keypoints[v] = attempt.num_keypoints[v];
    packed.keypoints[v] = arrays.keypoints[v];
    packed.descriptors[v] = arrays.descriptors[v];
  }
  packed.num_matches_left_out = attempt.num_left_out;
  packed.num_matches = attempt.num_matches;
  packed.num_points = num_points;
  packed.matches = arrays.matches;
  packed.inlier_mask = arrays.inlier_mask;
  packed.points = arrays.points;
  write_sized(packed, reconstruction);
}

}  // namespace
}  // namespace tv

void tv_view_init_sized(tv_view* view, size_t struct_size) { tv::init_zeros(view, struct_size); }

void tv_reconstruct_options_init_sized(tv_reconstruct_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_reconstruction_init_sized(tv_reconstruction* reconstruction, size_t struct_size) {
  tv::init_zeros(reconstruction, struct_size);
}

tv_status tv_reconstruct(tv_context* context, const tv_view* view0, const tv_view* view1,
                         const tv_reconstruct_options* options, tv_two_view* two_view,
                         tv_evidence* evidence, tv_reconstruction* reconstruction) {
  if (context == nullptr || view0 == nullptr || view1 == nullptr || two_view == nullptr ||
      reconstruction == nullptr) {
    return TV_ERR_NULL;
  }
  tv_status status = tv::check_sized(two_view);
  if (status == TV_OK) status = tv::check_sized(reconstruction);
  if (status == TV_OK && evidence != nullptr) status = tv::check_sized(evidence);
  if (status != TV_OK) return status;
  const tv::Bytes outputs[] = {{two_view, two_view->struct_size},
                               {evidence, evidence != nullptr ? evidence->struct_size : 0},
                               {reconstruction, reconstruction->struct_size}};
  if (tv::outputs_overlap(outputs, 3, 3)) return TV_ERR_OVERLAP;
  tv::PairTask task{};
  status = tv::read_task(*context, view0, view1, options, &task);
  if (status != TV_OK) return status;
  tv::PairArrays arrays;
  tv::Attempt attempt{};
  const int32_t num_points = tv::reconstruct(context, task, &arrays, &attempt);
  tv::write_sized(attempt.estimate.view, two_view);
  tv::pack_evidence(attempt.estimate.evidence, evidence);
  tv::pack(arrays, attempt, num_points, reconstruction);
  return TV_OK;
}
