/* Configuration text, keys and values, and the acknowledge handshake with a drone that may lose
   any of its messages. */
#include <locale.h>
#include <math.h>
#include <string.h>
#include <unity.h>

#include "twoview_drivers/ardrone/config.h"
#include "twoview_drivers/ardrone/navdata.h"

void setUp(void) {}
void tearDown(void) {}

static const char text[] =
    "general:num_version_soft = 2.4.8\n"
    "no key here\n"
    "control:accs_offset = { -2048 2048 2048 }\r\n"
    "\n"
    "general:ardrone_name = My = drone \n"
    "general:empty = \n"
    "custom:session_id = 0a1b2c3d\0 after:the = end\n";

static void test_configuration_text(void) {
  char value[64];
  ardrone_span key, what;
  size_t offset = 0;
  int num = 0;
  while (ardrone_config_next(text, sizeof text, &offset, &key, &what) == TVS_OK) ++num;
  TEST_ASSERT_EQUAL_INT(5, num);
#define FIND(name) ardrone_config_find(text, sizeof text, name, value, sizeof value)
  TEST_ASSERT_EQUAL_INT(TVS_OK, FIND("general:num_version_soft"));
  TEST_ASSERT_EQUAL_STRING("2.4.8", value);
  TEST_ASSERT_EQUAL_INT(TVS_OK, FIND("control:accs_offset"));
  TEST_ASSERT_EQUAL_STRING("{ -2048 2048 2048 }", value);
  TEST_ASSERT_EQUAL_INT(TVS_OK, FIND("general:ardrone_name"));
  TEST_ASSERT_EQUAL_STRING("My = drone", value);
  TEST_ASSERT_EQUAL_INT(TVS_OK, FIND("general:empty"));
  TEST_ASSERT_EQUAL_STRING("", value);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, FIND("after:the"));
  TEST_ASSERT_EQUAL_INT(
      TVS_ERR_CAPACITY,
      ardrone_config_find(text, sizeof text, "general:num_version_soft", value, 5));
  TEST_ASSERT_EQUAL_INT(
      TVS_OK, ardrone_config_find(text, sizeof text, "general:num_version_soft", value, 6));
}

static void test_configuration_text_cut_anywhere(void) {
  size_t cut;
  for (cut = 0; cut < sizeof text; ++cut) {
    ardrone_span key, what;
    size_t offset = 0;
    while (ardrone_config_next(text, cut, &offset, &key, &what) == TVS_OK) {
      TEST_ASSERT_TRUE(what.text + what.size <= text + cut);
    }
  }
}

static void test_id_list(void) {
  const char list[] =
      "[applis]\r00000000,Default\r0a1b2c3d,twoview\r[profiles]\r11111111,user\r[sessions]\r"
      "22222222,now\r";
  ardrone_id_kind kind = ARDRONE_ID_APPLICATION;
  ardrone_span id, what;
  size_t offset = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_ids_next(list, sizeof list, &offset, &kind, &id, &what));
  TEST_ASSERT_EQUAL_MEMORY("00000000", id.text, 8);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_ids_next(list, sizeof list, &offset, &kind, &id, &what));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ID_APPLICATION, kind);
  TEST_ASSERT_EQUAL_UINT64(7, what.size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_ids_next(list, sizeof list, &offset, &kind, &id, &what));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ID_PROFILE, kind);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_ids_next(list, sizeof list, &offset, &kind, &id, &what));
  TEST_ASSERT_EQUAL_INT(ARDRONE_ID_SESSION, kind);
  TEST_ASSERT_EQUAL_INT(TVS_END, ardrone_ids_next(list, sizeof list, &offset, &kind, &id, &what));
}

static void test_keys_know_their_range(void) {
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_config_check("general:navdata_demo", "TRUE"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("general:navdata_demo", "true"));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_config_check("control:euler_angle_max", "0.21"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("control:euler_angle_max", "0,21"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("control:euler_angle_max", "0.6"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("control:euler_angle_max", "nan"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("video:codec_fps", "31"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("video:codec_fps", "15.5"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("general:drone_serial", "1"));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_config_check("gps:latitude", "-34.090501600"));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_config_check("gps:latitude", "500.0"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("gps:latitude", "91"));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_config_check("custom:session_id", "-all"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("custom:session_id", "xyz"));
  TEST_ASSERT_EQUAL_INT(TVS_NONE, ardrone_config_check("new:key", "of another firmware"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_config_check("new:key", "a\"b"));
  TEST_ASSERT_TRUE(ardrone_config_needs_ids("video:video_codec"));
  TEST_ASSERT_FALSE(ardrone_config_needs_ids("general:navdata_demo"));
}

static void test_numbers_have_a_dot_whatever_the_locale(void) {
  char number[40];
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_format_number(0.21, 6, number, sizeof number));
  TEST_ASSERT_EQUAL_STRING("0.210000", number);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_format_number(-118.2766877, 9, number, sizeof number));
  TEST_ASSERT_EQUAL_STRING("-118.276687700", number);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_format_number(-0.0, 0, number, sizeof number));
  TEST_ASSERT_EQUAL_STRING("0", number);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_format_number(NAN, 6, number, sizeof number));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_format_number(1e9, 6, number, sizeof number));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, ardrone_format_number(1, 6, number, 8));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_format_led(3, 2.0f, 5, number, sizeof number));
  TEST_ASSERT_EQUAL_STRING("3,1073741824,5", number);
}

static void test_ids_are_crc_32(void) {
  char id[ARDRONE_ID_BYTES];
  ardrone_make_id("123456789", id); /* the usual check of a CRC-32: these digits give cbf43926 */
  TEST_ASSERT_EQUAL_STRING("cbf43926", id);
  ardrone_make_id("", id); /* its CRC is 0, the default configuration's id, so 1 is used */
  TEST_ASSERT_EQUAL_STRING("00000001", id);
}

/* ---- tests of the handshake that sets one configuration value ---- */

#define MS INT64_C(1000000)

/* A drone with one acknowledge bit. It loses message k (0 to 31, and again from 32 on) if bit k
   of `lost` is set. */
typedef struct mock {
  int acknowledged, num_config, num_messages;
  uint32_t lost;
} mock;

static void receive(mock *drone, const ardrone_at *at) {
  char all[ARDRONE_AT_MAX_BYTES + 1];
  if (at->size == 0) return;
  if (drone->lost >> (drone->num_messages++ % 32) & 1) return;
  memcpy(all, at->text, at->size);
  all[at->size] = '\0';
  if (strstr(all, "AT*CONFIG=")) {
    ++drone->num_config;
    drone->acknowledged = 1;
  }
  if (strstr(all, ",5,0\r")) drone->acknowledged = 0;
}

static ardrone_exchange_state run_exchange(ardrone_exchange *exchange, mock *drone) {
  int64_t now = 0;
  ardrone_at at;
  int32_t last = 0;
  memset(&at, 0, sizeof at);
  for (; now < 6000 * MS; now += 30 * MS) {
    ardrone_exchange_navdata(exchange, drone->acknowledged ? ARDRONE_STATE_ACKNOWLEDGE : 0, now);
    at.size = 0;
    TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_exchange_tick(exchange, &at, now));
    TEST_ASSERT_TRUE(at.sequence >= last);
    last = at.sequence;
    receive(drone, &at);
    if (exchange->state >= ARDRONE_EXCHANGE_DONE) break;
  }
  return exchange->state;
}

static void begin_set(ardrone_exchange *exchange) {
  static const char *const ids[3] = {"00000001", "00000002", "00000003"};
  memset(exchange, 0, sizeof *exchange);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_exchange_begin(exchange, ARDRONE_EXCHANGE_SET,
                                                       "video:video_codec", "131", ids, 0));
}

static void test_the_handshake_completes_whatever_single_message_is_lost(void) {
  int lost, old_bit;
  for (old_bit = 0; old_bit < 2; ++old_bit) {
    for (lost = 0; lost < 8; ++lost) {
      mock drone = {0};
      ardrone_exchange exchange;
      drone.acknowledged = old_bit; /* an earlier client may have left the bit set */
      drone.lost = 1u << lost;
      begin_set(&exchange);
      TEST_ASSERT_EQUAL_INT(ARDRONE_EXCHANGE_DONE, run_exchange(&exchange, &drone));
      TEST_ASSERT_EQUAL_INT(1, drone.num_config);
      TEST_ASSERT_EQUAL_INT(0, drone.acknowledged);
    }
  }
}

/* Only what is needed is sent: the value, then the release of the bit; where an old bit is still
   set, a release before the value. */
static void test_a_good_link_takes_two_messages(void) {
  int old_bit;
  for (old_bit = 0; old_bit < 2; ++old_bit) {
    mock drone = {0};
    ardrone_exchange exchange;
    ardrone_at at;
    drone.acknowledged = old_bit;
    memset(&at, 0, sizeof at);
    begin_set(&exchange);
    TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_exchange_tick(&exchange, &at, 0));
    /* The exchange sends nothing before the drone has reported its acknowledgement bit. */
    TEST_ASSERT_EQUAL_UINT64(0, at.size);
    TEST_ASSERT_EQUAL_INT(ARDRONE_EXCHANGE_DONE, run_exchange(&exchange, &drone));
    TEST_ASSERT_EQUAL_INT(2 + old_bit, drone.num_messages);
  }
}

static void test_a_deaf_drone_fails_in_time(void) {
  mock drone = {0};
  ardrone_exchange exchange;
  drone.lost = 0xffffffff;
  begin_set(&exchange);
  TEST_ASSERT_EQUAL_INT(ARDRONE_EXCHANGE_FAILED, run_exchange(&exchange, &drone));
  TEST_ASSERT_EQUAL_INT(10, exchange.num_sent);
}

static void test_ids_and_command_share_a_datagram(void) {
  ardrone_exchange exchange;
  ardrone_at at;
  memset(&at, 0, sizeof at);
  begin_set(&exchange);
  ardrone_exchange_navdata(&exchange, 0, 0);
  at.size = 950; /* too full for the ids and the command together */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, ardrone_exchange_tick(&exchange, &at, 0));
  TEST_ASSERT_EQUAL_UINT64(950, at.size);
  TEST_ASSERT_EQUAL_INT32(0, at.sequence);
  at.size = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_exchange_tick(&exchange, &at, 0));
  at.text[at.size] = '\0';
  TEST_ASSERT_EQUAL_STRING(
      "AT*CONFIG_IDS=1,\"00000001\",\"00000002\",\"00000003\"\r"
      "AT*CONFIG=2,\"video:video_codec\",\"131\"\r",
      at.text);
}

static void test_one_exchange_at_a_time_and_no_bad_value(void) {
  ardrone_exchange exchange;
  begin_set(&exchange);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_exchange_begin(&exchange, ARDRONE_EXCHANGE_READ_IDS,
                                                              NULL, NULL, NULL, 0));
  memset(&exchange, 0, sizeof exchange);
  TEST_ASSERT_EQUAL_INT(
      TVS_ERR_ARGUMENT,
      ardrone_exchange_begin(&exchange, ARDRONE_EXCHANGE_SET, "video:codec_fps", "100", NULL, 0));
}

int main(void) {
  setlocale(LC_ALL, "de_DE.UTF-8");
  UNITY_BEGIN();
  RUN_TEST(test_configuration_text);
  RUN_TEST(test_configuration_text_cut_anywhere);
  RUN_TEST(test_id_list);
  RUN_TEST(test_keys_know_their_range);
  RUN_TEST(test_numbers_have_a_dot_whatever_the_locale);
  RUN_TEST(test_ids_are_crc_32);
  RUN_TEST(test_the_handshake_completes_whatever_single_message_is_lost);
  RUN_TEST(test_a_good_link_takes_two_messages);
  RUN_TEST(test_a_deaf_drone_fails_in_time);
  RUN_TEST(test_ids_and_command_share_a_datagram);
  RUN_TEST(test_one_exchange_at_a_time_and_no_bad_value);
  return UNITY_END();
}
