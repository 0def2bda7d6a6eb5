#include "api/context.h"

#include <algorithm>

#include "api/scratch.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr int32_t kMaxKeypoints = 65535;
constexpr int32_t kMaxMatches = 1000000;
constexpr uint32_t kAllPurposes = 2 * TV_PURPOSE_ADJUST - 1;

bool within(int32_t value, int32_t low, int32_t high) { return value >= low && value <= high; }

tv_status check_limits(const tv_limits* limits) {
  if (limits == nullptr) return TV_ERR_NULL;
  if (limits->struct_size != sizeof(tv_limits)) return TV_ERR_STRUCT_SIZE;
  if (!within(limits->max_width, 1, kMaxSide) || !within(limits->max_height, 1, kMaxSide) ||
      !within(limits->max_keypoints, 1, kMaxKeypoints) ||
      !within(limits->max_matches, 0, kMaxMatches) ||
      !within(limits->kernels, TV_KERNELS_AUTO, TV_KERNELS_NEON) ||
      limits->purposes > kAllPurposes) {
    return TV_ERR_ARGUMENT;
  }
  return TV_OK;
}

tv_limits resolved(const tv_limits& limits) {
  tv_limits result = limits;
  if (result.max_matches == 0) result.max_matches = result.max_keypoints;
  if (result.purposes == 0) result.purposes = kAllPurposes;
  return result;
}

// A tv_context of 64-bit pointers. The size depends on the limits alone, so 32-bit CPUs take as
// much.
constexpr size_t kContextBytes = 192;
static_assert(arena_bytes<tv_context>(1) <= kContextBytes &&
              (sizeof(void*) < 8 || arena_bytes<tv_context>(1) == kContextBytes));

size_t context_bytes() { return kContextBytes; }

}  // namespace
}  // namespace tv

void tv_limits_init(tv_limits* limits) {
  if (limits == nullptr) return;
  *limits = tv_limits{sizeof(tv_limits), 640, 480, 2048, 0, TV_KERNELS_AUTO, 0};
}

tv_status tv_context_size(const tv_limits* limits, size_t* size_bytes) {
  const tv_status status = tv::check_limits(limits);
  if (status != TV_OK) return status;
  if (size_bytes == nullptr) return TV_ERR_NULL;
  *size_bytes = tv::context_bytes() + tv::scratch_bytes(tv::resolved(*limits));
  return TV_OK;
}

tv_status tv_context_init(tv_context** context, const tv_limits* limits, void* memory,
                          size_t size_bytes) {
  size_t needed = 0;
  const tv_status status = tv_context_size(limits, &needed);
  if (status != TV_OK) return status;
  if (context == nullptr || memory == nullptr) return TV_ERR_NULL;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < needed) return TV_ERR_MEMORY;
  const tvk_table* kernels = tvk_select(limits->kernels);
  if (kernels == nullptr) return TV_ERR_KERNELS;
  tv_context* made = static_cast<tv_context*>(memory);
  *made = tv_context{};
  made->limits = tv::resolved(*limits);
  made->kernels = kernels;
  made->arena = tv::arena_over(static_cast<uint8_t*>(memory) + tv::context_bytes(),
                               needed - tv::context_bytes());
  *context = made;
  return TV_OK;
}

tv_kernels tv_context_kernels(const tv_context* context) {
  return context == nullptr ? TV_KERNELS_AUTO : static_cast<tv_kernels>(context->kernels->set);
}

size_t tv_context_high_water(const tv_context* context) {
  return context == nullptr ? 0 : tv::context_bytes() + context->arena.high_water_bytes;
}

tv_status tv_context_set_clock(tv_context* context, tv_clock now_ns, void* user) {
  if (context == nullptr) return TV_ERR_NULL;
  context->clock = now_ns;
  context->clock_user = user;
  return TV_OK;
}

tv_status tv_context_take_times(tv_context* context, uint64_t* stage_ns) {
  if (context == nullptr || stage_ns == nullptr) return TV_ERR_NULL;
  std::copy(context->stage_ns, context->stage_ns + TV_NUM_STAGES, stage_ns);
  std::fill(context->stage_ns, context->stage_ns + TV_NUM_STAGES, uint64_t{0});
  return TV_OK;
}
