/* twoview: an 8-bit grey image that lies in the caller's memory. */
#ifndef TWOVIEW_IMAGE_H
#define TWOVIEW_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/status.h"

TV_BEGIN_DECLS

/* A view on the caller's pixels. They are read where they lie and never written, so that the Y
   plane of a decoded video frame can be passed as it is. Pixel (0, 0) is the centre of the top-left
   pixel; x points right, y down. The caller keeps `data` alive and unchanged during each call. */
typedef struct tv_image {
  /* The first pixel of the top row; 8-bit luma, 0 is black. */
  const uint8_t *data;
  /* Width in pixels, at least 1. */
  int32_t width;
  /* Height in pixels, at least 1. */
  int32_t height;
  /* Distance in bytes from the start of a row to the start of the next one, at least `width`. */
  int64_t stride_bytes;
} tv_image;

TV_END_DECLS

#endif
