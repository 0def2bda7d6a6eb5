/* The pictures of the captures decode: 517 of 517, 17 of 20 (the other three come before the
   first picture at which decoding can begin), and 5 of 5. */
#include <string.h>

#include "support/ardrone_fixtures.h"
#include "twoview_drivers/ardrone/pave.h"
#include "twoview_drivers/h264.h"

void setUp(void) {}
void tearDown(void) {}

static uint8_t video_buffer[ARDRONE_PAVE_BUFFER_BYTES];

/* Decodes a packet. Returns 1 for a picture, 0 for a packet that ardrone_pave_gate_check leaves
   out because it cannot be decoded. */
static int decode_packet(tvs_decoder *decoder, ardrone_pave_gate *gate,
                         const ardrone_pave_packet *packet) {
  const int answer = ardrone_pave_gate_check(gate, &packet->header);
  tvs_picture picture;
  if (answer & ARDRONE_PAVE_RESET) decoder->reset(decoder->user);
  if ((answer & ARDRONE_PAVE_DECODE) == 0) return 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, decoder->decode(decoder->user, packet->payload,
                                                packet->header.payload_size, &picture));
  TEST_ASSERT_EQUAL_INT32(640, picture.image.width);
  TEST_ASSERT_EQUAL_INT32(360, picture.image.height);
  TEST_ASSERT_TRUE(picture.image.stride_bytes >= 640);
  decoder->release(decoder->user, &picture);
  return 1;
}

static int decode_all(const char *name) {
  tvs_decoder decoder;
  ardrone_pave_parser parser;
  ardrone_pave_gate gate = {0};
  ardrone_pave_packet packet;
  size_t size, at = 0;
  uint8_t *bytes = fixture_read(name, &size);
  int pictures = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_h264_open(&decoder));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_init(&parser, video_buffer, sizeof video_buffer));
  while (at < size) {
    size_t room, take = 1000;
    uint8_t *to = ardrone_pave_space(&parser, &room);
    if (take > size - at) take = size - at;
    if (take > room) take = room;
    memcpy(to, bytes + at, take);
    ardrone_pave_filled(&parser, take);
    at += take;
    while (ardrone_pave_next(&parser, &packet) == TVS_OK) {
      pictures += decode_packet(&decoder, &gate, &packet);
    }
  }
  tvs_h264_close(&decoder);
  free(bytes);
  return pictures;
}

static void test_all_pictures_decode(void) {
  TEST_ASSERT_EQUAL_INT(517, decode_all("video/pave68_h264_360p_517frames.pave"));
  TEST_ASSERT_EQUAL_INT(17, decode_all("video/pave64_h264_360p_20frames.pave"));
  TEST_ASSERT_EQUAL_INT(5, decode_all("video/pave68_h264_360p_5frames.pave"));
}

static void test_bytes_that_are_no_picture_are_refused(void) {
  tvs_decoder decoder;
  tvs_picture picture;
  uint8_t noise[1000];
  size_t k;
  for (k = 0; k < sizeof noise; ++k) noise[k] = (uint8_t)(k * k * 31 + 7);
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_h264_open(&decoder));
  TEST_ASSERT_TRUE(TVS_OK != decoder.decode(decoder.user, noise, sizeof noise, &picture));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, decoder.decode(decoder.user, noise, 0, &picture));
  tvs_h264_close(&decoder);
}

int main(void) {
  fixtures_need();
  UNITY_BEGIN();
  RUN_TEST(test_all_pictures_decode);
  RUN_TEST(test_bytes_that_are_no_picture_are_refused);
  return UNITY_END();
}
