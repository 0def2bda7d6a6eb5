/* twoview: an 8-bit luma image, as the caller has it. */
#ifndef TWOVIEW_IMAGE_H
#define TWOVIEW_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/status.h"

TV_BEGIN_DECLS

/* A view on the caller's pixels, never copied as a whole and never written: the Y plane of a decoded
   video frame serves as it is. Pixel (0,0) is the centre of the top-left pixel, x right, y down.
   The caller keeps `data` alive during each call. */
typedef struct tv_image {
  const uint8_t *data;    /* row 0, 8-bit luma */
  int32_t width;          /* pixels, at least 1 */
  int32_t height;         /* pixels, at least 1 */
  int64_t stride_bytes;   /* from a row to the next, at least width */
} tv_image;

TV_END_DECLS

#endif
