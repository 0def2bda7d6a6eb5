/* twoview drivers: what the functions of every driver return, and how their structs grow.

   A struct that begins with struct_size may grow at its end within a soname. struct_size is that of
   the caller's header: an init, and a function that fills a struct, is a macro over a function
   ..._sized that is given the size; in a tvs_frame, tvs_imu, tvm_track and tvm_estimate the caller
   sets it. A driver reads and writes no more than that, and takes an older header's struct with the
   defaults for the rest. Who is handed a driver's struct (next, on_frame, on_imu) reads no field
   beyond the struct_size in it. */
#ifndef TWOVIEW_DRIVERS_STATUS_H
#define TWOVIEW_DRIVERS_STATUS_H

#include "twoview/status.h"

TV_BEGIN_DECLS

/* What every function of the drivers returns. TVS_NONE and TVS_END are answers, not errors. On an
   error the outputs are unchanged, except for a size that the function documents as written. */
typedef enum tvs_status {
  /* The call succeeded, and the outputs are written. */
  TVS_OK = 0,
  /* There is nothing yet, or it is not known; call again later. */
  TVS_NONE = 1,
  /* The stream ended: the other side closed it, or a recording is at its end. */
  TVS_END = 2,
  /* A required pointer is null. */
  TVS_ERR_NULL = 16,
  /* A value is out of its documented range. */
  TVS_ERR_ARGUMENT = 17,
  /* struct_size was not set, or the struct is of a newer header and uses what this library does not
     know. */
  TVS_ERR_STRUCT_SIZE = 18,
  /* The caller's buffer or a queue is too small for this. */
  TVS_ERR_CAPACITY = 19,
  /* The bytes that were read are malformed. */
  TVS_ERR_DATA = 20,
  /* The bytes that were read are well formed, and their checksum is wrong. */
  TVS_ERR_CHECKSUM = 21,
  /* A socket, file or device failed. */
  TVS_ERR_IO = 22,
  /* The call is not possible in the present state: there is no link, there is an emergency, or
     nothing is open. */
  TVS_ERR_STATE = 23,
  /* No answer came in time, after all retries. */
  TVS_ERR_TIMEOUT = 24
} tvs_status;

/* A short English phrase; "unknown status" for any other number. Static storage. */
TV_API const char *tvs_status_string(tvs_status status);

TV_END_DECLS

#endif
