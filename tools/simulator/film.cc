#include "simulator/film.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

#include <cstring>
#include <stdexcept>

namespace simulator {
namespace {

// One key picture in this many pictures, as in recordings of a real drone.
constexpr int kKeyEvery = 15;

// The size in bytes of the first unit in `bytes`, with its start code, if the unit has this type;
// otherwise 0.
size_t unit_bytes(const uint8_t* bytes, size_t size, int type) {
  const auto start_code = [&](size_t at) -> size_t {
    if (at + 3 <= size && bytes[at] == 0 && bytes[at + 1] == 0 && bytes[at + 2] == 1) return 3;
    if (at + 4 <= size && std::memcmp(bytes + at, "\0\0\0\1", 4) == 0) return 4;
    return 0;
  };
  const size_t head = start_code(0);
  if (head == 0 || head >= size || (bytes[head] & 31) != type) return 0;
  for (size_t at = head + 1; at < size; ++at) {
    if (start_code(at) != 0) return at;
  }
  return size;
}

}  // namespace

struct Film::Encoder {
  AVCodecContext* context = nullptr;
  AVFrame* frame = nullptr;
  AVPacket* packet = nullptr;
  ~Encoder() {
    avcodec_free_context(&context);
    av_frame_free(&frame);
    av_packet_free(&packet);
  }
};

Film::Film(int width, int height, int frames_per_second, int kbit_per_second)
    : width_(width), height_(height), encoder_(std::make_unique<Encoder>()) {
  const AVCodec* codec = avcodec_find_encoder_by_name("libx264");
  if (codec == nullptr) throw std::runtime_error("libavcodec has no libx264: no video to send");
  Encoder& e = *encoder_;
  e.context = avcodec_alloc_context3(codec);
  e.frame = av_frame_alloc();
  e.packet = av_packet_alloc();
  if (e.context == nullptr || e.frame == nullptr || e.packet == nullptr) throw std::bad_alloc();
  e.context->width = width;
  e.context->height = height;
  e.context->pix_fmt = AV_PIX_FMT_YUV420P;
  e.context->time_base = AVRational{1, frames_per_second};
  e.context->gop_size = kKeyEvery;
  e.context->max_b_frames = 0;
  e.context->bit_rate = 1000ll * kbit_per_second;
  e.context->thread_count = 1;
  av_opt_set(e.context->priv_data, "preset", "ultrafast", 0);
  av_opt_set(e.context->priv_data, "tune", "zerolatency", 0);
  av_opt_set(e.context->priv_data, "profile", "baseline", 0);
  av_opt_set(e.context->priv_data, "x264-params", "log=-1", 0);
  if (avcodec_open2(e.context, codec, nullptr) < 0) {
    throw std::runtime_error("libavcodec cannot encode this size");
  }
  e.frame->format = AV_PIX_FMT_YUV420P;
  e.frame->width = width;
  e.frame->height = height;
  e.frame->pts = 0;
  if (av_frame_get_buffer(e.frame, 0) < 0) throw std::bad_alloc();
}

Film::~Film() = default;

FilmPacket Film::encode(const uint8_t* luma, int64_t stride_bytes) {
  Encoder& e = *encoder_;
  if (av_frame_make_writable(e.frame) < 0) throw std::bad_alloc();
  for (int y = 0; y < height_; ++y) {
    std::memcpy(e.frame->data[0] + y * e.frame->linesize[0], luma + y * stride_bytes,
                static_cast<size_t>(width_));
  }
  for (int plane = 1; plane < 3; ++plane) {  // colour planes: 128, grey
    std::memset(e.frame->data[plane], 128,
                static_cast<size_t>(e.frame->linesize[plane]) * static_cast<size_t>(height_ / 2));
  }
  if (avcodec_send_frame(e.context, e.frame) < 0 ||
      avcodec_receive_packet(e.context, e.packet) < 0) {
    throw std::runtime_error("libavcodec did not encode a picture");
  }
  ++e.frame->pts;
  FilmPacket film;
  const uint8_t* bytes = e.packet->data;
  const size_t size = static_cast<size_t>(e.packet->size);
  film.payload.assign(bytes, bytes + size);
  film.is_key = (e.packet->flags & AV_PKT_FLAG_KEY) != 0;
  const size_t sps = unit_bytes(bytes, size, 7);
  film.sps_bytes = static_cast<uint8_t>(sps);
  film.pps_bytes = static_cast<uint8_t>(unit_bytes(bytes + sps, size - sps, 8));
  av_packet_unref(e.packet);
  return film;
}

}  // namespace simulator
