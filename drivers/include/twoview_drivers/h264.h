/* twoview drivers: H.264 to luma, by libavcodec. A library of its own, libtwoview_h264: nothing else of
   the drivers needs libav. */
#ifndef TWOVIEW_DRIVERS_H264_H
#define TWOVIEW_DRIVERS_H264_H

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* A decoder of Annex-B access units without reordering (baseline, low delay), one thread. Pictures are
   the decoder's own memory, not copied: the Y plane, 8-bit, at the size that the stream's cropping
   says. Close with tvs_h264_close after the last release.
   Returns TVS_ERR_NULL, TVS_ERR_STATE (this libavcodec has no H.264 decoder), TVS_ERR_CAPACITY (no
   memory). */
TV_API tvs_status tvs_h264_open(tvs_decoder *decoder);
/* Closes what tvs_h264_open opened; null is allowed. */
TV_API void tvs_h264_close(tvs_decoder *decoder);

TV_END_DECLS

#endif
