// The AR.Drone's codecs: packets of navdata and frames of PaVE a second. Built by the project's own encoder.
#include <benchmark/benchmark.h>

#include <cstring>
#include <vector>

#include "encode.h"

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

// present: 0xfffffff is a full packet of 28 options, 1916 bytes; 65537 a demo one, 500 bytes.
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

// One frame of 10 kB at a time, as TCP hands it over.
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

}  // namespace

BENCHMARK_MAIN();
