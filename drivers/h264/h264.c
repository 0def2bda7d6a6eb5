#include "twoview_drivers/h264.h"

#include <libavcodec/avcodec.h>
#include <stdlib.h>
#include <string.h>

#include "../source/sized.h"

enum { MAX_BYTES = 1 << 24 };

typedef struct h264 {
  AVCodecContext *context;
  AVPacket *packet;
  AVFrame *frame; /* libav decodes into it; the result is then moved to the picture's own frame */
} h264;

static int is_luma_first(int format) {
  return format == AV_PIX_FMT_YUV420P || format == AV_PIX_FMT_YUVJ420P ||
         format == AV_PIX_FMT_GRAY8 || format == AV_PIX_FMT_YUV422P ||
         format == AV_PIX_FMT_YUVJ422P || format == AV_PIX_FMT_YUV444P ||
         format == AV_PIX_FMT_YUVJ444P;
}

/* Takes the next decoded picture, if there is one. One access unit gives at most one. */
static tvs_status take_picture(h264 *own, tvs_picture *picture) {
  AVFrame *held;
  const int result = avcodec_receive_frame(own->context, own->frame);
  if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return TVS_NONE;
  if (result < 0) return TVS_ERR_DATA;
  /* A picture in which libav concealed errors is refused, since its pixels were not measured. */
  if (!is_luma_first(own->frame->format) || own->frame->linesize[0] < own->frame->width ||
      own->frame->width < 1 || own->frame->height < 1 || own->frame->decode_error_flags ||
      (own->frame->flags & AV_FRAME_FLAG_CORRUPT)) {
    av_frame_unref(own->frame);
    return TVS_ERR_DATA;
  }
  held = av_frame_alloc();
  if (!held) {
    av_frame_unref(own->frame);
    return TVS_ERR_CAPACITY;
  }
  av_frame_move_ref(held, own->frame);
  picture->image.data = held->data[0];
  picture->image.width = held->width;
  picture->image.height = held->height;
  picture->image.stride_bytes = held->linesize[0];
  picture->handle = held;
  return TVS_OK;
}

static tvs_status decode(void *user, const uint8_t *bytes, size_t size, tvs_picture *picture) {
  h264 *own = user;
  int result;
  if (!bytes || !picture) return TVS_ERR_NULL;
  if (size == 0 || size > MAX_BYTES) return TVS_ERR_ARGUMENT;
  /* The bytes are copied into a packet of libav's own, since libav reads beyond the end of a packet
     and requires padding there. */
  if (av_new_packet(own->packet, (int)size) < 0) return TVS_ERR_CAPACITY;
  memcpy(own->packet->data, bytes, size);
  result = avcodec_send_packet(own->context, own->packet);
  av_packet_unref(own->packet);
  if (result < 0) return TVS_ERR_DATA;
  return take_picture(own, picture);
}

static void release(void *user, tvs_picture *picture) {
  AVFrame *held;
  (void)user;
  if (!picture) return;
  held = picture->handle;
  av_frame_free(&held);
  picture->handle = NULL;
}

static void reset(void *user) { avcodec_flush_buffers(((h264 *)user)->context); }

static void free_all(h264 *own) {
  avcodec_free_context(&own->context);
  av_packet_free(&own->packet);
  av_frame_free(&own->frame);
  free(own);
}

tvs_status tvs_h264_open_sized(tvs_decoder *decoder, size_t decoder_size) {
  tvs_decoder made = {0};
  const AVCodec *codec = avcodec_find_decoder(AV_CODEC_ID_H264);
  h264 *own;
  if (!decoder) return TVS_ERR_NULL;
  if (!codec) return TVS_ERR_STATE;
  own = calloc(1, sizeof *own);
  if (!own) return TVS_ERR_CAPACITY;
  own->context = avcodec_alloc_context3(codec);
  own->packet = av_packet_alloc();
  own->frame = av_frame_alloc();
  if (!own->context || !own->packet || !own->frame) {
    free_all(own);
    return TVS_ERR_CAPACITY;
  }
  own->context->thread_count = 1; /* with more threads libav would deliver each picture later */
  own->context->flags |= AV_CODEC_FLAG_LOW_DELAY;
  own->context->err_recognition = AV_EF_EXPLODE;
  if (avcodec_open2(own->context, codec, NULL) < 0) {
    free_all(own);
    return TVS_ERR_STATE;
  }
  made.user = own;
  made.decode = decode;
  made.release = release;
  made.reset = reset;
  tvs_write_sized(&made, sizeof made, decoder, decoder_size);
  return TVS_OK;
}

void tvs_h264_close(tvs_decoder *decoder) {
  if (!decoder || !decoder->user) return;
  free_all(decoder->user);
  memset(decoder, 0, TVS_SIZE_THROUGH(tvs_decoder, reset));
}
