// The entry points of the odometry: they validate, call odometry/track.h, and write the results.
#include "twoview/odometry.h"

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "odometry/gyro.h"
#include "odometry/memory.h"
#include "odometry/still_cells.h"
#include "odometry/track.h"
#include "odometry/work.h"
#include "pipeline/context.h"

namespace tv {
namespace {

constexpr tv_odometry_options kDefaults = {
    sizeof(tv_odometry_options), 1000, 200, 20000, 10, TV_KERNELS_AUTO, 20130814,
    TV_REFINE_PRINCIPAL_POINT,   0};

tv_status make_plan(const tv_camera* camera, const tv_odometry_options* options, MemoryPlan* plan) {
  tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  plan->camera = *camera;
  plan->options = kDefaults;
  status = read_sized(options, &plan->options);
  if (status != TV_OK) return status;
  const tv_odometry_options& o = plan->options;
  if (!within(o.max_keypoints, 100, 4096) || !within(o.max_keyframes, 8, 2000) ||
      !within(o.max_points, 500, 200000) || !within(o.window, 3, 20) ||
      !within(o.kernels, TV_KERNELS_AUTO, TV_KERNELS_NEON) ||
      (o.refine & ~uint32_t{TV_REFINE_PRINCIPAL_POINT}) != 0 || o.reserved != 0 ||
      !within(camera->width, 32, 16384) || !within(camera->height, 32, 16384)) {
    return TV_ERR_ARGUMENT;
  }
  plan->limits = context_limits(plan->camera, o);
  status = tv_context_size(&plan->limits, &plan->context_bytes);
  if (status != TV_OK) return status;
  plan->shared_bytes = plan->context_bytes - kContextBytes;
  measure_memory(plan);
  return TV_OK;
}

// Checks each argument of a frame; each has its own status.
tv_status check_frame_image(const tv_odometry& odometry, const tv_image& image) {
  const tv_status status = check_camera_image(odometry.camera.model, image);
  return status == TV_ERR_ARGUMENT ? TV_ERR_STRIDE : status;
}

// mask: null, or with pixels.
tv_status check_frame_mask(const tv_image* mask, const tv_image& image) {
  const tv_status status = check_mask(mask, image);
  return status == TV_ERR_ARGUMENT ? TV_ERR_MASK : status;
}

constexpr double kMostRate = 1000, kMostSeconds = 1000;  // radians per second; of a turn

tv_status check_samples(const tv_gyro_sample* samples, int32_t num, double begin_s, double end_s) {
  for (int32_t k = 0; k < num; ++k) {
    const tv_gyro_sample& s = samples[k];
    if (!is_finite(s.time_s) || !all_finite(s.rate_rad_s, 3)) return TV_ERR_NOT_FINITE;
    for (double rate : s.rate_rad_s) {
      if (!(rate >= -kMostRate && rate <= kMostRate)) return TV_ERR_ARGUMENT;
    }
    if (k > 0 && !(s.time_s > samples[k - 1].time_s)) return TV_ERR_TIME;
  }
  const bool reach = begin_s < end_s && samples[0].time_s <= begin_s &&
                     samples[num - 1].time_s >= end_s && end_s - begin_s <= kMostSeconds;
  return reach ? TV_OK : TV_ERR_TIME;
}

// Whether a state that is written overlaps what is read.
bool overlaps(const tv_odometry_state* state, const void* input, size_t input_bytes,
              const tv_image& image, const tv_image* mask) {
  const size_t bytes = state->struct_size;
  return overlap(state, bytes, input, input_bytes) ||
         overlap(state, bytes, image.data, image_bytes(image)) ||
         (mask != nullptr && overlap(state, bytes, mask->data, image_bytes(*mask)));
}

}  // namespace
}  // namespace tv

void tv_odometry_options_init_sized(tv_odometry_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_odometry_frame_init_sized(tv_odometry_frame* frame, size_t struct_size) {
  tv::init_zeros(frame, struct_size);
}

void tv_odometry_state_init_sized(tv_odometry_state* state, size_t struct_size) {
  tv::init_zeros(state, struct_size);
}

void tv_keyframe_init_sized(tv_keyframe* keyframe, size_t struct_size) {
  tv::init_zeros(keyframe, struct_size);
}

const char* tv_odometry_status_string(tv_odometry_status status) {
  static constexpr char kNames[][9] = {"starting", "tracking", "weak", "rotation", "lost"};
  return tv::within(status, 0, TV_ODOMETRY_NUM_STATUSES - 1) ? kNames[status] : "unknown";
}

tv_status tv_odometry_size(const tv_camera* camera, const tv_odometry_options* options,
                           size_t* size_bytes) {
  tv::MemoryPlan plan;
  const tv_status status = tv::make_plan(camera, options, &plan);
  if (status != TV_OK) return status;
  if (size_bytes == nullptr) return TV_ERR_NULL;
  *size_bytes = plan.num_bytes;
  return TV_OK;
}

tv_status tv_odometry_init(tv_odometry** odometry, const tv_camera* camera,
                           const tv_odometry_options* options, void* memory, size_t size_bytes) {
  tv::MemoryPlan plan;
  tv_status status = tv::make_plan(camera, options, &plan);
  if (status != TV_OK) return status;
  if (odometry == nullptr || memory == nullptr) return TV_ERR_NULL;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < plan.num_bytes) return TV_ERR_MEMORY;
  uint8_t* context_memory;
  tv_odometry* o = tv::lay_out(plan, memory, &context_memory);
  status = tv_context_init(&o->context, &plan.limits, context_memory, plan.context_bytes);
  if (status != TV_OK) return status;
  o->kernels = o->context->kernels;
  tv::start_anew(o);
  *odometry = o;
  return TV_OK;
}

tv_status tv_odometry_reset(tv_odometry* odometry) {
  if (odometry == nullptr) return TV_ERR_NULL;
  tv::start_anew(odometry);
  return TV_OK;
}

tv_status tv_integrate_gyro(const tv_gyro_sample* samples, int32_t num, double sigma_rad_s,
                            double begin_s, double end_s, double previous_from_cam[9],
                            double* turn_sigma_rad) {
  if (samples == nullptr || previous_from_cam == nullptr || turn_sigma_rad == nullptr)
    return TV_ERR_NULL;
  if (!tv::is_finite(sigma_rad_s) || !tv::is_finite(begin_s) || !tv::is_finite(end_s))
    return TV_ERR_NOT_FINITE;
  if (num < 2 || sigma_rad_s < 0) return TV_ERR_ARGUMENT;
  const tv_status status = tv::check_samples(samples, num, begin_s, end_s);
  if (status != TV_OK) return status;
  tv::write_matrix(tv::integrated(samples, num, sigma_rad_s, begin_s, end_s, turn_sigma_rad),
                   previous_from_cam);
  return TV_OK;
}

tv_status tv_odometry_track(tv_odometry* odometry, const tv_odometry_frame* frame,
                            tv_odometry_state* state) {
  if (odometry == nullptr || frame == nullptr || state == nullptr) return TV_ERR_NULL;
  tv_odometry_frame input{};
  tv_status status = tv::read_sized(frame, &input);
  if (status == TV_OK) status = tv::check_sized(state);
  if (status == TV_OK) status = tv::check_frame_image(*odometry, input.image);
  if (status != TV_OK) return status;
  const tv_image* mask = input.mask.data != nullptr ? &input.mask : nullptr;
  status = tv::check_frame_mask(mask, input.image);
  if (status != TV_OK) return status;
  if (!tv::is_finite(input.time_s)) return TV_ERR_NOT_FINITE;
  if (!tv::within(input.gap, 0, 1)) return TV_ERR_ARGUMENT;
  if (odometry->num_frames > 0 && input.gap == 0 && !(input.time_s > odometry->last_time_s))
    return TV_ERR_TIME;
  if (tv::overlaps(state, frame, frame->struct_size, input.image, mask)) return TV_ERR_OVERLAP;
  tv_odometry_state packed{};
  tv::track_frame(odometry, input, &packed);
  tv::write_sized(packed, state);
  return TV_OK;
}

tv_status tv_odometry_camera(const tv_odometry* odometry, tv_camera* camera) {
  if (odometry == nullptr || camera == nullptr) return TV_ERR_NULL;
  *camera = odometry->camera.model;
  return TV_OK;
}

tv_status tv_odometry_still_mask(const tv_odometry* odometry, uint8_t* mask, size_t cap_bytes) {
  if (odometry == nullptr || mask == nullptr) return TV_ERR_NULL;
  const tv_camera& camera = odometry->given_camera;
  if (cap_bytes < static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height)) {
    return TV_ERR_CAPACITY;
  }
  tv::write_mask(*odometry, nullptr, mask);
  return TV_OK;
}

tv_status tv_odometry_finish(tv_odometry* odometry) {
  if (odometry == nullptr) return TV_ERR_NULL;
  tv::finish_work(odometry);
  return TV_OK;
}

tv_status tv_odometry_locate(tv_odometry* odometry, const tv_image* image, const tv_image* mask,
                             int32_t near_id, tv_odometry_state* state) {
  if (odometry == nullptr || image == nullptr || state == nullptr) return TV_ERR_NULL;
  if (mask != nullptr && mask->data == nullptr) mask = nullptr;
  tv_status status = tv::check_sized(state);
  if (status == TV_OK) status = tv::check_frame_image(*odometry, *image);
  if (status == TV_OK) status = tv::check_frame_mask(mask, *image);
  if (status != TV_OK) return status;
  if (tv::overlaps(state, image, sizeof *image, *image, mask)) return TV_ERR_OVERLAP;
  tv_odometry_state packed{};
  tv::locate_frame(odometry, *image, mask, near_id, &packed);
  tv::write_sized(packed, state);
  return TV_OK;
}

tv_status tv_odometry_pose_of(const tv_odometry* odometry, int32_t reference_id,
                              const double reference_from_cam_R[9],
                              const double reference_from_cam_t[3], double R[9], double t[3],
                              int32_t* segment) {
  if (odometry == nullptr || reference_from_cam_R == nullptr || reference_from_cam_t == nullptr ||
      R == nullptr || t == nullptr) {
    return TV_ERR_NULL;
  }
  const tv::Bytes arrays[5] = {{R, 72},
                               {t, 24},
                               {segment, segment != nullptr ? sizeof *segment : 0},
                               {reference_from_cam_R, 72},
                               {reference_from_cam_t, 24}};
  if (tv::outputs_overlap(arrays, 3, 5)) return TV_ERR_OVERLAP;
  tv::Rigid pose = tv::rigid_of(reference_from_cam_R, reference_from_cam_t);
  const tv::Map& map = odometry->map;
  const int32_t k = tv::pose_in_world(map, reference_id, &pose);
  if (k < 0) return TV_ERR_ARGUMENT;
  tv::write_rigid(pose, R, t);
  if (segment != nullptr) *segment = map.keyframes[k].segment;
  return TV_OK;
}
