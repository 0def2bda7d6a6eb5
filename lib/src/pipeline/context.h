// The members of tv_context, and the timer that measures a stage. The struct lies at the front of
// the caller's memory; the arena is the rest.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/context.h"

struct tv_context {
  tv_limits limits;  // max_matches and purposes are resolved, never 0; max_effort, too
  const tvk_set* kernels;
  tv::Arena arena;  // scratch of the running call; after tv_reconstruct its front holds the results
  int32_t most_keypoints;  // of an image: those of the highest rung of effort
  tv_clock clock;
  void* clock_user;
  uint64_t stage_ns[TV_NUM_STAGES];
};

namespace tv {

// The size of a tv_context with 64-bit pointers, before its arena. CPUs with 32-bit pointers
// reserve as much, because tv_context_size depends on the limits alone.
inline constexpr size_t kContextBytes = 192;
static_assert(arena_bytes<tv_context>(1) <= kContextBytes &&
              (sizeof(void*) < 8 || arena_bytes<tv_context>(1) == kContextBytes));

// Whether the context has the memory for calls of all these purposes (TV_PURPOSE_ bits).
inline bool made_for(const tv_context& context, uint32_t purposes) {
  return (context.limits.purposes & purposes) == purposes;
}

// The caller's clock, or 0 where there is none.
inline uint64_t clock_ns(const tv_context& context) {
  return context.clock != nullptr ? context.clock(context.clock_user) : 0;
}

// Adds the time from its construction to its destruction to the time of a stage.
class StageTimer {
 public:
  StageTimer(tv_context* context, tv_stage stage)
      : context_(context), stage_(stage), start_ns_(clock_ns(*context)) {}
  ~StageTimer() { context_->stage_ns[stage_] += clock_ns(*context_) - start_ns_; }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  tv_context* context_;
  tv_stage stage_;
  uint64_t start_ns_;
};

}  // namespace tv
