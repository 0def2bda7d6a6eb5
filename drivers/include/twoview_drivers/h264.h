/* twoview drivers: H.264 to luma by libavcodec. It is a library of its own, libtwoview_h264, so
   that the other drivers do not depend on libav. */
#ifndef TWOVIEW_DRIVERS_H264_H
#define TWOVIEW_DRIVERS_H264_H

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* Opens a decoder of Annex-B access units without reordering (baseline, low delay) on one thread.
   Its pictures are the 8-bit Y plane in the decoder's own memory, of the size that the stream's
   cropping gives; nothing is copied. Release all pictures, then close it with tvs_h264_close.
   Returns TVS_ERR_NULL, TVS_ERR_STATE (this libavcodec has no H.264 decoder), TVS_ERR_CAPACITY (no
   memory). */
TV_API tvs_status tvs_h264_open_sized(tvs_decoder *decoder, size_t decoder_size);
/* tvs_h264_open_sized with the size of the caller's struct. */
#define tvs_h264_open(decoder) tvs_h264_open_sized((decoder), sizeof *(decoder))

/* Closes a decoder that tvs_h264_open opened; null is allowed. */
TV_API void tvs_h264_close(tvs_decoder *decoder);

TV_END_DECLS

#endif
