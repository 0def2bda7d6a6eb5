// Speed of the AR.Drone driver: navdata packets, PaVE frames and command datagrams a second, and
// the time that a session adds to a picture. The data come from the project's own encoder.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <vector>

#include "encode.h"
#include "twoview_drivers/ardrone/session.h"

namespace {

std::vector<uint8_t> make_navdata(uint32_t present) {
  static ardrone_navdata navdata;
  std::vector<uint8_t> bytes(ARDRONE_NAVDATA_MAX_BYTES);
  size_t size = 0;
  navdata.sequence = 1;
  navdata.present = present;
  navdata.gps_form = ARDRONE_GPS_ZIMMU;
  navdata.demo.psi_mdeg = 12345;
  ardrone_encode_navdata(&navdata, bytes.data(), bytes.size(), &size);
  bytes.resize(size);
  return bytes;
}

// Decodes a navdata packet. The argument is the bit mask of its options: 0xfffffff makes a full
// packet (28 options, 1916 bytes), 65537 a demo packet (500 bytes).
void navdata_decode(benchmark::State& state) {
  const std::vector<uint8_t> bytes = make_navdata(static_cast<uint32_t>(state.range(0)));
  static ardrone_navdata navdata;
  for (auto _ : state) {
    benchmark::DoNotOptimize(ardrone_navdata_decode(bytes.data(), bytes.size(), &navdata));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations());
  state.SetBytesProcessed(state.iterations() * static_cast<int64_t>(bytes.size()));
}
BENCHMARK(navdata_decode)->Arg(0xfffffff)->Arg(1 << 16 | 1);

// Parses a video frame of 10 kB, which arrives in pieces of at most 1448 bytes, as from TCP.
void pave_parse(benchmark::State& state) {
  ardrone_pave_header header{};
  std::vector<uint8_t> payload(10000), bytes(11000), buffer(ARDRONE_PAVE_BUFFER_BYTES);
  ardrone_pave_parser parser;
  ardrone_pave_packet packet;
  size_t size = 0;
  header.version = 2;
  header.codec = ARDRONE_PAVE_H264;
  header.header_size = 68;
  header.payload_size = 10000;
  header.encoded_width = 640;
  header.encoded_height = 368;
  ardrone_encode_pave(&header, payload.data(), bytes.data(), bytes.size(), &size);
  ardrone_pave_init(&parser, buffer.data(), buffer.size());
  for (auto _ : state) {
    for (size_t at = 0; at < size; at += 1448) {
      size_t room;
      uint8_t* to = ardrone_pave_space(&parser, &room);
      const size_t take = size - at < 1448 ? size - at : 1448;
      std::memcpy(to, bytes.data() + at, take);
      ardrone_pave_filled(&parser, take);
      benchmark::DoNotOptimize(ardrone_pave_next(&parser, &packet));
    }
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(pave_parse);

// Writes the commands REF and PCMD, which a controller sends every 30 ms in flight.
void at_write(benchmark::State& state) {
  static ardrone_at at;
  const ardrone_move move = {0.1f, -0.2f, 0.3f, -0.4f};
  for (auto _ : state) {
    at.size = 0;
    ardrone_at_ref(&at, 1, 0);
    benchmark::DoNotOptimize(ardrone_at_pcmd(&at, &move, 0));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(at_write);

// A simulated drone that has a full navdata packet and a picture of 10 kB ready at each step. The
// decoder takes no time, so the measured time is the driver's.
struct Feed {
  std::vector<uint8_t> navdata = make_navdata(0xfffffff), picture;
  size_t navdata_left = 0, picture_at = 0;
  uint32_t number = 0;

  void refill() {
    ardrone_pave_header header{};
    static const std::vector<uint8_t> payload(10000);
    size_t size = 0;
    header.version = 2;
    header.codec = ARDRONE_PAVE_H264;
    header.header_size = 68;
    header.payload_size = 10000;
    header.encoded_width = 640;
    header.encoded_height = 368;
    header.frame_number = ++number;
    header.timestamp_ms = number * 33;
    header.frame_type = number % 15 == 1 ? ARDRONE_PAVE_IDR : ARDRONE_PAVE_P;
    picture.resize(10068);
    ardrone_encode_pave(&header, payload.data(), picture.data(), picture.size(), &size);
    picture_at = 0;
    navdata_left = navdata.size();
  }
};

tvs_status feed_open(void*, ardrone_channel, int64_t) { return TVS_OK; }
tvs_status feed_send(void*, ardrone_channel, const void*, size_t) { return TVS_OK; }
void feed_close(void*, ardrone_channel) {}
tvs_status feed_receive(void* user, ardrone_channel channel, void* to, size_t capacity,
                        size_t* size) {
  Feed& feed = *static_cast<Feed*>(user);
  if (channel == ARDRONE_CHANNEL_NAVDATA && feed.navdata_left > 0) {
    *size = feed.navdata_left;
    std::memcpy(to, feed.navdata.data(), *size);
    feed.navdata_left = 0;
    return TVS_OK;
  }
  if (channel != ARDRONE_CHANNEL_VIDEO || feed.picture_at == feed.picture.size()) return TVS_NONE;
  *size = std::min({capacity, size_t{1448}, feed.picture.size() - feed.picture_at});
  std::memcpy(to, feed.picture.data() + feed.picture_at, *size);
  feed.picture_at += *size;
  return TVS_OK;
}

tvs_status no_decode(void*, const uint8_t*, size_t, tvs_picture* picture) {
  static const uint8_t pixel = 0;
  picture->image = {&pixel, 1, 1, 1};
  return TVS_OK;
}
void no_release(void*, tvs_picture*) {}
void no_reset(void*) {}

void session_picture(benchmark::State& state) {
  Feed feed;
  const tvs_decoder decoder = {sizeof decoder, nullptr, no_decode, no_release, no_reset};
  const ardrone_transport transport = {sizeof transport, &feed,      feed_open, feed_send,
                                       feed_receive,     feed_close, nullptr};
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.decoder = &decoder;
  options.listen_only = 1;
  size_t size = 0;
  ardrone_session_size(&options, &size);
  std::vector<std::max_align_t> memory(size / sizeof(std::max_align_t) + 1);
  ardrone_session* session = nullptr;
  ardrone_session_init(&session, &options, &transport, memory.data(), size);
  tvs_frame_source frames;
  ardrone_session_frames(session, &frames);
  tvs_frame frame;
  frame.struct_size = sizeof frame;
  int64_t now = 0, pictures = 0;
  for (auto _ : state) {
    state.PauseTiming();
    feed.refill();
    state.ResumeTiming();
    ardrone_session_step(session, now += 33000000);
    while (frames.next(frames.user, &frame) == TVS_OK) {
      ++pictures;
      frames.release(frames.user, &frame);
    }
  }
  ardrone_session_close(session);
  if (pictures + 15 < state.iterations()) state.SkipWithError("pictures are missing");
  state.SetItemsProcessed(pictures);
}
BENCHMARK(session_picture);

}  // namespace

BENCHMARK_MAIN();
