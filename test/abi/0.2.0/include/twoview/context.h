/* twoview: the context, which is all the memory that the library uses.

   A program asks for the size, hands the memory over and makes its calls. Nothing is to be
   destroyed afterwards: the context ends when the caller frees its memory. The library takes no
   heap, starts no thread and keeps no mutable global state. */
#ifndef TWOVIEW_CONTEXT_H
#define TWOVIEW_CONTEXT_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/status.h"

TV_BEGIN_DECLS

/* The memory that the library works in. One thread uses a context at a time; each thread of a
   program has a context of its own. */
typedef struct tv_context tv_context;

/* The memory of a context starts at an address that is a multiple of this many bytes. */
#define TV_CONTEXT_ALIGNMENT 64

/* A kernel set: the same inner loops, compiled for one instruction set. All sets give the same
   bytes and differ in speed only. */
typedef enum tv_kernels {
  /* The fastest set that this CPU and this build of the library have. */
  TV_KERNELS_AUTO = 0,
  /* Portable C, the definition that all other sets are tested against. */
  TV_KERNELS_C = 1,
  /* SSE2: every x86-64 CPU. */
  TV_KERNELS_SSE2 = 2,
  /* AVX2: x86-64 from Intel Haswell and AMD Excavator on. */
  TV_KERNELS_AVX2 = 3,
  /* AVX-512: x86-64 with the extensions F, BW, VL and VNNI. */
  TV_KERNELS_AVX512 = 4,
  /* NEON: every aarch64 CPU, and armv7 CPUs that have NEON. */
  TV_KERNELS_NEON = 5
} tv_kernels;

/* What a context is made for: bits of tv_limits.purposes. The context has memory for the calls of
   these purposes alone; every other call that takes a context and is listed here returns
   TV_ERR_LIMITS. Calls that are not listed need no purpose. */
typedef enum tv_purpose {
  /* tv_detect, tv_orient, tv_describe, tv_extract and tv_align_matches. */
  TV_PURPOSE_EXTRACT = 1 << 0,
  /* tv_match. */
  TV_PURPOSE_MATCH = 1 << 1,
  /* tv_estimate_two_view. */
  TV_PURPOSE_ESTIMATE = 1 << 2,
  /* tv_reconstruct. It includes the three purposes above. */
  TV_PURPOSE_RECONSTRUCT = 1 << 3 | 7,
  /* tv_match_guided, and tv_reconstruct with guided_matching. */
  TV_PURPOSE_MATCH_GUIDED = 1 << 4,
  /* tv_adjust_two_view, and tv_reconstruct with bundle_adjustment. */
  TV_PURPOSE_ADJUST = 1 << 5,
  /* tv_estimate_absolute_pose. */
  TV_PURPOSE_ABSOLUTE_POSE = 1 << 6
} tv_purpose;

/* The largest inputs that a context is made for. They decide how much memory it needs. Filled by
   tv_limits_init; change fields before tv_context_size. */
typedef struct tv_limits {
  /* The caller's sizeof, set by tv_limits_init. */
  uint32_t struct_size;
  /* The widest image in pixels, [1, 16384], default 640. */
  int32_t max_width;
  /* The highest image in pixels, [1, 16384], default 480. */
  int32_t max_height;
  /* The most keypoints of an image, second orientations included, [1, 65535], default 2048. */
  int32_t max_keypoints;
  /* The most matches of an estimate, and points of a bundle adjustment, [0, 1000000]; 0
     (default) means max_keypoints. */
  int32_t max_matches;
  /* A tv_kernels, default TV_KERNELS_AUTO. */
  int32_t kernels;
  /* Bits of tv_purpose: the calls that the context has memory for; 0 (default) means all of them.
     Fewer purposes need less memory. */
  uint32_t purposes;
  /* The highest rung of effort that tv_reconstruct may climb to
     (tv_reconstruct_options.effort and max_effort), [0, 3]; 0 (default): none but rung 0. The
     context then has memory for the keypoints of these rungs, at most 6.5 max_keypoints of an
     image, and as many may be given to tv_match and tv_match_guided. It counts only with
     TV_PURPOSE_RECONSTRUCT. */
  int32_t max_effort;
} tv_limits;

/* Writes the default limits into a struct of struct_size bytes; null is allowed. Programs call
   tv_limits_init. */
TV_API void tv_limits_init_sized(tv_limits *limits, size_t struct_size);
/* Writes the default limits; null is allowed. */
#define tv_limits_init(limits) tv_limits_init_sized((limits), sizeof *(limits))

/* Writes to *size_bytes how much memory a context with these limits needs. The number depends only
   on the limits and on the library's version, and not on the CPU.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (a limit is out of its range). */
TV_API tv_status tv_context_size(const tv_limits *limits, size_t *size_bytes);

/* Makes a context in `memory` of size_bytes bytes and writes a pointer to it to *context.
   memory: starts at a multiple of TV_CONTEXT_ALIGNMENT and is at least as large as tv_context_size
   reports for the same limits. The caller owns it, does not move it, and frees it after the last
   call with the context.
   Returns the statuses as tv_context_size does, and TV_ERR_ALIGNMENT, TV_ERR_MEMORY,
   TV_ERR_KERNELS. */
TV_API tv_status tv_context_init(tv_context **context, const tv_limits *limits, void *memory,
                                 size_t size_bytes);

/* Returns the kernel set that the context runs, which is never TV_KERNELS_AUTO; for a null context
   it returns TV_KERNELS_AUTO. */
TV_API tv_kernels tv_context_kernels(const tv_context *context);

/* Returns "auto", "c", "sse2", "avx2", "avx512" or "neon", or "unknown" for any other number. The
   string is constant and never freed. Thread-safe. */
TV_API const char *tv_kernels_string(tv_kernels kernels);

/* Returns the largest number of bytes of the context's memory that any call so far has used; 0 for
   a null context. */
TV_API size_t tv_context_high_water(const tv_context *context);

/* A clock of the caller: returns nanoseconds since any fixed moment. The library itself reads no
   clock. `user` is the pointer that was given to tv_context_set_clock. */
typedef uint64_t (*tv_clock)(void *user);

/* Gives the context a clock, so that it measures the time of each stage. The clock is called from
   within the library's calls with the pointer `user`; both stay valid as long as the context is
   used. A null now_ns removes the clock. Returns TV_ERR_NULL. */
TV_API tv_status tv_context_set_clock(tv_context *context, tv_clock now_ns, void *user);

/* A stage of the work, and the index of its time in the array of tv_context_take_times. */
typedef enum tv_stage {
  /* The pyramid of smaller images and the octaves. */
  TV_STAGE_PYRAMID = 0,
  /* Corner detection. */
  TV_STAGE_DETECT = 1,
  /* Orientations and descriptors. */
  TV_STAGE_DESCRIBE = 2,
  /* Matching in both directions, and guided matching. */
  TV_STAGE_MATCH = 3,
  /* The robust search for a model. */
  TV_STAGE_ESTIMATE = 4,
  /* Refinement on all inliers, the rival models, verdict and covariance; also bundle adjustment. */
  TV_STAGE_REFINE = 5,
  /* Triangulation of the points in tv_reconstruct. */
  TV_STAGE_TRIANGULATE = 6
} tv_stage;

/* How many stages this header knows. A newer library may measure more of them. */
#define TV_NUM_STAGES 7

/* Writes the nanoseconds spent in each stage since the previous call of this function (or since
   tv_context_init), and restarts all stages at 0. Without a clock all times are 0.
   stage_ns: room for cap_stages numbers, usually TV_NUM_STAGES. Entries beyond the stages that the
   library knows are set to 0; stages beyond cap_stages are not reported.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (cap_stages below 0). */
TV_API tv_status tv_context_take_times(tv_context *context, uint64_t *stage_ns, int32_t cap_stages);

TV_END_DECLS

#endif
