/* Packets built by hand, as a hostile or an unknown firmware may send them. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "encode.h"

static uint8_t packet[ARDRONE_NAVDATA_MAX_BYTES];
static size_t size;
static ardrone_navdata navdata;

void setUp(void) { memset(&navdata, 0, sizeof navdata); }
void tearDown(void) {}

static void put16(size_t offset, unsigned value) {
  packet[offset] = (uint8_t)value;
  packet[offset + 1] = (uint8_t)(value >> 8);
}

static void put32(size_t offset, uint32_t value) {
  put16(offset, value & 0xffff);
  put16(offset + 2, value >> 16);
}

static void begin(uint32_t magic) {
  memset(packet, 0xee, sizeof packet);
  put32(0, magic);
  put32(4, 0x11);
  put32(8, 7);
  put32(12, 1);
  size = 16;
}

static void add_option(unsigned tag, unsigned option_size, unsigned fill) {
  put16(size, tag);
  put16(size + 2, option_size);
  if (option_size > 4) memset(packet + size + 4, (int)fill, option_size - 4);
  size += option_size;
}

static void end_packet(void) {
  uint32_t sum = 0;
  size_t k;
  for (k = 0; k < size; ++k) sum += packet[k];
  put16(size, 0xffff);
  put16(size + 2, 8);
  put32(size + 4, sum);
  size += 8;
}

static tvs_status decode(void) { return ardrone_navdata_decode(packet, size, &navdata); }

static void test_both_magics_and_no_other(void) {
  begin(0x55667788);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  begin(0x55667789);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  begin(0x5566778a);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, decode());
}

static void test_unknown_tags_and_sizes_are_passed_over(void) {
  const unsigned tags[] = {28, 29, 34866, 43150};
  size_t k;
  begin(0x55667788);
  for (k = 0; k < 4; ++k) add_option(tags[k], 10 + (unsigned)k, 1);
  add_option(27, 100, 1); /* a GPS option with the size of no known firmware */
  add_option(26, 8, 3);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  TEST_ASSERT_EQUAL_UINT32(5, navdata.num_unknown);
  TEST_ASSERT_EQUAL_HEX32(1u << 26, navdata.present);
  TEST_ASSERT_EQUAL_HEX32(0x03030303, navdata.wifi.link_quality);
}

static void test_option_sizes_below_4_are_refused(void) {
  unsigned bad;
  for (bad = 0; bad < 4; ++bad) {
    begin(0x55667788);
    add_option(1, 8, 1);
    put16(size - 8 + 2, bad);
    end_packet();
    memset(&navdata, 0x5a, sizeof navdata);
    TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, decode());
    TEST_ASSERT_EACH_EQUAL_HEX8(0x5a, &navdata, sizeof navdata); /* navdata was not written */
  }
}

static void test_longer_options_give_what_is_known_shorter_ones_nothing(void) {
  begin(0x55667788);
  add_option(1, 12, 0x21);
  add_option(9, 75, 1); /* option 9, one byte too short */
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  TEST_ASSERT_EQUAL_HEX32(1u << 1, navdata.present);
  TEST_ASSERT_EQUAL_HEX32(0x21212121, navdata.time.stamp);
  TEST_ASSERT_EQUAL_UINT32(1, navdata.num_short);
  TEST_ASSERT_EQUAL_UINT(0, navdata.pwm.motor[0]);
}

static void test_tag_27_goes_by_its_size(void) {
  const unsigned sizes[] = {12, 480, 216};
  size_t k;
  for (k = 0; k < 3; ++k) {
    begin(0x55667788);
    add_option(27, sizes[k], 0x40);
    end_packet();
    TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
    TEST_ASSERT_EQUAL_INT((int)k + 1, navdata.gps_form);
    TEST_ASSERT_EQUAL_INT(k == 0, navdata.gps.latitude_deg == 0);
    TEST_ASSERT_EQUAL_INT(k == 0, navdata.zimmu.vz != 0);
    TEST_ASSERT_EQUAL_INT(k == 2, navdata.gps.firmware != 0);
  }
}

/* Found by fuzzing: a packet with two forms of tag 27 filled both structs. */
static void test_of_a_tag_that_comes_twice_the_first_counts(void) {
  begin(0x55667788);
  add_option(27, 12, 1);
  add_option(27, 216, 2);
  add_option(1, 8, 1);
  add_option(1, 8, 2);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  TEST_ASSERT_EQUAL_INT(ARDRONE_GPS_ZIMMU, navdata.gps_form);
  TEST_ASSERT_EQUAL_UINT32(0, navdata.gps.firmware);
  TEST_ASSERT_EQUAL_HEX32(0x01010101, navdata.time.stamp);
  TEST_ASSERT_EQUAL_UINT32(2, navdata.num_unknown);
}

static void test_a_wrong_checksum_is_refused_and_nothing_used(void) {
  begin(0x55667788);
  add_option(1, 8, 1);
  end_packet();
  packet[21] ^= 1;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CHECKSUM, decode());
  TEST_ASSERT_EQUAL_UINT32(0, navdata.sequence);
}

/* The checksum of this packet is too large for a 16-bit number. */
static void test_a_packet_of_ones_has_its_sum(void) {
  begin(0x55667788);
  add_option(200, 4000, 0xff);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  TEST_ASSERT_TRUE(navdata.checksum > 3996 * 255);
}

static void test_bytes_after_the_checksum_are_refused(void) {
  begin(0x55667788);
  add_option(1, 8, 1);
  end_packet();
  ++size;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_DATA, decode());
}

static void test_a_short_packet_after_a_long_one_holds_nothing_of_it(void) {
  begin(0x55667788);
  add_option(0, 148, 0x11);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  TEST_ASSERT_TRUE(navdata.demo.battery_percent != 0);
  begin(0x55667788);
  end_packet();
  TEST_ASSERT_EQUAL_INT(TVS_OK, decode());
  TEST_ASSERT_EQUAL_UINT32(0, navdata.demo.battery_percent);
}

/* ---- tests of the order of packets by their sequence numbers ---- */

static ardrone_order check(ardrone_sequence *sequence, uint32_t number, uint32_t state) {
  navdata.sequence = number;
  navdata.state = state;
  return ardrone_sequence_check(sequence, &navdata);
}

static void test_order_gap_late_wrap_and_reboot(void) {
  ardrone_sequence s = {0};
  uint32_t k;
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_RESTART, check(&s, 0xfffffffe, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_NEXT, check(&s, 0xffffffff, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_NEXT, check(&s, 0, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_LATE, check(&s, 0, 0)); /* number 0 comes twice */
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_GAP, check(&s, 3, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_LATE, check(&s, 2, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_LATE, check(&s, 1, ARDRONE_STATE_COM_WATCHDOG));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_GAP, check(&s, 300711, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_RESTART, check(&s, 1, 0)); /* far back: the drone rebooted */
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_GAP, check(&s, 500, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_RESTART, check(&s, 1, ARDRONE_STATE_BOOTSTRAP));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_LATE, check(&s, 0, ARDRONE_STATE_BOOTSTRAP));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_GAP, check(&s, 500, 0));
  for (k = 1; k < 8; ++k) TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_LATE, check(&s, k, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_RESTART, check(&s, 8, 0));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ORDER_NEXT, check(&s, 9, 0));
}

/* ---- tests of the conversion to SI units ---- */

static tvs_imu imu;

static void convert(double psi0) {
  memset(&imu, 0x33, sizeof imu);
  imu.struct_size = sizeof imu;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_navdata_to_imu(&navdata, psi0, &imu));
}

static void test_units_frames_and_signs(void) {
  const double degree = 0.017453292519943295;
  navdata.state = ARDRONE_STATE_FLYING;
  navdata.present = 1u << 0 | 1u << 3 | 1u << 10 | 1u << 21;
  navdata.demo.psi_mdeg = 120000;
  navdata.demo.altitude_mm = 1234;
  navdata.demo.velocity_mm_s[0] = 1500;
  navdata.demo.velocity_mm_s[1] = -200;
  navdata.altitude.vz_mm_s = 300; /* positive is up */
  navdata.phys_measures.acceleration_mg[2] = -1000;
  navdata.phys_measures.rate_deg_s[1] = 90;
  navdata.pressure.pressure_pa = 101586;
  convert(30 * degree);
  TEST_ASSERT_EQUAL_UINT32(127, imu.valid);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, cos(45 * degree), imu.attitude.world_from_body[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, sin(45 * degree), imu.attitude.world_from_body[3]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.234, imu.altitude_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.5, imu.velocity_m_s[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.2, imu.velocity_m_s[1]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.3, imu.velocity_m_s[2]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -9.80665, imu.acceleration_m_s2[2]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 90 * degree, imu.rate_rad_s[1]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 101586, imu.pressure_pa);
}

/* With pitch and roll, a climb has components along all three axes of the body: the body's
   velocity must have the measured vertical component in the world. */
static void test_vertical_velocity_is_turned_into_the_body(void) {
  const double degree = 0.017453292519943295;
  navdata.state = ARDRONE_STATE_FLYING;
  navdata.present = 1u << 0 | 1u << 10;
  navdata.demo.theta_mdeg = 10000;
  navdata.demo.phi_mdeg = -20000;
  navdata.demo.velocity_mm_s[0] = 700;
  navdata.demo.velocity_mm_s[1] = 400;
  navdata.altitude.vz_mm_s = 250;
  convert(0);
  {
    const double *v = imu.velocity_m_s;
    const double down = -sin(10 * degree) * v[0] + cos(10 * degree) * sin(-20 * degree) * v[1] +
                        cos(10 * degree) * cos(-20 * degree) * v[2];
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -0.25, down);
  }
}

static void test_garbage_is_not_valid(void) {
  navdata.state = ARDRONE_STATE_FLYING;
  navdata.present = 1u << 0 | 1u << 3 | 1u << 21;
  navdata.demo.theta_mdeg = NAN;
  navdata.demo.altitude_mm = -5;
  navdata.demo.velocity_mm_s[0] = INFINITY;
  navdata.phys_measures.acceleration_mg[0] = NAN;
  navdata.phys_measures.rate_deg_s[2] = 1e9f;
  navdata.pressure.pressure_pa = 0;
  imu.struct_size = sizeof imu;
  TEST_ASSERT_EQUAL_INT(TVS_NONE, ardrone_navdata_to_imu(&navdata, 0, &imu));
  TEST_ASSERT_EQUAL_UINT32(0, imu.valid);
  imu.struct_size = 1;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, ardrone_navdata_to_imu(&navdata, 0, &imu));
}

static void test_a_deaf_ultrasound_gives_no_altitude(void) {
  memset(&navdata, 0, sizeof navdata);
  navdata.present = 1u << 0;
  navdata.demo.altitude_mm = 1234;
  navdata.state = ARDRONE_STATE_FLYING;
  convert(0);
  TEST_ASSERT_TRUE(imu.valid & TVS_IMU_ALTITUDE);
  navdata.state |= ARDRONE_STATE_ULTRASOUND_DEAF;
  convert(0);
  TEST_ASSERT_FALSE(imu.valid & TVS_IMU_ALTITUDE);
  TEST_ASSERT_TRUE(imu.valid & TVS_IMU_VELOCITY_XY);
}

static void test_on_the_ground_velocity_and_altitude_are_unknown(void) {
  navdata.present = 1u << 0;
  navdata.demo.altitude_mm = 243;
  convert(0);
  TEST_ASSERT_EQUAL_UINT32(TVS_IMU_ATTITUDE, imu.valid);
}

static void test_time_wraps_at_2048_seconds(void) {
  TEST_ASSERT_EQUAL_INT64(INT64_C(1662753000000),
                          ardrone_time_ns(ardrone_encode_time(INT64_C(7806753000000))));
  TEST_ASSERT_EQUAL_INT64(0, ardrone_time_ns(ardrone_encode_time(ARDRONE_TIME_PERIOD_NS)));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_both_magics_and_no_other);
  RUN_TEST(test_unknown_tags_and_sizes_are_passed_over);
  RUN_TEST(test_option_sizes_below_4_are_refused);
  RUN_TEST(test_longer_options_give_what_is_known_shorter_ones_nothing);
  RUN_TEST(test_tag_27_goes_by_its_size);
  RUN_TEST(test_of_a_tag_that_comes_twice_the_first_counts);
  RUN_TEST(test_a_wrong_checksum_is_refused_and_nothing_used);
  RUN_TEST(test_a_packet_of_ones_has_its_sum);
  RUN_TEST(test_bytes_after_the_checksum_are_refused);
  RUN_TEST(test_a_short_packet_after_a_long_one_holds_nothing_of_it);
  RUN_TEST(test_order_gap_late_wrap_and_reboot);
  RUN_TEST(test_units_frames_and_signs);
  RUN_TEST(test_vertical_velocity_is_turned_into_the_body);
  RUN_TEST(test_garbage_is_not_valid);
  RUN_TEST(test_a_deaf_ultrasound_gives_no_altitude);
  RUN_TEST(test_on_the_ground_velocity_and_altitude_are_unknown);
  RUN_TEST(test_time_wraps_at_2048_seconds);
  return UNITY_END();
}
