/* twoview: the status that functions return, how structs grow, and how a symbol is exported. */
#ifndef TWOVIEW_STATUS_H
#define TWOVIEW_STATUS_H

#include "twoview/version.h"

#if defined(__GNUC__)
/* Marks a function that the shared library exports; all other functions in it are hidden. */
#define TV_API __attribute__((visibility("default")))
#else
#define TV_API
#endif

#ifdef __cplusplus
/* Begins declarations with C linkage, also when a C++ program includes them. */
#define TV_BEGIN_DECLS extern "C" {
/* Ends the declarations with C linkage. */
#define TV_END_DECLS }
#else
#define TV_BEGIN_DECLS
#define TV_END_DECLS
#endif

TV_BEGIN_DECLS

/* How a struct may grow, and why programs and libraries of different releases work together.
   A struct that begins with struct_size grows only at its end, and a zero in a new field means the
   old behaviour. Its init macro (tv_limits_init and so on) passes the caller's sizeof to the
   library, which writes that size into struct_size and never writes beyond it.
   An input is read as far as struct_size reaches; a field beyond it has its default. An input that
   is longer than the library's struct is from a newer header: the bytes that the library does not
   know must all be zero, else TV_ERR_STRUCT_SIZE is returned.
   An output is written as far as struct_size reaches: an older caller does not receive the newer
   fields, a newer caller receives zeros in the fields that the library does not know. struct_size
   is kept. On an error nothing is written.
   A struct_size that is below 4 bytes, above 4096 bytes or no multiple of 4 bytes was not set by an
   init macro: TV_ERR_STRUCT_SIZE.
   Structs without struct_size (tv_camera, tv_image, and the elements of arrays) and the values of
   enums never change within one soname; an enum may gain values. */

/* What a call returns. A mistake of the caller and a buffer that is too small are errors. That two
   images have no common geometry is a result and no error (see two_view.h). On an error the outputs
   stay as they were, except for a size or a count that the function documents to write then. */
typedef enum tv_status {
  /* The call did its work. Also returned when the answer is that there is no geometry. */
  TV_OK = 0,
  /* A required pointer is null. */
  TV_ERR_NULL = 1,
  /* A value is out of its documented range. */
  TV_ERR_ARGUMENT = 2,
  /* A number is NaN or infinite where a finite number is required. */
  TV_ERR_NOT_FINITE = 3,
  /* struct_size was not set by an init macro, or a field that this library does not know is not
     zero: the program needs a newer library. */
  TV_ERR_STRUCT_SIZE = 4,
  /* The memory is not aligned to TV_CONTEXT_ALIGNMENT bytes. */
  TV_ERR_ALIGNMENT = 5,
  /* The memory is smaller than tv_context_size reports. */
  TV_ERR_MEMORY = 6,
  /* An image or a count exceeds the limits that the context was made with, or the context was not
     made for this call (tv_purpose). */
  TV_ERR_LIMITS = 7,
  /* An output array is too small; the count that is needed was written. */
  TV_ERR_CAPACITY = 8,
  /* An output array overlaps another argument. */
  TV_ERR_OVERLAP = 9,
  /* A camera has an unknown model, a size or focal length that is not above 0, a number that is not
     finite, or a reserved field that is not 0; or it is for images of another size than its image
     (tv_reconstruct). */
  TV_ERR_CAMERA = 10,
  /* A pixel or a ray lies outside the region in which the lens model is valid. */
  TV_ERR_OUTSIDE = 11,
  /* This CPU or this build of the library does not have the kernel set that was chosen. */
  TV_ERR_KERNELS = 12,
  /* The bytes are no map, are cut or altered, or are of a version that this library does not know
     (tv_odometry_load). */
  TV_ERR_MAP = 13,
  /* A frame's time is not later than that of the frame before it, and its gap is 0
     (tv_odometry_track). */
  TV_ERR_TIME = 14,
  /* The stride of a frame's image is below its width, or so large that its rows have no addresses
     (tv_odometry_track, tv_odometry_locate). */
  TV_ERR_STRIDE = 15,
  /* The mask of a frame is not of its image's size, or its stride does not fit its width
     (tv_odometry_track, tv_odometry_locate). */
  TV_ERR_MASK = 16,
  /* effort or max_effort of the options is above max_effort of the limits that the context was made
     with (tv_reconstruct). */
  TV_ERR_EFFORT = 17
} tv_status;

/* Returns a short English phrase for a status, or "unknown status" for any other number. The string
   is constant and never freed. Thread-safe. */
TV_API const char *tv_status_string(tv_status status);

/* Returns the version of the library that is linked, such as "0.2.0". It can differ from
   TV_VERSION_STRING, which is the version of the headers that the program was compiled with. The
   string is constant and never freed. Thread-safe. */
TV_API const char *tv_version_string(void);

TV_END_DECLS

#endif
