/* twoview drivers: what the functions of every driver return. */
#ifndef TWOVIEW_DRIVERS_STATUS_H
#define TWOVIEW_DRIVERS_STATUS_H

#include "twoview/status.h"

TV_BEGIN_DECLS

/* "Nothing now" and "over" are answers, not errors. On an error the outputs are as they were, but
   for a size that the function says it writes. */
typedef enum tvs_status {
  TVS_OK = 0,               /* done */
  TVS_NONE = 1,             /* nothing now, or not known; ask again later */
  TVS_END = 2,              /* over: closed by the other side, or the end of a recording */
  TVS_ERR_NULL = 16,        /* a required pointer is null */
  TVS_ERR_ARGUMENT = 17,    /* a value is out of its documented range */
  TVS_ERR_STRUCT_SIZE = 18, /* struct_size was not set, or is from a newer header */
  TVS_ERR_CAPACITY = 19,    /* the caller's buffer or a queue is too small for this */
  TVS_ERR_DATA = 20,        /* bytes that are not what they should be */
  TVS_ERR_CHECKSUM = 21,    /* well-formed bytes whose checksum is wrong */
  TVS_ERR_IO = 22,          /* a socket, file or device failed */
  TVS_ERR_STATE = 23,       /* not now: no link, an emergency, nothing open */
  TVS_ERR_TIMEOUT = 24      /* no answer in time, after all retries */
} tvs_status;

/* A short English phrase; "unknown status" for any other number. Static storage. */
TV_API const char *tvs_status_string(tvs_status status);

TV_END_DECLS

#endif
