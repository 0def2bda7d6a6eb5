#include "odometry/memory.h"

#include <algorithm>

#include "odometry/adjust.h"
#include "odometry/adjust_segment.h"

namespace tv {
namespace {

// One frame is matched with at most this many times as many points of the map as it has keypoints.
constexpr int32_t kMatchedFrames = 3;
constexpr size_t kOdometryBytes = 4096;  // with 64-bit and with 32-bit pointers alike
static_assert(sizeof(Odometry) <= kOdometryBytes);

// Cells of this side that cover the camera's picture.
struct Grid {
  int32_t columns, rows;
};

Grid grid_over(const tv_camera& camera, int32_t cell_px) {
  return {(camera.width + cell_px - 1) / cell_px, (camera.height + cell_px - 1) / cell_px};
}

size_t num_cells(const Grid& grid) {
  return static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows);
}

void take_frame(const MemoryPlan& plan, Arena& arena, Frame* frame) {
  const size_t n = static_cast<size_t>(plan.options.max_keypoints);
  frame->keypoints = arena_alloc<tv_keypoint>(arena, n);
  frame->descriptors = arena_alloc<uint8_t>(arena, n * TV_DESCRIPTOR_BYTES);
  frame->points = arena_alloc<int32_t>(arena, n);
  frame->distances = arena_alloc<int32_t>(arena, n);
  frame->cell_items = arena_alloc<int32_t>(arena, n);
  frame->sigmas = arena_alloc<float>(arena, n);
  frame->greys = arena_alloc<uint8_t>(arena, n);
  frame->cell_starts = arena_alloc<int32_t>(arena, num_cells(grid_over(plan.camera, kCellPx)) + 1);
}

// Takes the arrays of the map and of the frames.
void take_arrays(const MemoryPlan& plan, Arena& arena, Odometry* odometry) {
  const tv_odometry_options& o = plan.options;
  odometry->still_cells =
      arena_alloc<StillCell>(arena, num_cells(grid_over(plan.camera, kStillCellPx)));
  make_map({o.max_keypoints, o.max_keyframes, o.max_points}, arena, &odometry->map);
  take_frame(plan, arena, &odometry->frame);
  take_frame(plan, arena, &odometry->previous);
  for (Frame& frame : odometry->starts) take_frame(plan, arena, &frame);
  odometry->local_points =
      arena_alloc<int32_t>(arena, static_cast<size_t>(plan.limits.max_keypoints));
}

size_t arrays_bytes(const MemoryPlan& plan) {
  Odometry odometry;
  Arena arena = measuring_arena();
  take_arrays(plan, arena, &odometry);
  return arena.used_bytes;
}

// The window that adjust_around and the start's adjustment take has 4 KB for each keypoint and 5
// bytes for each point of the map. No other stage takes a fifth of that, so what is added here is
// what lies beside a window, and what the other stages take for each point and keyframe:
// keypoints: 76 bytes (start.cc: the matches of a pair, the pair, and its inliers as matches) and a
// PoseFit; keyframes: 120 (close_loop); points: 8, where there is no window (rank_points).
size_t stages_bytes(const tv_odometry_options& o) {
  return adjust_bytes(o) + 128 * static_cast<size_t>(o.max_keypoints + o.max_keyframes) +
         4 * static_cast<size_t>(o.max_points);
}

}  // namespace

tv_limits context_limits(const tv_camera& camera, const tv_odometry_options& options) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = camera.width;
  limits.max_height = camera.height;
  limits.max_keypoints = kMatchedFrames * options.max_keypoints;
  limits.max_matches = options.max_keypoints;
  limits.kernels = options.kernels;
  limits.purposes = TV_PURPOSE_EXTRACT | TV_PURPOSE_MATCH | TV_PURPOSE_ESTIMATE;
  return limits;
}

void measure_memory(MemoryPlan* plan) {
  const size_t segment = adjust_segment_bytes(plan->options);
  // extract_frame takes a mask of the picture's size.
  const size_t mask = arena_bytes<uint8_t>(static_cast<size_t>(plan->camera.width) *
                                           static_cast<size_t>(plan->camera.height));
  plan->scratch_bytes = std::max(std::max(stages_bytes(plan->options), mask),
                                 segment - std::min(segment, plan->shared_bytes));
  plan->num_bytes = kOdometryBytes + arena_bytes<uint8_t>(plan->context_bytes) +
                    arrays_bytes(*plan) + arena_bytes<uint8_t>(plan->scratch_bytes);
}

Odometry* lay_out(const MemoryPlan& plan, void* memory, uint8_t** context_memory) {
  Odometry* o = static_cast<Odometry*>(memory);
  *o = Odometry{};
  Arena arena =
      arena_over(static_cast<uint8_t*>(memory) + kOdometryBytes, plan.num_bytes - kOdometryBytes);
  *context_memory = arena_alloc<uint8_t>(arena, plan.context_bytes);
  o->scratch = arena_over(arena_alloc<uint8_t>(arena, plan.scratch_bytes), plan.scratch_bytes);
  // The end of the context's memory and the scratch memory follow each other, so that together they
  // are one block.
  uint8_t* begin = *context_memory + (plan.context_bytes - plan.shared_bytes);
  uint8_t* end = o->scratch.memory + plan.scratch_bytes;
  o->whole_scratch = arena_over(begin, static_cast<size_t>(end - begin));
  take_arrays(plan, arena, o);
  o->max_matched = plan.limits.max_keypoints;
  o->options = plan.options;
  o->options.struct_size = sizeof(tv_odometry_options);
  o->given_camera = prepare_camera(plan.camera).model;
  tv_feature_options_init(&o->features);
  o->features.max_keypoints = plan.options.max_keypoints;
  // Measured on the sequences: docs/algorithms/odometry.md.
  o->features.arc = 9;
  o->features.cell_px = 32;
  const Grid cells = grid_over(plan.camera, kCellPx);
  const Grid still_cells = grid_over(plan.camera, kStillCellPx);
  o->grid_columns = cells.columns;
  o->grid_rows = cells.rows;
  o->still_columns = still_cells.columns;
  o->still_rows = still_cells.rows;
  return o;
}

}  // namespace tv
