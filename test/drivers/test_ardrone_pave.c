/* Streams made by the encoder: resynchronisation, the latency rule (ardrone_pave_skip_to_latest
   drops all packets before the last IDR picture), and the gate (ardrone_pave_gate_check leaves
   out packets that cannot be decoded). */
#include <string.h>
#include <unity.h>

#include "encode.h"

static uint8_t stream[200000], buffer[ARDRONE_PAVE_BUFFER_BYTES];
static size_t size;
static ardrone_pave_parser parser;
static ardrone_pave_packet packet;

void setUp(void) {
  size = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_init(&parser, buffer, sizeof buffer));
}
void tearDown(void) {}

static ardrone_pave_header header_of(uint32_t number, int type, uint32_t payload) {
  ardrone_pave_header h = {0};
  h.version = 2;
  h.codec = ARDRONE_PAVE_H264;
  h.header_size = number % 2 ? 64 : 68;
  h.payload_size = h.advertised_size = payload;
  h.encoded_width = h.display_width = 640;
  h.encoded_height = 368;
  h.display_height = 360;
  h.frame_number = number;
  h.timestamp_ms = number * 33;
  h.frame_type = (uint8_t)type;
  h.stream_id = 1;
  h.total_slices = h.total_chunks = 1;
  return h;
}

static void add(uint32_t number, int type, uint32_t payload_size) {
  static uint8_t payload[50000];
  const ardrone_pave_header h = header_of(number, type, payload_size);
  size_t written;
  memset(payload, (int)number, sizeof payload);
  TEST_ASSERT_EQUAL_INT(
      TVS_OK, ardrone_encode_pave(&h, payload, stream + size, sizeof stream - size, &written));
  size += written;
}

static void add_bytes(const void *bytes, size_t count) {
  memcpy(stream + size, bytes, count);
  size += count;
}

static void feed(const uint8_t *bytes, size_t count) {
  size_t room;
  uint8_t *to = ardrone_pave_space(&parser, &room);
  TEST_ASSERT_TRUE(room >= count);
  memcpy(to, bytes, count);
  ardrone_pave_filled(&parser, count);
}

static void expect(uint32_t number) {
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_next(&parser, &packet));
  TEST_ASSERT_EQUAL_UINT32(number, packet.header.frame_number);
  TEST_ASSERT_EQUAL_HEX8((uint8_t)number, packet.payload[0]);
  TEST_ASSERT_EQUAL_HEX8((uint8_t)number, packet.payload[packet.header.payload_size - 1]);
}

static void expect_none(void) {
  TEST_ASSERT_EQUAL_INT(TVS_NONE, ardrone_pave_next(&parser, &packet));
}

static void test_header_survives_encoding(void) {
  ardrone_pave_header h = header_of(42, ARDRONE_PAVE_IDR, 5), back;
  const uint8_t payload[5] = {1, 2, 3, 4, 5};
  h.position_low = 0x01020304;
  h.position_high = 5;
  h.sps_size = 14;
  h.pps_size = 10;
  h.extra = 2;
  h.angles[0] = -0.04f;
  h.angles[2] = -2.86f;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_pave(&h, payload, stream, sizeof stream, &size));
  TEST_ASSERT_EQUAL_UINT64(73, size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_decode(stream, size, &back));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_pave(&back, payload, stream + 100, 100, &size));
  /* Decoding and encoding again gives the same bytes. */
  TEST_ASSERT_EQUAL_MEMORY(stream, stream + 100, 73);
  TEST_ASSERT_EQUAL_UINT32(42, back.frame_number);
  TEST_ASSERT_EQUAL_UINT(14, back.sps_size);
  TEST_ASSERT_EQUAL_UINT(10, back.pps_size);
  TEST_ASSERT_EQUAL_UINT32(0x01020304, back.position_low);
  TEST_ASSERT_EQUAL_UINT32(2, back.extra);
  TEST_ASSERT_EQUAL_FLOAT(-2.86f, back.angles[2]);
}

static void test_garbage_between_packets_is_passed_over(void) {
  add_bytes("PaPaVPaVE and no header", 23);
  add(7, ARDRONE_PAVE_IDR, 300);
  add_bytes("PaVEPaVE", 8);
  add(8, ARDRONE_PAVE_P, 200);
  add_bytes("PaV", 3);
  feed(stream, size);
  expect(7);
  expect(8);
  expect_none();
  TEST_ASSERT_EQUAL_UINT64(31, parser.bytes_skipped);
}

/* The stream begins inside a picture that holds a signature and a header with absurd sizes. */
static void test_a_signature_within_a_picture_is_no_packet(void) {
  uint8_t fake[64];
  memset(fake, 0xff, sizeof fake);
  memcpy(fake, "PaVE", 4);
  add_bytes(fake, sizeof fake);
  add(9, ARDRONE_PAVE_P, 100);
  feed(stream, size);
  expect(9);
}

static void test_absurd_sizes_are_refused(void) {
  ardrone_pave_header h = header_of(1, ARDRONE_PAVE_IDR, 10), back;
  const uint8_t payload[10] = {0};
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_pave(&h, payload, stream, sizeof stream, &size));
  stream[6] = 63; /* header_size 63 is too small */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, ardrone_pave_decode(stream, size, &back));
  stream[6] = 1;
  stream[7] = 1; /* header_size 257 is too large */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, ardrone_pave_decode(stream, size, &back));
  stream[6] = 0; /* header_size 256 is allowed, but more bytes are needed */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, ardrone_pave_decode(stream, size, &back));
  stream[6] = 64;
  stream[7] = 0;
  stream[10] = 0x20; /* payload_size of 2 MiB is too large */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, ardrone_pave_decode(stream, size, &back));
}

static void test_an_advertisement_carries_no_payload(void) {
  ardrone_pave_header h = header_of(1, ARDRONE_PAVE_P, 0);
  size_t written;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_pave(&h, NULL, stream, sizeof stream, &written));
  stream[31] = ARDRONE_PAVE_ADVERTISEMENT;
  stream[8] = 77; /* payload_size, which here is that of a packet to come */
  size = written;
  add(2, ARDRONE_PAVE_IDR, 100);
  feed(stream, size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_next(&parser, &packet));
  TEST_ASSERT_EQUAL_UINT32(0, packet.header.payload_size);
  expect(2);
}

static void test_the_buffer_turns_over(void) {
  static uint8_t small[4096];
  uint32_t k;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, ardrone_pave_init(&parser, small, 4095));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_init(&parser, small, sizeof small));
  for (k = 1; k < 200; ++k) {
    size = 0;
    add(k, ARDRONE_PAVE_P, 1 + k * 19 % 3500);
    feed(stream, size / 2);
    expect_none();
    feed(stream + size / 2, size - size / 2);
    expect(k);
  }
  size = 0;
  /* Packet 1000 does not fit into the buffer: the parser skips it and does not wait for its end. */
  add(1000, ARDRONE_PAVE_P, 4090);
  feed(stream, 100);
  expect_none();
  size = 0;
  add(1001, ARDRONE_PAVE_P, 10);
  feed(stream, size);
  expect(1001);
}

static void test_the_latency_rule_keeps_the_last_idr(void) {
  add(1, ARDRONE_PAVE_IDR, 50);
  add(2, ARDRONE_PAVE_P, 50);
  add(3, ARDRONE_PAVE_IDR, 50);
  add(4, ARDRONE_PAVE_P, 50);
  feed(stream, size);
  size = 0;
  add(5, ARDRONE_PAVE_IDR, 50);
  feed(stream, size / 2); /* packet 5 is incomplete, so the rule keeps packets 3 and 4 */
  TEST_ASSERT_EQUAL_INT(2, ardrone_pave_skip_to_latest(&parser));
  expect(3);
  expect(4);
  TEST_ASSERT_EQUAL_INT(0, ardrone_pave_skip_to_latest(&parser));
  expect_none();
}

static int gate(ardrone_pave_gate *g, uint32_t number, int type, uint32_t payload) {
  const ardrone_pave_header h = header_of(number, type, payload);
  return ardrone_pave_gate_check(g, &h);
}

static void test_the_gate_opens_on_idr_and_shuts_on_a_gap(void) {
  ardrone_pave_gate g = {0};
  ardrone_pave_header h;
  TEST_ASSERT_EQUAL_INT(0, gate(&g, 1, ARDRONE_PAVE_P, 100));
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_DECODE | ARDRONE_PAVE_RESET,
                        gate(&g, 2, ARDRONE_PAVE_IDR, 100));
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_DECODE, gate(&g, 3, ARDRONE_PAVE_P, 100));
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_REPEAT, gate(&g, 4, ARDRONE_PAVE_P, 7));
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_GAP, gate(&g, 6, ARDRONE_PAVE_P, 100));
  TEST_ASSERT_EQUAL_INT(0, gate(&g, 7, ARDRONE_PAVE_P, 100));
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_DECODE | ARDRONE_PAVE_RESET,
                        gate(&g, 8, ARDRONE_PAVE_IDR, 100));
  /* Packet 8 comes a second time. */
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_GAP, gate(&g, 8, ARDRONE_PAVE_P, 100));
  g.is_open = 1;
  h = header_of(9, ARDRONE_PAVE_P, 100);
  h.stream_id = 2; /* another stream: the size of the video changed to 720p */
  TEST_ASSERT_EQUAL_INT(0, ardrone_pave_gate_check(&g, &h));
  h = header_of(10, ARDRONE_PAVE_IDR, 100);
  h.stream_id = 2;
  TEST_ASSERT_EQUAL_INT(ARDRONE_PAVE_DECODE | ARDRONE_PAVE_RESET, ardrone_pave_gate_check(&g, &h));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_header_survives_encoding);
  RUN_TEST(test_garbage_between_packets_is_passed_over);
  RUN_TEST(test_a_signature_within_a_picture_is_no_packet);
  RUN_TEST(test_absurd_sizes_are_refused);
  RUN_TEST(test_an_advertisement_carries_no_payload);
  RUN_TEST(test_the_buffer_turns_over);
  RUN_TEST(test_the_latency_rule_keeps_the_last_idr);
  RUN_TEST(test_the_gate_opens_on_idr_and_shuts_on_a_gap);
  return UNITY_END();
}
