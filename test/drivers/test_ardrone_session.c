/* A session with the simulated drone of support/ardrone_mock.h, in virtual time. */
#include <stdio.h>

#include "support/ardrone_mock.h"

enum { STEP_MS = 4 };

static mock_drone drone;
static mock_decoder own_decoder;
static tvs_decoder decoder;
static ardrone_session *session;
static void *memory;
static int64_t now;
static int num_events[ARDRONE_EVENT_READ_FAILED + 1];
static tvs_frame_source frames;

static void count_event(void *user, ardrone_event event, const char *key) {
  (void)user;
  (void)key;
  ++num_events[event];
}

/* The yaw that the session takes as 0, computed from each packet by the observer below. */
static double psi0;

static void take_psi0(void *user, const uint8_t *bytes, size_t size, const ardrone_navdata *navdata,
                      const tvs_imu *imu) {
  (void)user;
  (void)bytes;
  (void)size;
  if ((imu->valid & TVS_IMU_ATTITUDE) == 0) return;
  psi0 = navdata->demo.psi_mdeg / 57.29577951308232e3 -
         2 * atan2(imu->attitude.world_from_body[3], imu->attitude.world_from_body[0]);
}

static ardrone_session_options default_options(void) {
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.decoder = &decoder;
  options.on_event = count_event;
  options.on_navdata = take_psi0;
  options.skip_to_latest = 0;
  return options;
}

static void start(const ardrone_session_options *options) {
  const ardrone_transport transport = mock_transport(&drone);
  size_t size;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_size(options, &size));
  memory = malloc(size);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY,
                        ardrone_session_init(&session, options, &transport, memory, size - 1));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_init(&session, options, &transport, memory, size));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_frames(session, &frames));
}

void setUp(void) {
  now = 1000 * MOCK_MS;
  memset(num_events, 0, sizeof num_events);
  mock_init(&drone, 7);
  drone.now_ns = now;
  mock_boot(&drone);
  decoder = mock_decoder_of(&own_decoder);
  session = NULL;
  memory = NULL;
}

void tearDown(void) {
  ardrone_session_close(session);
  free(memory);
}

static void step(void) {
  now += STEP_MS * MOCK_MS;
  mock_advance(&drone, now);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_step(session, now));
}

/* Steps for this long and discards the pictures. Returns how many there were. */
static int run_ms(int64_t ms) {
  const int64_t end = now + ms * MOCK_MS;
  tvs_frame frame;
  int num = 0;
  frame.struct_size = sizeof frame;
  while (now < end) {
    step();
    while (frames.next(frames.user, &frame) == TVS_OK) {
      ++num;
      frames.release(frames.user, &frame);
    }
  }
  return num;
}

static void start_default(void) {
  const ardrone_session_options options = default_options();
  start(&options);
}

static void test_it_ends_the_bootstrap_and_asks_for_nothing_else(void) {
  start_default();
  run_ms(1500);
  TEST_ASSERT_TRUE(ardrone_session_is_up(session));
  TEST_ASSERT_EQUAL_INT(1, num_events[ARDRONE_EVENT_LINK_UP]);
  TEST_ASSERT_EQUAL_INT(1, drone.full);
  TEST_ASSERT_EQUAL_INT(0, drone.acknowledged);
  TEST_ASSERT_EQUAL_INT(2, drone.num_configs);
  TEST_ASSERT_EQUAL_STRING("general:navdata_options", drone.last_key);
  /* No flight was requested, so the session sent no command of flight. */
  TEST_ASSERT_EQUAL_INT(0, drone.num_refs + drone.num_pcmds);
  /* Yet the session sends the commands that clear the drone's watchdog. */
  TEST_ASSERT_TRUE(drone.num_commands > 30);
  TEST_ASSERT_NOT_NULL(ardrone_session_navdata(session));
  TEST_ASSERT_EQUAL_UINT32(77, ardrone_session_navdata(session)->demo.battery_percent);
}

static void test_720p_needs_ids_and_gets_them(void) {
  ardrone_session_options options = default_options();
  start(&options);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_session_set(session, "video:video_codec", "131"));
  tearDown();
  setUp();
  options = default_options();
  options.video_codec = ARDRONE_VIDEO_H264_720P;
  start(&options);
  run_ms(3000);
  TEST_ASSERT_TRUE(ardrone_session_is_up(session));
  TEST_ASSERT_EQUAL_INT(6, drone.num_configs);
  TEST_ASSERT_EQUAL_STRING("video:video_codec", drone.last_key);
  TEST_ASSERT_EQUAL_STRING("131", drone.last_value);
}

static void test_the_configuration_is_read(void) {
  const char *text;
  size_t size;
  char value[32];
  start_default();
  run_ms(1500);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, ardrone_session_text(session, &text, &size));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_read_config(session));
  run_ms(1500);
  TEST_ASSERT_EQUAL_INT(1, num_events[ARDRONE_EVENT_CONFIG]);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_text(session, &text, &size));
  TEST_ASSERT_EQUAL_INT(
      TVS_OK, ardrone_config_find(text, size, "general:num_version_soft", value, sizeof value));
  TEST_ASSERT_EQUAL_STRING("2.4.8", value);
  TEST_ASSERT_EQUAL_INT(0, drone.control_open);
}

static void test_gps_keys_are_set(void) {
  start_default();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_session_set_gps(session, 91, 0, 0));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_set_gps(session, 1.5, -2.25, 100));
  run_ms(3000);
  TEST_ASSERT_EQUAL_INT(3, num_events[ARDRONE_EVENT_SET_DONE]);
  TEST_ASSERT_EQUAL_STRING("gps:altitude", drone.last_key);
  TEST_ASSERT_EQUAL_STRING("100.000000000", drone.last_value);
}

static void test_a_host_that_does_not_answer(void) {
  start_default();
  drone.deaf = drone.video_refused = 1;
  run_ms(20000);
  TEST_ASSERT_FALSE(ardrone_session_is_up(session));
  TEST_ASSERT_EQUAL_INT(0, drone.num_commands);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_session_take_off(session));
  drone.deaf = drone.video_refused = 0;
  run_ms(3000);
  TEST_ASSERT_TRUE(ardrone_session_is_up(session));
}

static void test_take_off_is_dropped_when_the_link_is_lost(void) {
  start_default();
  run_ms(1500);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_take_off(session));
  run_ms(300);
  TEST_ASSERT_TRUE(drone.flies);
  drone.navdata_off = 1;
  run_ms(2500);
  TEST_ASSERT_EQUAL_INT(1, num_events[ARDRONE_EVENT_LINK_LOST]);
  TEST_ASSERT_EQUAL_INT(1, drone.num_restarts);
  TEST_ASSERT_FALSE(drone.flies); /* on losing the link the session landed the drone */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STATE, ardrone_session_take_off(session));
  drone.num_take_offs = 0;
  drone.navdata_off = 0;
  run_ms(5000);
  TEST_ASSERT_TRUE(ardrone_session_is_up(session));
  TEST_ASSERT_EQUAL_INT(0, drone.num_take_offs);
  TEST_ASSERT_EQUAL_INT(0, drone.num_falls);
}

/* The command numbers start at 1 again, so the event must be reported to a caller who counts
   them. */
static void test_a_link_lost_before_it_was_up_is_told(void) {
  start_default();
  while (drone.num_commands == 0) step();
  drone.navdata_off = 1;
  run_ms(2500);
  TEST_ASSERT_EQUAL_INT(0, num_events[ARDRONE_EVENT_LINK_UP]);
  TEST_ASSERT_EQUAL_INT(1, num_events[ARDRONE_EVENT_LINK_LOST]);
  drone.navdata_off = 0;
  run_ms(3000);
  TEST_ASSERT_EQUAL_INT(1, num_events[ARDRONE_EVENT_LINK_UP]);
  TEST_ASSERT_EQUAL_INT(1, drone.num_restarts);
  TEST_ASSERT_EQUAL_INT(0, drone.num_falls);
}

static void test_a_session_without_steps_sends_nothing(void) {
  int before;
  start_default();
  run_ms(1500);
  before = drone.num_commands;
  mock_advance(&drone, now + 5000 * MOCK_MS);
  TEST_ASSERT_EQUAL_INT(before, drone.num_commands);
}

/* The time in milliseconds until the next picture; at most `limit`. */
static int64_t wait_for_picture(int64_t limit_ms) {
  const int64_t begin = now;
  while (now - begin < limit_ms * MOCK_MS && run_ms(STEP_MS) == 0) {
  }
  return (now - begin) / MOCK_MS;
}

static void test_video_returns_after_a_cut_and_after_silence(void) {
  int k;
  start_default();
  run_ms(3000);
  for (k = 0; k < 20; ++k) {
    drone.video_ended = 1;
    run_ms(40);
    TEST_ASSERT_TRUE(wait_for_picture(2000) < 1000);
    run_ms(700 + 37 * k);
  }
  for (k = 0; k < 20; ++k) {
    drone.video_half_open = 1; /* the video connection is open, but no byte arrives */
    run_ms(40);
    TEST_ASSERT_TRUE(wait_for_picture(3000) < 2000 - 40);
    run_ms(700 + 41 * k);
  }
  TEST_ASSERT_EQUAL_INT(0, own_decoder.num_refused);
}

static void test_reading_too_slowly_drops_the_oldest_and_says_so(void) {
  tvs_frame frame;
  ardrone_counters counters;
  int k;
  start_default();
  run_ms(3000);
  for (k = 0; k < 500 / STEP_MS; ++k) step();
  frame.struct_size = sizeof frame;
  TEST_ASSERT_EQUAL_INT(TVS_OK, frames.next(frames.user, &frame));
  TEST_ASSERT_TRUE(frame.flags & TVS_FRAME_GAP);
  frames.release(frames.user, &frame);
  TEST_ASSERT_EQUAL_INT(TVS_OK, frames.next(frames.user, &frame));
  TEST_ASSERT_FALSE(frame.flags & TVS_FRAME_GAP);
  frames.release(frames.user, &frame);
  ardrone_session_counters(session, &counters);
  TEST_ASSERT_TRUE(counters.frames_dropped >= 10);
}

static void test_an_announced_picture_is_not_a_lost_one(void) {
  ardrone_counters counters;
  tvs_frame frame;
  int num = 0, num_gaps = 0;
  drone.advertises = 1;
  start_default();
  run_ms(2000);
  drone.video_ended = 1; /* a cut, which is one gap */
  frame.struct_size = sizeof frame;
  while (now < 6000 * MOCK_MS) {
    step();
    while (frames.next(frames.user, &frame) == TVS_OK) {
      ++num;
      num_gaps += (frame.flags & TVS_FRAME_GAP) != 0;
      frames.release(frames.user, &frame);
    }
  }
  TEST_ASSERT_TRUE(num > 50);
  TEST_ASSERT_EQUAL_INT(1, num_gaps);
  ardrone_session_counters(session, &counters);
  TEST_ASSERT_EQUAL_UINT64(1, counters.gaps);
  TEST_ASSERT_TRUE(counters.packets_skipped < 3 * MOCK_GOP); /* before each first IDR picture */
  TEST_ASSERT_TRUE(counters.packets > 200);
}

/* The caller does not step for two seconds; of the pictures that have piled up only the last
   group, from its IDR picture on, is delivered. */
static void test_the_latency_rule_drops_what_piled_up(void) {
  ardrone_session_options options = default_options();
  ardrone_counters counters;
  tvs_frame frame;
  options.skip_to_latest = 1;
  start(&options);
  run_ms(3000);
  own_decoder.num_decoded = 0;
  now += 2000 * MOCK_MS;
  mock_advance(&drone, now);
  step();
  TEST_ASSERT_TRUE(own_decoder.num_decoded <= MOCK_GOP + 1);
  ardrone_session_counters(session, &counters);
  TEST_ASSERT_TRUE(counters.packets_skipped >= 40);
  frame.struct_size = sizeof frame;
  TEST_ASSERT_EQUAL_INT(TVS_OK, frames.next(frames.user, &frame));
  TEST_ASSERT_TRUE(frame.flags & TVS_FRAME_GAP);
  frames.release(frames.user, &frame);
  TEST_ASSERT_EQUAL_INT(0, own_decoder.num_refused);
}

/* ---- the long run, with many faults ---- */

/* What check_frame counts while it tests the conditions that every picture must fulfil. */
typedef struct frame_check {
  int num, with_attitude, num_gaps;
  uint64_t last_number;
  uint32_t last_clock;
  double worst_error, worst_ratio;
} frame_check;

static void check_frame(frame_check *c, const tvs_frame *frame) {
  const int follows =
      c->num > 0 && frame->number == c->last_number + 1 && frame->time.clock_id == c->last_clock;
  ++c->num;
  TEST_ASSERT_TRUE(c->num == 1 || follows || (frame->flags & TVS_FRAME_GAP) != 0);
  c->num_gaps += (frame->flags & TVS_FRAME_GAP) != 0;
  c->last_number = frame->number;
  c->last_clock = frame->time.clock_id;
  if (frame->flags & TVS_FRAME_HAS_ATTITUDE) {
    const double device_s =
        (double)frame->time.device_ns * 1e-9 - (drone.clocks_differ ? 987.654 : 0);
    const double yaw =
        2 * atan2(frame->attitude.world_from_body[3], frame->attitude.world_from_body[0]);
    const double error =
        fabs(remainder(yaw + psi0 - mock_yaw(&drone, device_s), 6.283185307179586));
    ++c->with_attitude;
    if (error > c->worst_error) c->worst_error = error;
    if (error / frame->attitude.sigma_rad > c->worst_ratio) {
      c->worst_ratio = error / frame->attitude.sigma_rad;
    }
  }
}

static void run_checked(frame_check *c, int64_t ms) {
  const int64_t end = now + ms * MOCK_MS;
  tvs_frame frame;
  frame.struct_size = sizeof frame;
  while (now < end) {
    step();
    while (frames.next(frames.user, &frame) == TVS_OK) {
      check_frame(c, &frame);
      frames.release(frames.user, &frame);
    }
  }
}

static void test_ten_minutes_of_a_bad_link(void) {
  frame_check c = {0};
  ardrone_counters counters;
  int minute;
  start_default();
  drone.lose_permille = drone.double_permille = drone.reorder_permille = 10;
  for (minute = 0; minute < 10; ++minute) {
    run_checked(&c, 30000);
    drone.video_ended = 1;
    run_checked(&c, 30000);
    if (minute == 3 || minute == 6) {
      mock_boot(&drone);
      drone.now_ns = now;
    }
  }
  ardrone_session_counters(session, &counters);
  printf(
      "pictures %d, with attitude %d, gaps %d, worst attitude error %.5f rad; commands %llu, "
      "links %llu, reboots %llu, late %llu, missing %llu\n",
      c.num, c.with_attitude, c.num_gaps, c.worst_error, (unsigned long long)counters.commands_sent,
      (unsigned long long)counters.links, (unsigned long long)counters.reboots,
      (unsigned long long)counters.navdata_late, (unsigned long long)counters.navdata_missing);
  TEST_ASSERT_TRUE(c.num > 17500);
  TEST_ASSERT_TRUE(c.with_attitude > 0.98 * c.num);
  /* The drone turns at 1 rad/s, so 0.005 rad are 5 ms: samples are 5 ms apart, and their time
     stamps have steps of 1 ms. */
  TEST_ASSERT_TRUE(c.worst_error < 0.005);
  TEST_ASSERT_EQUAL_INT(0, own_decoder.num_refused);
  TEST_ASSERT_EQUAL_UINT64(2, counters.reboots);
  TEST_ASSERT_EQUAL_UINT64(3, counters.links);
  TEST_ASSERT_EQUAL_INT(0, drone.num_falls);
  TEST_ASSERT_EQUAL_INT(0, drone.num_refs);
  TEST_ASSERT_EQUAL_UINT64(0, counters.navdata_rejected);
  TEST_ASSERT_TRUE(counters.video_connections >= 11);
  ardrone_session_close(session);
  TEST_ASSERT_EQUAL_INT(0, own_decoder.num_held);
  session = NULL;
}

/* The PaVE stamps count from an unrelated start: only the arrival times relate the clocks, and
   sigma must cover the error. */
static void test_unrelated_clocks_are_mapped_with_an_honest_sigma(void) {
  frame_check c = {0};
  start_default();
  drone.clocks_differ = 1;
  run_checked(&c, 60000);
  printf("unrelated clocks: with attitude %d of %d, worst error %.3f rad, %.2f sigma\n",
         c.with_attitude, c.num, c.worst_error, c.worst_ratio);
  TEST_ASSERT_TRUE(c.with_attitude > 0.9 * c.num);
  TEST_ASSERT_TRUE(c.worst_ratio < 2);
}

static void test_bad_arguments(void) {
  ardrone_session_options options = default_options();
  ardrone_transport transport = mock_transport(&drone);
  size_t size;
  char buffer[16];
  options.struct_size = 3;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, ardrone_session_size(&options, &size));
  options = default_options();
  options.video_codec = 256;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_session_size(&options, &size));
  options = default_options();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL,
                        ardrone_session_init(&session, &options, NULL, buffer, sizeof buffer));
  transport.send = NULL;
  TEST_ASSERT_EQUAL_INT(
      TVS_ERR_NULL, ardrone_session_init(&session, &options, &transport, buffer, sizeof buffer));
  start_default();
  step();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_session_step(session, now - 1));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_session_set(session, "video:codec_fps", "99"));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, ardrone_session_land(NULL));
}

static void test_the_request_queue_is_bounded(void) {
  int k;
  start_default();
  for (k = 0; k < 16; ++k) TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_read_config(session));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, ardrone_session_read_config(session));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, ardrone_session_set_gps(session, 0, 0, 0));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_it_ends_the_bootstrap_and_asks_for_nothing_else);
  RUN_TEST(test_720p_needs_ids_and_gets_them);
  RUN_TEST(test_the_configuration_is_read);
  RUN_TEST(test_gps_keys_are_set);
  RUN_TEST(test_a_host_that_does_not_answer);
  RUN_TEST(test_take_off_is_dropped_when_the_link_is_lost);
  RUN_TEST(test_a_link_lost_before_it_was_up_is_told);
  RUN_TEST(test_a_session_without_steps_sends_nothing);
  RUN_TEST(test_video_returns_after_a_cut_and_after_silence);
  RUN_TEST(test_reading_too_slowly_drops_the_oldest_and_says_so);
  RUN_TEST(test_an_announced_picture_is_not_a_lost_one);
  RUN_TEST(test_the_latency_rule_drops_what_piled_up);
  RUN_TEST(test_ten_minutes_of_a_bad_link);
  RUN_TEST(test_unrelated_clocks_are_mapped_with_an_honest_sigma);
  RUN_TEST(test_bad_arguments);
  RUN_TEST(test_the_request_queue_is_bounded);
  return UNITY_END();
}
