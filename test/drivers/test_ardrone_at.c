/* The text of every command, the rules of sequence numbers, and what the pilot sends and when. */
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pilot.h"

static ardrone_at at;

void setUp(void) { memset(&at, 0, sizeof at); }
void tearDown(void) {}

static void check_text(const ardrone_at *written, const char *expected) {
  TEST_ASSERT_EQUAL_UINT64(strlen(expected), written->size);
  TEST_ASSERT_EQUAL_MEMORY(expected, written->text, written->size);
}

#define CHECK(call, expected)            \
  do {                                   \
    memset(&at, 0, sizeof at);           \
    TEST_ASSERT_EQUAL_INT(TVS_OK, call); \
    check_text(&at, expected);           \
  } while (0)

static void test_each_command_has_its_text(void) {
  const ardrone_move move = {-0.8f, 0.5f, -1.0f, 0.0f};
  const int32_t numbers[22] = {2, 20, -2000, 3000};
  CHECK(ardrone_at_ref(&at, 0, 0), "AT*REF=1,290717696\r");
  CHECK(ardrone_at_ref(&at, 1, 0), "AT*REF=1,290718208\r");
  CHECK(ardrone_at_ref(&at, 0, 1), "AT*REF=1,290717952\r");
  CHECK(ardrone_at_pcmd(&at, NULL, 0), "AT*PCMD=1,0,0,0,0,0\r");
  CHECK(ardrone_at_pcmd(&at, &move, 0), "AT*PCMD=1,1,-1085485875,1056964608,-1082130432,0\r");
  CHECK(ardrone_at_pcmd(&at, &move, ARDRONE_PCMD_COMBINED_YAW),
        "AT*PCMD=1,3,-1085485875,1056964608,-1082130432,0\r");
  CHECK(ardrone_at_pcmd_mag(&at, &move, ARDRONE_PCMD_ABSOLUTE, 0.5f, 1.0f),
        "AT*PCMD_MAG=1,5,-1085485875,1056964608,-1082130432,0,1056964608,1065353216\r");
  CHECK(ardrone_at_ftrim(&at), "AT*FTRIM=1\r");
  CHECK(ardrone_at_calib(&at, 0), "AT*CALIB=1,0\r");
  CHECK(ardrone_at_comwdg(&at), "AT*COMWDG=1\r");
  CHECK(ardrone_at_config(&at, "general:navdata_demo", "TRUE"),
        "AT*CONFIG=1,\"general:navdata_demo\",\"TRUE\"\r");
  CHECK(ardrone_at_config(&at, "control:flight_anim", "16,15"),
        "AT*CONFIG=1,\"control:flight_anim\",\"16,15\"\r");
  CHECK(ardrone_at_config_ids(&at, "0a1b2c3d", "00000001", "FFFFFFFF"),
        "AT*CONFIG_IDS=1,\"0a1b2c3d\",\"00000001\",\"FFFFFFFF\"\r");
  CHECK(ardrone_at_ctrl(&at, ARDRONE_CTRL_ACKNOWLEDGE), "AT*CTRL=1,5,0\r");
  CHECK(ardrone_at_ctrl(&at, ARDRONE_CTRL_SEND_CONFIG), "AT*CTRL=1,4,0\r");
  CHECK(ardrone_at_ctrl(&at, ARDRONE_CTRL_SEND_IDS), "AT*CTRL=1,6,0\r");
  CHECK(ardrone_at_anim(&at, 19, 15), "AT*ANIM=1,19,15\r");
  CHECK(ardrone_at_led(&at, 0, 2.0f, 3), "AT*LED=1,0,1073741824,3\r");
  CHECK(ardrone_at_legacy(&at, ARDRONE_PMODE, numbers, 1), "AT*PMODE=1,2\r");
  CHECK(ardrone_at_legacy(&at, ARDRONE_MISC, numbers, 4), "AT*MISC=1,2,20,-2000,3000\r");
  CHECK(ardrone_at_legacy(&at, ARDRONE_AFLIGHT, numbers, 1), "AT*AFLIGHT=1,2\r");
  CHECK(ardrone_at_legacy(&at, ARDRONE_VICON, numbers, 22),
        "AT*VICON=1,2,20,-2000,3000,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\r");
}

static void test_floats_are_their_bits(void) {
  TEST_ASSERT_EQUAL_INT32(-1085485875, ardrone_float_bits(-0.8f));
  TEST_ASSERT_EQUAL_INT32(1056964608, ardrone_float_bits(0.5f));
  TEST_ASSERT_EQUAL_INT32(-1082130432, ardrone_float_bits(-1.0f));
  TEST_ASSERT_EQUAL_INT32(0, ardrone_float_bits(-0.0f));
}

#define REFUSED(call) TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, call)

static void test_values_out_of_range_are_refused_and_use_no_number(void) {
  const float bad[] = {1.0001f, -1.0001f, NAN, INFINITY, -INFINITY};
  const int32_t numbers[4] = {0};
  char long_key[70], long_value[300];
  size_t k;
  for (k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    const ardrone_move roll = {bad[k], 0, 0, 0}, pitch = {0, bad[k], 0, 0};
    const ardrone_move climb = {0, 0, bad[k], 0}, turn = {0, 0, 0, bad[k]};
    REFUSED(ardrone_at_pcmd(&at, &roll, 0));
    REFUSED(ardrone_at_pcmd(&at, &pitch, 0));
    REFUSED(ardrone_at_pcmd(&at, &climb, 0));
    REFUSED(ardrone_at_pcmd(&at, &turn, 0));
    REFUSED(ardrone_at_pcmd_mag(&at, NULL, 0, bad[k], 0));
    REFUSED(ardrone_at_pcmd_mag(&at, NULL, 0, 0, bad[k]));
  }
  REFUSED(ardrone_at_pcmd(&at, NULL, 1));
  REFUSED(ardrone_at_pcmd(&at, NULL, 8));
  REFUSED(ardrone_at_calib(&at, 1));
  REFUSED(ardrone_at_ctrl(&at, (ardrone_control_mode)1));
  REFUSED(ardrone_at_anim(&at, 20, 15));
  REFUSED(ardrone_at_anim(&at, -1, 15));
  REFUSED(ardrone_at_anim(&at, 0, 60001));
  REFUSED(ardrone_at_led(&at, 21, 1, 1));
  REFUSED(ardrone_at_led(&at, 0, 0, 1));
  REFUSED(ardrone_at_led(&at, 0, NAN, 1));
  REFUSED(ardrone_at_led(&at, 0, 1, -1));
  REFUSED(ardrone_at_config_ids(&at, "0a1b2c3", "00000001", "00000001"));
  REFUSED(ardrone_at_config_ids(&at, "0a1b2c3g", "00000001", "00000001"));
  REFUSED(ardrone_at_legacy(&at, ARDRONE_MISC, numbers, 3));
  REFUSED(ardrone_at_legacy(&at, ARDRONE_NUM_LEGACY, numbers, 1));
  REFUSED(ardrone_at_config(&at, "nosection", "1"));
  REFUSED(ardrone_at_config(&at, ":a", "1"));
  REFUSED(ardrone_at_config(&at, "a:", "1"));
  REFUSED(ardrone_at_config(&at, "a:b\"", "1"));
  REFUSED(ardrone_at_config(&at, "a:b", "x\"\rAT*REF=9,290718208\r"));
  REFUSED(ardrone_at_config(&at, "a:b", "x\ry"));
  memset(long_key, 'k', sizeof long_key);
  long_key[1] = ':';
  long_key[65] = '\0';
  REFUSED(ardrone_at_config(&at, long_key, "1"));
  memset(long_value, 'v', sizeof long_value);
  long_value[257] = '\0';
  REFUSED(ardrone_at_config(&at, "a:b", long_value));
  TEST_ASSERT_EQUAL_INT32(0, at.sequence);
  TEST_ASSERT_EQUAL_UINT64(0, at.size);
  long_key[64] = long_value[256] = '\0';
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_at_config(&at, long_key, long_value));
}

static void test_a_datagram_never_exceeds_1024_bytes(void) {
  int num = 0;
  size_t before = 0;
  while (ardrone_at_comwdg(&at) == TVS_OK) {
    ++num;
    before = at.size;
  }
  TEST_ASSERT_TRUE(at.size <= 1024 && at.size > 1000);
  TEST_ASSERT_EQUAL_UINT64(before, at.size);
  TEST_ASSERT_EQUAL_INT32(num, at.sequence);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, ardrone_at_comwdg(&at));
  TEST_ASSERT_EQUAL_INT('\r', at.text[at.size - 1]);
}

static void test_the_sequence_starts_again_before_it_overflows(void) {
  at.sequence = INT32_MAX - 2;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_at_comwdg(&at));
  check_text(&at, "AT*COMWDG=2147483646\r");
  at.size = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_at_comwdg(&at));
  check_text(&at, "AT*COMWDG=1\r");
}

/* ---- tests of the pilot, which repeats the flight commands ---- */

#define MS INT64_C(1000000)
static ardrone_pilot pilot;
static int64_t now;
static const uint32_t READY = ARDRONE_STATE_NAVDATA_THREAD;

static int holds(const char *part) {
  char text[ARDRONE_AT_MAX_BYTES + 1];
  memcpy(text, pilot.at.text, pilot.at.size);
  text[pilot.at.size] = '\0';
  return strstr(text, part) != NULL;
}

/* The value of the REF command that the last tick wrote, or 0 when it wrote none. */
static long ref_value(void) {
  char text[ARDRONE_AT_MAX_BYTES + 1];
  const char *found;
  memcpy(text, pilot.at.text, pilot.at.size);
  text[pilot.at.size] = '\0';
  found = strstr(text, "AT*REF=");
  return found ? strtol(strchr(found, ',') + 1, NULL, 10) : 0;
}

enum { LAND = 290717696, FLY = 290718208, EMERGENCY_BIT = 1 << 8 };

static void tick(uint32_t state) {
  now += ARDRONE_TICK_NS;
  ardrone_pilot_state(&pilot, state, now);
  TEST_ASSERT_EQUAL_INT(1, ardrone_pilot_tick(&pilot, now));
}

static void begin_pilot(void) {
  now = 5 * MS;
  ardrone_pilot_init(&pilot);
}

static void test_an_idle_pilot_keeps_alive_and_nothing_else(void) {
  int k;
  begin_pilot();
  for (k = 0; k < 100; ++k) {
    tick(READY);
    TEST_ASSERT_TRUE(holds("AT*COMWDG="));
    TEST_ASSERT_FALSE(holds("REF") || holds("PCMD"));
  }
  TEST_ASSERT_EQUAL_INT(0, ardrone_pilot_tick(&pilot, now + 29 * MS));
  TEST_ASSERT_EQUAL_INT(1, ardrone_pilot_tick(&pilot, now + 30 * MS));
}

static void take_off_and_fly(void) {
  tick(READY);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_take_off(&pilot, now));
  tick(READY);
  TEST_ASSERT_EQUAL_INT(FLY, ref_value());
  tick(READY | ARDRONE_STATE_FLYING);
  TEST_ASSERT_EQUAL_INT(FLY, ref_value());
}

static void test_take_off_is_level_and_land_ends_it(void) {
  begin_pilot();
  /* no navdata yet, so take-off is refused */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_pilot_take_off(&pilot, now));
  take_off_and_fly();
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_land(&pilot));
  tick(READY | ARDRONE_STATE_FLYING);
  TEST_ASSERT_EQUAL_INT(LAND, ref_value());
}

static void test_a_drone_that_came_down_is_not_sent_up_again(void) {
  begin_pilot();
  take_off_and_fly();
  tick(READY); /* not flying any more: the drone landed by itself */
  TEST_ASSERT_EQUAL_INT(LAND, ref_value());
  begin_pilot();
  take_off_and_fly();
  ardrone_pilot_new_link(&pilot);
  TEST_ASSERT_EQUAL_INT32(0, pilot.at.sequence);
  tick(READY | ARDRONE_STATE_FLYING);
  TEST_ASSERT_EQUAL_INT(LAND, ref_value());
  begin_pilot();
  take_off_and_fly();
  tick(READY | ARDRONE_STATE_FLYING | ARDRONE_STATE_EMERGENCY);
  TEST_ASSERT_EQUAL_INT(LAND, ref_value());
  tick(READY); /* no emergency any more: the drone was re-armed */
  TEST_ASSERT_EQUAL_INT(LAND, ref_value());
}

static void test_a_take_off_that_does_not_leave_the_ground_ends(void) {
  begin_pilot();
  tick(READY);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_take_off(&pilot, now));
  now += 19000 * MS;
  tick(READY);
  TEST_ASSERT_EQUAL_INT(FLY, ref_value());
  now += 1000 * MS;
  tick(READY);
  TEST_ASSERT_EQUAL_INT(LAND, ref_value());
}

static void test_a_movement_becomes_hover(void) {
  const ardrone_move forward = {0, -0.5f, 0, 0};
  int k;
  begin_pilot();
  tick(READY);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_pilot_move(&pilot, &forward, now));
  take_off_and_fly();
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_move(&pilot, &forward, now));
  for (k = 0; k < 16; ++k) {
    tick(READY | ARDRONE_STATE_FLYING);
    TEST_ASSERT_TRUE(holds(",1,0,-1090519040,0,0\r"));
  }
  tick(READY | ARDRONE_STATE_FLYING);
  TEST_ASSERT_TRUE(holds(",0,0,0,0,0\r"));
}

/* Counts the rising edges of the emergency bit over this many ticks. */
static int count_edges(int ticks, uint32_t state) {
  int edges = 0, last = 0, k;
  for (k = 0; k < ticks; ++k) {
    int bit;
    tick(state);
    bit = (ref_value() & EMERGENCY_BIT) != 0;
    edges += bit && !last;
    last = bit;
  }
  return edges;
}

static void test_the_emergency_bit_is_an_edge(void) {
  begin_pilot();
  take_off_and_fly();
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_cut_motors(&pilot, now));
  tick(READY | ARDRONE_STATE_FLYING);
  TEST_ASSERT_EQUAL_INT(LAND | EMERGENCY_BIT, ref_value());
  /* The drone reports the emergency, so the pilot clears the bit at once and does not set it
     again. */
  tick(READY | ARDRONE_STATE_EMERGENCY);
  TEST_ASSERT_EQUAL_INT(0, count_edges(200, READY | ARDRONE_STATE_EMERGENCY));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_pilot_take_off(&pilot, now));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_rearm(&pilot, now));
  tick(READY | ARDRONE_STATE_EMERGENCY);
  TEST_ASSERT_EQUAL_INT(LAND | EMERGENCY_BIT, ref_value());
  TEST_ASSERT_EQUAL_INT(0, count_edges(200, READY));
  /* The drone reports no emergency, so rearm sends no pulse of the bit. */
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_rearm(&pilot, now));
  TEST_ASSERT_EQUAL_INT(0, count_edges(50, READY));
}

static void test_a_lost_pulse_is_repeated_while_the_drone_says_so(void) {
  int edges = 0, last = 0, k;
  begin_pilot();
  take_off_and_fly();
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_cut_motors(&pilot, now));
  /* The drone flies on, so the pilot repeats the pulse: five times within 3 s. */
  TEST_ASSERT_EQUAL_INT(5, count_edges(200, READY | ARDRONE_STATE_FLYING));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_cut_motors(&pilot, now));
  for (k = 0; k < 200;
       /* while the drone reports nothing only one pulse is sent, since a second one might undo
          the first */
       ++k) {
    int bit;
    now += ARDRONE_TICK_NS;
    TEST_ASSERT_EQUAL_INT(1, ardrone_pilot_tick(&pilot, now));
    bit = (ref_value() & EMERGENCY_BIT) != 0;
    edges += bit && !last;
    last = bit;
  }
  TEST_ASSERT_EQUAL_INT(1, edges);
}

static void test_the_watchdog_bit_is_answered(void) {
  begin_pilot();
  take_off_and_fly();
  TEST_ASSERT_FALSE(holds("COMWDG"));
  tick(READY | ARDRONE_STATE_FLYING | ARDRONE_STATE_COM_WATCHDOG);
  TEST_ASSERT_TRUE(holds("COMWDG") && holds("REF") && holds("PCMD"));
}

static void test_flat_trim_only_on_the_ground(void) {
  int trims = 0, k;
  begin_pilot();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_pilot_flat_trim(&pilot));
  tick(READY);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_pilot_flat_trim(&pilot));
  for (k = 0; k < 30; ++k) {
    tick(READY);
    trims += holds("FTRIM");
  }
  TEST_ASSERT_EQUAL_INT(10, trims);
  take_off_and_fly();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_pilot_flat_trim(&pilot));
}

int main(void) {
  setlocale(LC_ALL, "de_DE.UTF-8"); /* writes a decimal comma; ignored if not installed */
  UNITY_BEGIN();
  RUN_TEST(test_each_command_has_its_text);
  RUN_TEST(test_floats_are_their_bits);
  RUN_TEST(test_values_out_of_range_are_refused_and_use_no_number);
  RUN_TEST(test_a_datagram_never_exceeds_1024_bytes);
  RUN_TEST(test_the_sequence_starts_again_before_it_overflows);
  RUN_TEST(test_an_idle_pilot_keeps_alive_and_nothing_else);
  RUN_TEST(test_take_off_is_level_and_land_ends_it);
  RUN_TEST(test_a_drone_that_came_down_is_not_sent_up_again);
  RUN_TEST(test_a_take_off_that_does_not_leave_the_ground_ends);
  RUN_TEST(test_a_movement_becomes_hover);
  RUN_TEST(test_the_emergency_bit_is_an_edge);
  RUN_TEST(test_a_lost_pulse_is_repeated_while_the_drone_says_so);
  RUN_TEST(test_the_watchdog_bit_is_answered);
  RUN_TEST(test_flat_trim_only_on_the_ground);
  return UNITY_END();
}
