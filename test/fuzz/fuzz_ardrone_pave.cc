// PaVE: a stream that is split in any way gives the same packets as the stream in one piece, and no
// packet lies outside the bytes that were fed.
#include <vector>

#include "fuzz.h"
#include "twoview_drivers/ardrone/pave.h"

namespace {

constexpr size_t kBufferBytes = 4096;

struct Parser {
  std::vector<uint8_t> buffer = std::vector<uint8_t>(kBufferBytes);
  ardrone_pave_parser parser;
  ardrone_pave_gate gate{};
  std::vector<uint32_t> seen;

  Parser() { FUZZ_REQUIRE(ardrone_pave_init(&parser, buffer.data(), buffer.size()) == TVS_OK); }

  void drain() {
    ardrone_pave_packet packet;
    while (ardrone_pave_next(&parser, &packet) == TVS_OK) {
      uint32_t sum = 0;
      for (size_t k = 0; k < packet.size; ++k) sum = sum * 31 + packet.bytes[k];
      FUZZ_REQUIRE(packet.size == size_t{packet.header.header_size} + packet.header.payload_size);
      FUZZ_REQUIRE(packet.bytes >= buffer.data() &&
                   packet.bytes + packet.size <= buffer.data() + buffer.size());
      seen.push_back(sum);
      seen.push_back(static_cast<uint32_t>(ardrone_pave_gate_check(&gate, &packet.header)));
    }
  }

  // Feeds as many of the bytes as the parser has room for, and returns how many these were.
  size_t feed(const uint8_t* bytes, size_t size) {
    size_t room;
    uint8_t* to = ardrone_pave_space(&parser, &room);
    FUZZ_REQUIRE(room > 0);
    if (size > room) size = room;
    std::memcpy(to, bytes, size);
    ardrone_pave_filled(&parser, size);
    drain();
    return size;
  }
};

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const size_t piece = 1 + data[0] % 97;
  const bool skips = data[1] & 1;
  data += 2;
  size -= 2;
  static Parser whole, split;
  for (Parser* p : {&whole, &split}) {
    FUZZ_REQUIRE(ardrone_pave_init(&p->parser, p->buffer.data(), p->buffer.size()) == TVS_OK);
    p->gate = {};
    p->seen.clear();
  }
  for (size_t at = 0; at < size;) at += whole.feed(data + at, size - at);
  for (size_t at = 0; at < size;) {
    // feed() has taken all whole packets, so skip_to_latest must skip none.
    if (skips) ardrone_pave_skip_to_latest(&split.parser);
    at += split.feed(data + at, size - at < piece ? size - at : piece);
  }
  FUZZ_REQUIRE(whole.seen == split.seen);
  FUZZ_REQUIRE(whole.parser.num_packets == split.parser.num_packets);
  FUZZ_REQUIRE(whole.parser.bytes_skipped == split.parser.bytes_skipped);
  return 0;
}
