/* twoview: what every function returns, and how a symbol is exported. */
#ifndef TWOVIEW_STATUS_H
#define TWOVIEW_STATUS_H

#include "twoview/version.h"

#if defined(__GNUC__)
/* Marks what the shared library exports; everything else in it is hidden. */
#define TV_API __attribute__((visibility("default")))
#else
#define TV_API
#endif

#ifdef __cplusplus
/* From here on names are C's, in C++ too. */
#define TV_BEGIN_DECLS extern "C" {
/* Up to here. */
#define TV_END_DECLS }
#else
#define TV_BEGIN_DECLS
#define TV_END_DECLS
#endif

TV_BEGIN_DECLS

/* A caller's mistake or a buffer that is too small is an error; "no geometry in these images" is a
   result (see two_view.h). On any error the outputs are as they were, but for a size or count that
   the function says it writes. Values are stable across releases of one major version. */
typedef enum tv_status {
  TV_OK = 0,              /* done; also when the answer is that there is no geometry */
  TV_ERR_NULL = 1,        /* a required pointer is null */
  TV_ERR_ARGUMENT = 2,    /* a value is out of its documented range */
  TV_ERR_NOT_FINITE = 3,  /* NaN or infinity where a finite number is required */
  TV_ERR_STRUCT_SIZE = 4, /* struct_size was not set by tv_..._init, or is from a newer header */
  TV_ERR_ALIGNMENT = 5,   /* memory is not aligned to TV_CONTEXT_ALIGNMENT */
  TV_ERR_MEMORY = 6,      /* the memory handed over is smaller than tv_context_size says */
  TV_ERR_LIMITS = 7,      /* an image or a count is above the context's limits, or the
                             context was not made for this call (tv_purpose) */
  TV_ERR_CAPACITY = 8,    /* an output array is too small; the count needed was written */
  TV_ERR_OVERLAP = 9,     /* an output array overlaps another argument */
  TV_ERR_CAMERA = 10,     /* intrinsics that are zero, not finite, or of an unknown model */
  TV_ERR_OUTSIDE = 11,    /* a pixel or a ray outside the lens model's valid region */
  TV_ERR_KERNELS = 12     /* this CPU or this build lacks the kernel set that was asked for */
} tv_status;

/* A short English phrase for a status; "unknown status" for any other number. Static storage.
   Thread-safe. */
TV_API const char *tv_status_string(tv_status status);

/* TV_VERSION_STRING of the library that is linked (the header's may be another). Static storage. */
TV_API const char *tv_version_string(void);

TV_END_DECLS

#endif
