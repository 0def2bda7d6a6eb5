/* Real captures compared with the values of the protocol description, which come from other
   programs' parsers and from cross-checks between the values. */
#include <math.h>
#include <string.h>

#include "encode.h"
#include "support/ardrone_fixtures.h"

void setUp(void) {}
void tearDown(void) {}

static ardrone_navdata navdata;

static uint8_t *decode_fixture(const char *name, size_t *size) {
  uint8_t *bytes = fixture_read(name, size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_navdata_decode(bytes, *size, &navdata));
  return bytes;
}

/* A packet is decoded and encoded again: a byte that the decoder lost or misplaced would differ. */
static void check_every_byte_survives(const char *name) {
  static uint8_t again[ARDRONE_NAVDATA_MAX_BYTES];
  size_t size, size_again;
  uint8_t *bytes = decode_fixture(name, &size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_navdata(&navdata, again, sizeof again, &size_again));
  TEST_ASSERT_EQUAL_UINT64(size, size_again);
  TEST_ASSERT_EQUAL_MEMORY(bytes, again, size);
  free(bytes);
}

static void test_every_byte_of_navdata_survives_decoding(void) {
  check_every_byte_survives("navdata/navdata_full_landed_1916.bin");
  check_every_byte_survives("navdata/navdata_full_gps248_2120.bin");
  check_every_byte_survives("navdata/navdata_bootstrap_24.bin");
}

static void test_the_landed_packet_has_the_values_of_the_sheet(void) {
  size_t size;
  free(decode_fixture("navdata/navdata_full_landed_1916.bin", &size));
  TEST_ASSERT_EQUAL_HEX32(0x55667788, navdata.magic);
  TEST_ASSERT_EQUAL_UINT32(300711, navdata.sequence);
  TEST_ASSERT_EQUAL_HEX32(0x4f8000d0, navdata.state);
  TEST_ASSERT_EQUAL_HEX32(ARDRONE_STATE_ALTITUDE_CONTROL | ARDRONE_STATE_ACKNOWLEDGE |
                              ARDRONE_STATE_CAMERA_READY | ARDRONE_STATE_PIC_VERSION_OK |
                              ARDRONE_STATE_AT_THREAD | ARDRONE_STATE_NAVDATA_THREAD |
                              ARDRONE_STATE_VIDEO_THREAD | ARDRONE_STATE_ACQUISITION_THREAD |
                              ARDRONE_STATE_COM_WATCHDOG,
                          navdata.state);
  TEST_ASSERT_EQUAL_UINT32(36358, navdata.checksum);
  TEST_ASSERT_EQUAL_HEX32(0x0fffffff, navdata.present);
  TEST_ASSERT_EQUAL_UINT32(0, navdata.num_unknown + navdata.num_short);
  TEST_ASSERT_EQUAL_UINT32(ARDRONE_CONTROL_LANDED, navdata.demo.ctrl_state >> 16);
  TEST_ASSERT_EQUAL_UINT32(50, navdata.demo.battery_percent);
  TEST_ASSERT_EQUAL_FLOAT(2974, navdata.demo.theta_mdeg);
  TEST_ASSERT_EQUAL_FLOAT(550, navdata.demo.phi_mdeg);
  TEST_ASSERT_EQUAL_FLOAT(1933, navdata.demo.psi_mdeg);
  TEST_ASSERT_EQUAL_INT32(0, navdata.demo.altitude_mm);
  TEST_ASSERT_EQUAL_INT64(INT64_C(362979125000), ardrone_time_ns(navdata.time));
  TEST_ASSERT_FLOAT_WITHIN(5e-4f, 80.297f, navdata.phys_measures.acceleration_mg[0]);
  TEST_ASSERT_FLOAT_WITHIN(5e-4f, -33.319f, navdata.phys_measures.acceleration_mg[1]);
  TEST_ASSERT_FLOAT_WITHIN(5e-4f, -942.528f, navdata.phys_measures.acceleration_mg[2]);
  TEST_ASSERT_EQUAL_FLOAT(4866, navdata.euler_angles.theta_mdeg);
  TEST_ASSERT_EQUAL_FLOAT(2024, navdata.euler_angles.phi_mdeg);
  TEST_ASSERT_EQUAL_INT32(243, navdata.altitude.vision_mm);
  TEST_ASSERT_EQUAL_INT32(243, navdata.altitude.raw_mm);
  TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.051903f, navdata.vision.theta_rad);
  TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.009621f, navdata.vision.phi_rad);
  TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.033727f, navdata.vision.psi_rad);
  TEST_ASSERT_EQUAL_UINT32(362969, navdata.vision.capture_ms);
  TEST_ASSERT_EQUAL_INT32(435, navdata.pressure.temperature_dc);
  TEST_ASSERT_EQUAL_INT32(101586, navdata.pressure.pressure_pa);
  TEST_ASSERT_EQUAL_UINT32(11686, navdata.raw_measures.battery_mv);
  TEST_ASSERT_FLOAT_WITHIN(1e-5f, 1.93336f, navdata.magneto.heading_fusion_deg);
  TEST_ASSERT_EQUAL_INT(ARDRONE_GPS_ZIMMU, navdata.gps_form);
}

/* In this capture only gravity acts, so the angles computed from the accelerometer must agree
   with the packet's own; a wrong sign or axis would show. */
static void test_the_accelerometer_agrees_with_the_angles_in_the_packet(void) {
  size_t size;
  tvs_imu imu;
  const double degree = 0.017453292519943295;
  free(decode_fixture("navdata/navdata_full_landed_1916.bin", &size));
  imu.struct_size = sizeof imu;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_navdata_to_imu(&navdata, 0, &imu));
  TEST_ASSERT_EQUAL_UINT32(
      TVS_IMU_ATTITUDE | TVS_IMU_ACCELERATION | TVS_IMU_RATE | TVS_IMU_PRESSURE, imu.valid);
  {
    const double *a = imu.acceleration_m_s2;
    TEST_ASSERT_DOUBLE_WITHIN(6e-4, 4.8664, atan2(a[0], hypot(a[1], a[2])) / degree);
    TEST_ASSERT_DOUBLE_WITHIN(6e-4, 2.0246, atan2(-a[1], -a[2]) / degree);
  }
  {
    /* The directions of the body's x and y axes: nose up makes x point to -z, right side down
       makes y point to +z. */
    const double *q = imu.attitude.world_from_body;
    const double nose_z = 2 * (q[1] * q[3] - q[0] * q[2]),
                 right_z = 2 * (q[2] * q[3] + q[0] * q[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -sin(2.974 * degree), nose_z);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, sin(0.550 * degree) * cos(2.974 * degree), right_z);
  }
}

static void test_gps_of_firmware_248_and_the_garbage_of_247(void) {
  size_t size;
  free(decode_fixture("navdata/navdata_full_gps248_2120.bin", &size));
  TEST_ASSERT_EQUAL_INT(ARDRONE_GPS_248, navdata.gps_form);
  TEST_ASSERT_EQUAL_UINT32(46179, navdata.checksum);
  TEST_ASSERT_DOUBLE_WITHIN(5e-8, 34.0905016, navdata.gps.latitude_deg);
  TEST_ASSERT_DOUBLE_WITHIN(5e-8, -118.2766877, navdata.gps.longitude_deg);
  TEST_ASSERT_DOUBLE_WITHIN(5e-3, 122.64, navdata.gps.elevation_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1, navdata.gps.hdop);
  TEST_ASSERT_EQUAL_UINT32(9, navdata.gps.num_satellites);
  free(decode_fixture("navdata/navdata_full_gps247_2384.bin", &size));
  TEST_ASSERT_EQUAL_INT(ARDRONE_GPS_247, navdata.gps_form);
  TEST_ASSERT_EQUAL_UINT32(57639, navdata.checksum);
  TEST_ASSERT_TRUE(navdata.gps.longitude_deg < -1e168);
  TEST_ASSERT_EQUAL_UINT32(0, navdata.gps.num_satellites);
}

static void test_the_bootstrap_packet(void) {
  size_t size;
  free(decode_fixture("navdata/navdata_bootstrap_24.bin", &size));
  TEST_ASSERT_EQUAL_HEX32(0x4f800c10, navdata.state);
  TEST_ASSERT_TRUE(navdata.state & ARDRONE_STATE_BOOTSTRAP);
  TEST_ASSERT_EQUAL_UINT32(1, navdata.sequence);
  TEST_ASSERT_EQUAL_UINT32(0, navdata.vision_defined);
  TEST_ASSERT_EQUAL_HEX32(0x2a6, navdata.checksum);
  TEST_ASSERT_EQUAL_HEX32(0, navdata.present);
}

/* Decodes a copy of exactly the prefix's length, so that the address sanitizer sees a read
   beyond it. */
static tvs_status decode_copy(const uint8_t *bytes, size_t size) {
  uint8_t *copy = malloc(size ? size : 1);
  tvs_status status;
  memcpy(copy, bytes, size);
  status = ardrone_navdata_decode(copy, size, &navdata);
  free(copy);
  return status;
}

static void test_every_prefix_of_a_packet_is_refused(void) {
  size_t size, k;
  uint8_t *bytes = fixture_read("navdata/navdata_full_landed_1916.bin", &size);
  for (k = 0; k < size; ++k) {
    TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, decode_copy(bytes, k));
  }
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode_copy(bytes, size));
  free(bytes);
}

static void test_every_flipped_byte_is_noticed(void) {
  size_t size, k;
  uint8_t *bytes = fixture_read("navdata/navdata_full_landed_1916.bin", &size);
  for (k = 0; k < size; ++k) {
    bytes[k] ^= 0x10;
    TEST_ASSERT_TRUE(TVS_OK != decode_copy(bytes, size));
    bytes[k] ^= 0x10;
  }
  free(bytes);
}

/* ---- tests of the captured video ---- */

typedef struct stream_facts {
  int packets, idr, p, gaps;
  uint64_t skipped;
  uint32_t first_number, last_number;
  uint64_t digest; /* a hash of every header field and payload byte, in order */
} stream_facts;

static void digest(uint64_t *sum, const void *bytes, size_t size) {
  const uint8_t *p = bytes;
  size_t k;
  for (k = 0; k < size; ++k) *sum = (*sum ^ p[k]) * UINT64_C(1099511628211);
}

static uint8_t video_buffer[ARDRONE_PAVE_BUFFER_BYTES];

static void drain(ardrone_pave_parser *parser, ardrone_pave_gate *gate, stream_facts *facts) {
  ardrone_pave_packet packet;
  while (ardrone_pave_next(parser, &packet) == TVS_OK) {
    const ardrone_pave_header *h = &packet.header;
    const int answer = ardrone_pave_gate_check(gate, h);
    if (facts->packets++ == 0) facts->first_number = h->frame_number;
    facts->last_number = h->frame_number;
    facts->idr += h->frame_type == ARDRONE_PAVE_IDR;
    facts->p += h->frame_type == ARDRONE_PAVE_P;
    facts->gaps += (answer & ARDRONE_PAVE_GAP) != 0;
    digest(&facts->digest, packet.bytes, packet.size);
    TEST_ASSERT_EQUAL_UINT(2, h->version);
    TEST_ASSERT_EQUAL_UINT(ARDRONE_PAVE_H264, h->codec);
    TEST_ASSERT_EQUAL_UINT(640, h->encoded_width);
    TEST_ASSERT_EQUAL_UINT(368, h->encoded_height);
    TEST_ASSERT_EQUAL_UINT(640, h->display_width);
    TEST_ASSERT_EQUAL_UINT(360, h->display_height);
    TEST_ASSERT_EQUAL_UINT32(h->payload_size, h->advertised_size);
    TEST_ASSERT_EQUAL_UINT(h->frame_type == ARDRONE_PAVE_IDR ? 14 : 0, h->sps_size);
    TEST_ASSERT_EQUAL_UINT(h->frame_type == ARDRONE_PAVE_IDR ? 10 : 0, h->pps_size);
  }
}

/* Feeds the stream in pieces of `step` bytes, after a first piece of `first` bytes. */
static stream_facts parse(const uint8_t *bytes, size_t size, size_t first, size_t step) {
  ardrone_pave_parser parser;
  ardrone_pave_gate gate = {0};
  stream_facts facts = {0};
  size_t piece = first;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_init(&parser, video_buffer, sizeof video_buffer));
  while (size > 0) {
    size_t room, take;
    uint8_t *to = ardrone_pave_space(&parser, &room);
    take = piece < size ? piece : size;
    if (take > room) take = room;
    TEST_ASSERT_TRUE(take > 0);
    memcpy(to, bytes, take);
    ardrone_pave_filled(&parser, take);
    bytes += take;
    size -= take;
    piece = step;
    drain(&parser, &gate, &facts);
  }
  ardrone_pave_clear(&parser);
  facts.skipped = parser.bytes_skipped;
  return facts;
}

static void check_splits(const uint8_t *bytes, size_t size, size_t stride) {
  const stream_facts whole = parse(bytes, size, size, size);
  stream_facts split = parse(bytes, size, 1, 1);
  size_t at;
  TEST_ASSERT_EQUAL_MEMORY(&whole, &split, sizeof whole);
  for (at = 1; at < size; at += stride) {
    split = parse(bytes, size, at, size);
    TEST_ASSERT_EQUAL_MEMORY(&whole, &split, sizeof whole);
  }
}

static void test_the_capture_of_517_frames(void) {
  size_t size;
  uint8_t *bytes = fixture_read("video/pave68_h264_360p_517frames.pave", &size);
  const stream_facts facts = parse(bytes, size, size, size);
  ardrone_pave_header header;
  TEST_ASSERT_EQUAL_INT(517, facts.packets);
  TEST_ASSERT_EQUAL_INT(35, facts.idr);
  TEST_ASSERT_EQUAL_INT(482, facts.p);
  TEST_ASSERT_EQUAL_INT(0, facts.gaps);
  TEST_ASSERT_EQUAL_UINT64(0, facts.skipped);
  TEST_ASSERT_EQUAL_UINT32(516, facts.last_number - facts.first_number);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_decode(bytes, size, &header));
  TEST_ASSERT_EQUAL_UINT(68, header.header_size);
  TEST_ASSERT_EQUAL_UINT32(2, header.extra);
  TEST_ASSERT_FLOAT_WITHIN(0.0011f, -0.04f, header.angles[0]);
  TEST_ASSERT_FLOAT_WITHIN(0.0011f, 0.0045f, header.angles[1]);
  TEST_ASSERT_FLOAT_WITHIN(0.0015f, -2.862f, header.angles[2]);
  free(bytes);
}

static void test_the_captures_of_20_and_5_frames(void) {
  size_t size;
  uint8_t *bytes = fixture_read("video/pave64_h264_360p_20frames.pave", &size);
  stream_facts facts = parse(bytes, size, size, size);
  TEST_ASSERT_EQUAL_INT(20, facts.packets);
  TEST_ASSERT_EQUAL_INT(2, facts.idr);
  TEST_ASSERT_EQUAL_INT(18, facts.p);
  TEST_ASSERT_EQUAL_INT(1, facts.gaps); /* the frame number jumps from 17368 to 17563 */
  TEST_ASSERT_EQUAL_UINT32(17368, facts.first_number);
  TEST_ASSERT_EQUAL_UINT64(0, facts.skipped);
  free(bytes);
  bytes = fixture_read("video/pave68_h264_360p_5frames.pave", &size);
  facts = parse(bytes, size, size, size);
  TEST_ASSERT_EQUAL_INT(5, facts.packets);
  TEST_ASSERT_EQUAL_INT(1, facts.idr);
  TEST_ASSERT_EQUAL_INT(4, facts.p);
  TEST_ASSERT_EQUAL_UINT64(0, facts.skipped);
  free(bytes);
}

static void test_a_stream_split_at_every_byte_gives_the_same_packets(void) {
  size_t size;
  uint8_t *bytes = fixture_read("video/pave68_h264_360p_5frames.pave", &size);
  check_splits(bytes, size, 1);
  free(bytes);
  bytes = fixture_read("video/pave64_h264_360p_20frames.pave", &size);
  check_splits(bytes, size, 7);
  free(bytes);
  bytes = fixture_read("video/pave68_h264_360p_517frames.pave", &size);
  check_splits(bytes, size, size / 16);
  free(bytes);
}

/* A connection may begin in the middle of a packet: from any byte on, the parser finds the next
   packet. */
static void test_a_stream_joined_at_any_byte_loses_one_packet(void) {
  size_t size, at;
  uint8_t *bytes = fixture_read("video/pave68_h264_360p_5frames.pave", &size);
  ardrone_pave_header first;
  size_t length;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pave_decode(bytes, size, &first));
  length = (size_t)first.header_size + first.payload_size;
  for (at = 1; at < length; ++at) {
    const stream_facts facts = parse(bytes + at, size - at, size, size);
    TEST_ASSERT_EQUAL_INT(4, facts.packets);
    TEST_ASSERT_EQUAL_UINT64(length - at, facts.skipped);
  }
  free(bytes);
}

int main(void) {
  fixtures_need();
  UNITY_BEGIN();
  RUN_TEST(test_every_byte_of_navdata_survives_decoding);
  RUN_TEST(test_the_landed_packet_has_the_values_of_the_sheet);
  RUN_TEST(test_the_accelerometer_agrees_with_the_angles_in_the_packet);
  RUN_TEST(test_gps_of_firmware_248_and_the_garbage_of_247);
  RUN_TEST(test_the_bootstrap_packet);
  RUN_TEST(test_every_prefix_of_a_packet_is_refused);
  RUN_TEST(test_every_flipped_byte_is_noticed);
  RUN_TEST(test_the_capture_of_517_frames);
  RUN_TEST(test_the_captures_of_20_and_5_frames);
  RUN_TEST(test_a_stream_split_at_every_byte_gives_the_same_packets);
  RUN_TEST(test_a_stream_joined_at_any_byte_loses_one_packet);
  return UNITY_END();
}
