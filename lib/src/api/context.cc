// The entry points of the context: its limits, its size, its kernels, its memory and its times.
#include "pipeline/context.h"

#include <algorithm>

#include "api/sized.h"
#include "api/within.h"
#include "feature/tilts.h"
#include "pipeline/pair_arrays.h"
#include "pipeline/scratch.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr int32_t kMaxKeypoints = 65535;
constexpr int32_t kMaxMatches = 1000000;
constexpr uint32_t kAllPurposes = 2 * TV_PURPOSE_ABSOLUTE_POSE - 1;

constexpr tv_limits kDefaults = {sizeof(tv_limits), 640, 480, 2048, 0, TV_KERNELS_AUTO, 0, 0};

// Reads the limits, and resolves max_matches 0 and purposes 0.
tv_status read_limits(const tv_limits* given, tv_limits* limits) {
  if (given == nullptr) return TV_ERR_NULL;
  *limits = kDefaults;
  const tv_status status = read_sized(given, limits);
  if (status != TV_OK) return status;
  if (!within(limits->max_width, 1, kMaxSide) || !within(limits->max_height, 1, kMaxSide) ||
      !within(limits->max_keypoints, 1, kMaxKeypoints) ||
      !within(limits->max_matches, 0, kMaxMatches) ||
      !within(limits->kernels, TV_KERNELS_AUTO, TV_KERNELS_NEON) ||
      limits->purposes > kAllPurposes || !within(limits->max_effort, 0, kMaxEffort)) {
    return TV_ERR_ARGUMENT;
  }
  if (limits->max_matches == 0) limits->max_matches = limits->max_keypoints;
  if (limits->purposes == 0) limits->purposes = kAllPurposes;
  if ((limits->purposes & TV_PURPOSE_RECONSTRUCT & ~7u) != 0) {  // tv_reconstruct's own bit
    limits->purposes |= TV_PURPOSE_RECONSTRUCT;
  } else {
    limits->max_effort = 0;
  }
  return TV_OK;
}

}  // namespace
}  // namespace tv

void tv_limits_init_sized(tv_limits* limits, size_t struct_size) {
  tv::init_sized(limits, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_context_size(const tv_limits* limits, size_t* size_bytes) {
  tv_limits read;
  const tv_status status = tv::read_limits(limits, &read);
  if (status != TV_OK) return status;
  if (size_bytes == nullptr) return TV_ERR_NULL;
  *size_bytes = tv::kContextBytes + tv::scratch_bytes(read);
  return TV_OK;
}

tv_status tv_context_init(tv_context** context, const tv_limits* limits, void* memory,
                          size_t size_bytes) {
  tv_limits read;
  const tv_status status = tv::read_limits(limits, &read);
  if (status != TV_OK) return status;
  const size_t needed = tv::kContextBytes + tv::scratch_bytes(read);
  if (context == nullptr || memory == nullptr) return TV_ERR_NULL;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < needed) return TV_ERR_MEMORY;
  const tvk_set* kernels = tvk_select(read.kernels);
  if (kernels == nullptr) return TV_ERR_KERNELS;
  tv_context* made = static_cast<tv_context*>(memory);
  *made = tv_context{};
  made->limits = read;
  made->kernels = kernels;
  made->most_keypoints = tv::most_keypoints(read);
  made->arena =
      tv::arena_over(static_cast<uint8_t*>(memory) + tv::kContextBytes, needed - tv::kContextBytes);
  *context = made;
  return TV_OK;
}

tv_kernels tv_context_kernels(const tv_context* context) {
  return context == nullptr ? TV_KERNELS_AUTO : static_cast<tv_kernels>(context->kernels->id);
}

size_t tv_context_high_water(const tv_context* context) {
  return context == nullptr ? 0 : tv::kContextBytes + context->arena.high_water_bytes;
}

tv_status tv_context_set_clock(tv_context* context, tv_clock now_ns, void* user) {
  if (context == nullptr) return TV_ERR_NULL;
  context->clock = now_ns;
  context->clock_user = user;
  return TV_OK;
}

tv_status tv_context_take_times(tv_context* context, uint64_t* stage_ns, int32_t cap_stages) {
  if (context == nullptr || (stage_ns == nullptr && cap_stages > 0)) return TV_ERR_NULL;
  if (cap_stages < 0) return TV_ERR_ARGUMENT;
  for (int32_t k = 0; k < cap_stages; ++k) {
    stage_ns[k] = k < TV_NUM_STAGES ? context->stage_ns[k] : 0;
  }
  std::fill(context->stage_ns, context->stage_ns + TV_NUM_STAGES, uint64_t{0});
  return TV_OK;
}
