// The entry points of the odometry: they validate, call odometry/track.h, and write the results.
#include "twoview/odometry.h"

#include <algorithm>
#include <cmath>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "geometry/vector3.h"
#include "odometry/adjust.h"
#include "odometry/adjust_segment.h"
#include "odometry/fit_pose.h"
#include "odometry/loop.h"
#include "odometry/map_check.h"
#include "odometry/metric.h"
#include "odometry/still.h"
#include "odometry/track.h"
#include "pipeline/context.h"
#include "twoview/match.h"
#include "twoview/triangulate.h"

namespace tv {
namespace {

constexpr tv_odometry_options kDefaults = {
    sizeof(tv_odometry_options), 1000, 200, 20000, 10, TV_KERNELS_AUTO, 20130814, 1, 0};
// So many times the keypoints of a frame are points of the map that one frame is matched with.
constexpr int32_t kMatchedFrames = 3;
constexpr size_t kOdometryBytes = 4096;  // with 64-bit and with 32-bit pointers alike
static_assert(sizeof(tv_odometry) <= kOdometryBytes);

struct Plan {
  tv_camera camera;
  tv_odometry_options options;
  tv_limits limits;
  size_t context_bytes;
  int32_t columns, rows;
  MapSizes sizes;
  int32_t still_columns, still_rows;
  size_t scratch_bytes;  // beside the context's, which adjust_segment takes, too
  size_t num_bytes;      // of all
};

void make_frame(const Plan& plan, Arena& arena, Frame* frame) {
  const size_t n = static_cast<size_t>(plan.options.max_keypoints);
  const size_t cells = static_cast<size_t>(plan.columns) * static_cast<size_t>(plan.rows);
  frame->keypoints = arena_alloc<tv_keypoint>(arena, n);
  frame->descriptors = arena_alloc<uint8_t>(arena, n * TV_DESCRIPTOR_BYTES);
  frame->points = arena_alloc<int32_t>(arena, n);
  frame->distances = arena_alloc<int32_t>(arena, n);
  frame->cell_items = arena_alloc<int32_t>(arena, n);
  frame->sigmas = arena_alloc<float>(arena, n);
  frame->greys = arena_alloc<uint8_t>(arena, n);
  frame->cell_starts = arena_alloc<int32_t>(arena, cells + 1);
}

size_t frame_bytes(const Plan& plan) {
  Frame frame;
  Arena arena = measuring_arena();
  make_frame(plan, arena, &frame);
  return arena.used_bytes;
}

constexpr int kNumFrames = 2 + kNumStarts;

size_t local_points_bytes(const Plan& plan) {
  return arena_bytes<int32_t>(static_cast<size_t>(plan.limits.max_keypoints));
}

size_t num_still_cells(const Plan& plan) {
  return static_cast<size_t>(plan.still_columns) * static_cast<size_t>(plan.still_rows);
}

size_t still_cells_bytes(const Plan& plan) { return arena_bytes<StillCell>(num_still_cells(plan)); }

void measure_plan(Plan* plan) {
  const size_t segment = adjust_segment_bytes(plan->options);
  const size_t shared = plan->context_bytes - kContextBytes;
  // extract_frame takes a mask of the picture's size.
  const size_t mask = arena_bytes<uint8_t>(static_cast<size_t>(plan->camera.width) *
                                           static_cast<size_t>(plan->camera.height));
  plan->scratch_bytes =
      std::max(std::max(scratch_bytes(plan->options), mask), segment - std::min(segment, shared));
  plan->num_bytes = kOdometryBytes + arena_bytes<uint8_t>(plan->context_bytes) +
                    map_bytes(plan->sizes) + kNumFrames * frame_bytes(*plan) +
                    local_points_bytes(*plan) + still_cells_bytes(*plan) +
                    arena_bytes<uint8_t>(plan->scratch_bytes);
}

tv_status make_plan(const tv_camera* camera, const tv_odometry_options* options, Plan* plan) {
  tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  plan->camera = *camera;
  plan->options = kDefaults;
  status = read_sized(options, &plan->options);
  if (status != TV_OK) return status;
  const tv_odometry_options& o = plan->options;
  if (!within(o.max_keypoints, 100, 4096) || !within(o.max_keyframes, 8, 2000) ||
      !within(o.max_points, 500, 200000) || !within(o.window, 3, 20) ||
      !within(o.kernels, TV_KERNELS_AUTO, TV_KERNELS_NEON) || !within(o.correct_camera, 0, 1) ||
      o.reserved != 0 || !within(camera->width, 32, 16384) || !within(camera->height, 32, 16384)) {
    return TV_ERR_ARGUMENT;
  }
  tv_limits_init(&plan->limits);
  plan->limits.max_width = camera->width;
  plan->limits.max_height = camera->height;
  plan->limits.max_keypoints = kMatchedFrames * o.max_keypoints;
  plan->limits.max_matches = o.max_keypoints;
  plan->limits.kernels = o.kernels;
  plan->limits.purposes = TV_PURPOSE_EXTRACT | TV_PURPOSE_MATCH | TV_PURPOSE_ESTIMATE;
  plan->columns = (camera->width + kCellPx - 1) / kCellPx;
  plan->rows = (camera->height + kCellPx - 1) / kCellPx;
  plan->still_columns = (camera->width + kStillCellPx - 1) / kStillCellPx;
  plan->still_rows = (camera->height + kStillCellPx - 1) / kStillCellPx;
  plan->sizes = {o.max_keypoints, o.max_keyframes, o.max_points};
  status = tv_context_size(&plan->limits, &plan->context_bytes);
  if (status == TV_OK) measure_plan(plan);
  return status;
}

// Each argument of a frame has a status of its own.
tv_status check_frame_image(const tv_odometry& odometry, const tv_image& image) {
  const tv_status status = check_camera_image(odometry.camera.model, image);
  return status == TV_ERR_ARGUMENT ? TV_ERR_STRIDE : status;
}

// mask: null, or with pixels.
tv_status check_frame_mask(const tv_image* mask, const tv_image& image) {
  const tv_status status = check_mask(mask, image);
  return status == TV_ERR_ARGUMENT ? TV_ERR_MASK : status;
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

void start_anew(tv_odometry* o) {
  o->camera = prepare_camera(o->given_camera);
  o->camera_evidence = CameraEvidence{};
  clear_map(&o->map);
  o->num_starts = o->num_local_points = 0;
  std::fill_n(o->still_cells, o->still_columns * o->still_rows, StillCell{});
  o->still_until = 0;
  o->unadjusted_id = o->reference_id = o->confirmed_id = -1;
  o->doubts = 0;
  o->doubtful_segment = -1;
  o->weak_loop.frame = -1;
  o->spread = {0, o->map.sizes.max_points, 0, 0, 0};
  o->took_step = false;
  o->check = MapCheck{};
  o->has_motion = false;
  o->num_frames = o->segment = o->num_segments = o->other_segment = 0;
  o->num_relocations = o->num_loops = o->lost_frames = o->turned_frames = o->next_search =
      o->next_loop = 0;
  o->status = TV_ODOMETRY_STARTING;
  o->frame.has_pose = o->previous.has_pose = false;
  o->frame.num = o->previous.num = 0;
  o->median_depth = 1;
  o->turn_sigma = o->drift_sq = 0;
  o->is_upright = o->is_found_again = o->was_moved_far = false;
  o->velocity_trust = o->num_contrary = 0;
  o->scale = o->other_scale = MetricScale{};
  o->last_time_s = o->most_m = 0;
}

void enter_segment(tv_odometry* o, int32_t segment) {
  if (segment != o->segment) change_scale(o, o->segment, segment);
  o->segment = segment;
  o->is_upright = is_upright(o->map, segment);
}

// The window that adjust_around and the start's adjustment take has 4 KB for each keypoint and 5
// bytes for each point of the map. No other stage takes a fifth of that, so what is added here is
// what lies beside a window, and what the other stages take for each point and keyframe:
// keypoints: 76 bytes (start.cc: the matches of a pair, the pair, and its inliers as matches) and a
// PoseFit; keyframes: 120 (close_loop); points: 8, where there is no window (rank_points).
size_t scratch_bytes(const tv_odometry_options& o) {
  return adjust_bytes(o) + 128 * static_cast<size_t>(o.max_keypoints + o.max_keyframes) +
         4 * static_cast<size_t>(o.max_points);
}

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
  tv::Plan plan;
  const tv_status status = tv::make_plan(camera, options, &plan);
  if (status != TV_OK) return status;
  if (size_bytes == nullptr) return TV_ERR_NULL;
  *size_bytes = plan.num_bytes;
  return TV_OK;
}

tv_status tv_odometry_init(tv_odometry** odometry, const tv_camera* camera,
                           const tv_odometry_options* options, void* memory, size_t size_bytes) {
  tv::Plan plan;
  tv_status status = tv::make_plan(camera, options, &plan);
  if (status != TV_OK) return status;
  if (odometry == nullptr || memory == nullptr) return TV_ERR_NULL;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < plan.num_bytes) return TV_ERR_MEMORY;
  tv_odometry* o = static_cast<tv_odometry*>(memory);
  *o = tv_odometry{};
  tv::Arena arena = tv::arena_over(static_cast<uint8_t*>(memory) + tv::kOdometryBytes,
                                   plan.num_bytes - tv::kOdometryBytes);
  status = tv_context_init(&o->context, &plan.limits,
                           tv::arena_alloc<uint8_t>(arena, plan.context_bytes), plan.context_bytes);
  if (status != TV_OK) return status;
  const size_t scratch = plan.scratch_bytes;
  o->scratch = tv::arena_over(tv::arena_alloc<uint8_t>(arena, scratch), scratch);
  // They follow each other.
  uint8_t* begin = o->context->arena.memory;
  o->whole_scratch =
      tv::arena_over(begin, static_cast<size_t>(o->scratch.memory + scratch - begin));
  o->kernels = o->context->kernels;
  o->max_matched = plan.limits.max_keypoints;
  o->options = plan.options;
  o->options.struct_size = sizeof(tv_odometry_options);
  o->given_camera = tv::prepare_camera(plan.camera).model;
  tv_feature_options_init(&o->features);
  o->features.max_keypoints = plan.options.max_keypoints;
  // Measured on the sequences: docs/algorithms/odometry.md.
  o->features.arc = 9;
  o->features.cell_px = 32;
  o->grid_columns = plan.columns;
  o->grid_rows = plan.rows;
  o->still_columns = plan.still_columns;
  o->still_rows = plan.still_rows;
  o->still_cells = tv::arena_alloc<tv::StillCell>(arena, tv::num_still_cells(plan));
  tv::make_map(plan.sizes, arena, &o->map);
  tv::make_frame(plan, arena, &o->frame);
  tv::make_frame(plan, arena, &o->previous);
  for (tv::Frame& frame : o->starts) tv::make_frame(plan, arena, &frame);
  o->local_points = tv::arena_alloc<int32_t>(arena, static_cast<size_t>(plan.limits.max_keypoints));
  tv::start_anew(o);
  *odometry = o;
  return TV_OK;
}

tv_status tv_odometry_reset(tv_odometry* odometry) {
  if (odometry == nullptr) return TV_ERR_NULL;
  tv::start_anew(odometry);
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
  tv::finish_map(odometry);
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
  int32_t id = reference_id;
  int32_t k = tv::find_keyframe(map, id);
  // A removed keyframe leads to a kept one in one step, in maps of earlier versions in several.
  for (int32_t steps = 0; k < 0 && steps <= map.num_removed; ++steps) {
    int32_t n = 0;
    while (n < map.num_removed && map.removed[n].id != id) ++n;
    if (n == map.num_removed) return TV_ERR_ARGUMENT;
    tv::scale_by(map.removed[n].scale, pose.t);
    pose = tv::compose(map.removed[n].kept_from_removed, pose);
    id = map.removed[n].kept_id;
    k = tv::find_keyframe(map, id);
  }
  if (k < 0) return TV_ERR_ARGUMENT;
  tv::scale_by(map.keyframes[k].scale, pose.t);
  pose = tv::compose(tv::inverse(map.keyframes[k].cam_from_world), pose);
  tv::write_rigid(pose, R, t);
  if (segment != nullptr) *segment = map.keyframes[k].segment;
  return TV_OK;
}
