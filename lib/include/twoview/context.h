/* twoview: the context, all the memory the library ever uses.

   Ask for the size, hand the memory over, call. There is nothing to destroy: when the caller's
   memory goes, the context is gone. The library takes no heap, starts no thread, keeps no mutable
   globals; use one context per thread. */
#ifndef TWOVIEW_CONTEXT_H
#define TWOVIEW_CONTEXT_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/status.h"

TV_BEGIN_DECLS

/* All that the library keeps between calls and needs within them. One thread at a time. */
typedef struct tv_context tv_context;

/* The memory of a context starts at a multiple of this many bytes. */
#define TV_CONTEXT_ALIGNMENT 64

/* Which build of the kernels (kernels.h of the source) a context runs. Every set gives the same
   bytes; they differ in speed only. */
typedef enum tv_kernels {
  TV_KERNELS_AUTO = 0, /* the fastest that this CPU and this build have */
  TV_KERNELS_C = 1,    /* portable C, the definition of the others */
  TV_KERNELS_SSE2 = 2,   /* every x86-64 */
  TV_KERNELS_AVX2 = 3,   /* x86-64 from Haswell and Excavator on */
  TV_KERNELS_AVX512 = 4, /* x86-64 with F, BW, VL and VNNI */
  TV_KERNELS_NEON = 5    /* aarch64, and armv7 with NEON */
} tv_kernels;

/* What a context may be asked for: bits of tv_limits.purposes. Memory is needed for the purposes that
   are named alone; a call that the context was not made for returns TV_ERR_LIMITS. Calls without a
   context, or that are not named here, need no purpose. */
typedef enum tv_purpose {
  /* tv_detect, tv_orient, tv_describe, tv_extract. */
  TV_PURPOSE_EXTRACT = 1 << 0,
  /* tv_match. */
  TV_PURPOSE_MATCH = 1 << 1,
  /* tv_estimate_two_view. */
  TV_PURPOSE_ESTIMATE = 1 << 2,
  /* tv_reconstruct: the three above, and room for its result. */
  TV_PURPOSE_RECONSTRUCT = 1 << 3 | 7,
  /* tv_match_guided, and tv_reconstruct with guided_matching. */
  TV_PURPOSE_MATCH_GUIDED = 1 << 4,
  /* tv_adjust_two_view, and tv_reconstruct with bundle_adjustment. */
  TV_PURPOSE_ADJUST = 1 << 5
} tv_purpose;

/* What a context is made for. Filled by tv_limits_init; change a field before tv_context_size. */
typedef struct tv_limits {
  uint32_t struct_size;  /* set by tv_limits_init */
  int32_t max_width;     /* pixels, [1, 16384], default 640 */
  int32_t max_height;    /* pixels, [1, 16384], default 480 */
  int32_t max_keypoints; /* descriptors an image, [1, 65535], default 2048 */
  int32_t max_matches;   /* matches an estimate, [1, 1000000]; 0 (default) means max_keypoints */
  int32_t kernels;       /* a tv_kernels, default TV_KERNELS_AUTO */
  /* tv_purpose bits: the calls that the context has memory for; 0 (default): all. */
  uint32_t purposes;
} tv_limits;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tv_limits_init(tv_limits *limits);

/* Writes to *size_bytes what a context with these limits needs. The figure depends on nothing
   but the limits and the library's version.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (a limit out of range). */
TV_API tv_status tv_context_size(const tv_limits *limits, size_t *size_bytes);

/* Makes a context in `memory`, which the caller owns, keeps in place, and frees after the last call
   with *context. `memory` is aligned to TV_CONTEXT_ALIGNMENT and at least the tv_context_size of
   the same limits.
   Returns also TV_ERR_ALIGNMENT, TV_ERR_MEMORY, TV_ERR_KERNELS; *context is written on TV_OK only. */
TV_API tv_status tv_context_init(tv_context **context, const tv_limits *limits, void *memory,
                                 size_t size_bytes);

/* The set that the context runs, never TV_KERNELS_AUTO; TV_KERNELS_AUTO for a null context. */
TV_API tv_kernels tv_context_kernels(const tv_context *context);

/* "auto", "c", "sse2", "avx2", "avx512", "neon"; "unknown" for any other number. Static storage. */
TV_API const char *tv_kernels_string(tv_kernels kernels);

/* The most bytes of the context's memory that any call so far has used; 0 for a null context. */
TV_API size_t tv_context_high_water(const tv_context *context);

/* Where the time goes. The library reads no clock; a caller who wants stage times lends it one that
   returns nanoseconds from any fixed origin. */
typedef uint64_t (*tv_clock)(void *user);

/* Lends the context a clock, called from within its calls with `user`; both are the caller's and live as
   long as the context. A null clock takes it away again. Returns TV_ERR_NULL. */
TV_API tv_status tv_context_set_clock(tv_context *context, tv_clock now_ns, void *user);

/* Where the time of a call goes; indices of tv_context_take_times. */
typedef enum tv_stage {
  TV_STAGE_PYRAMID = 0,  /* levels and octaves of the image */
  TV_STAGE_DETECT = 1,   /* corners */
  TV_STAGE_DESCRIBE = 2, /* orientation and descriptor */
  TV_STAGE_MATCH = 3,    /* both directions, and guided matching */
  TV_STAGE_ESTIMATE = 4, /* the robust loop */
  TV_STAGE_REFINE = 5,   /* refinement on all inliers, rival models, verdict, covariance;
                            bundle adjustment */
  TV_STAGE_TRIANGULATE = 6, /* tv_reconstruct's points */
  TV_NUM_STAGES = 7      /* how many there are */
} tv_stage;

/* Writes the nanoseconds spent in each stage since the last call of this function (or init), all 0
   without a clock, and starts again from 0. stage_ns holds TV_NUM_STAGES values. Returns TV_ERR_NULL. */
TV_API tv_status tv_context_take_times(tv_context *context, uint64_t *stage_ns);

TV_END_DECLS

#endif
