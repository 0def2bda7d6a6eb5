/* The MAVLink session on a clock of the test's own: poses by hand, the vehicle's clock, and packets
   that are lost, repeated, late, corrupted or of others. */
#include <math.h>
#include <mavlink.h>
#include <string.h>
#include <unity.h>

#include "twoview_drivers/mavlink/session.h"

#define MS INT64_C(1000000)

enum { CAPACITY = 4096, SYSTEM = 3 };

static uint8_t queue[CAPACITY], memory[200000], sent[64][MAVLINK_MAX_PACKET_LEN];
static size_t queue_size, sent_size[64];
static int num_sent, num_imu, num_events;
static tvs_imu samples[512];
static tvm_session *session;
static mavlink_status_t sender, other_sender;
static int64_t now;

void setUp(void) {}
void tearDown(void) {}

static tvs_status take_sent(void *user, const void *bytes, size_t size) {
  (void)user;
  if (num_sent < 64) {
    memcpy(sent[num_sent], bytes, size);
    sent_size[num_sent++] = size;
  }
  return TVS_OK;
}

static tvs_status give(void *user, void *bytes, size_t capacity, size_t *size) {
  (void)user;
  if (queue_size == 0) return TVS_NONE;
  TEST_ASSERT_TRUE(queue_size <= capacity);
  memcpy(bytes, queue, queue_size);
  *size = queue_size;
  queue_size = 0;
  return TVS_OK;
}

static void take_imu(void *user, const tvs_imu *sample) {
  (void)user;
  if (num_imu < 512) samples[num_imu++] = *sample;
}

static void take_event(void *user, tvm_event event) {
  (void)user;
  num_events += event == TVM_EVENT_REBOOT;
}

static void add_bytes(const void *bytes, size_t size) {
  TEST_ASSERT_TRUE(queue_size + size <= 2048);
  memcpy(queue + queue_size, bytes, size);
  queue_size += size;
}

static void add(const mavlink_message_t *m) {
  uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
  add_bytes(bytes, mavlink_msg_to_send_buffer(bytes, m));
}

static void step(int64_t at) {
  now = at;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_session_step(session, now));
}

static void heartbeat(uint8_t system, uint8_t autopilot) {
  mavlink_message_t m;
  const mavlink_heartbeat_t h = {0, MAV_TYPE_QUADROTOR, autopilot, 0, MAV_STATE_ACTIVE, 3};
  mavlink_msg_heartbeat_encode_status(system, 1, system == SYSTEM ? &sender : &other_sender, &m,
                                      &h);
  add(&m);
}

static void make_attitude(mavlink_message_t *m, uint32_t ms, double roll, double pitch,
                          double yaw) {
  const mavlink_attitude_t a = {ms, (float)roll, (float)pitch, (float)yaw, 0.01f, 0.02f, 0.03f};
  mavlink_msg_attitude_encode_status(SYSTEM, 1, &sender, m, &a);
}

static void attitude(uint32_t ms, double roll, double pitch, double yaw) {
  mavlink_message_t m;
  make_attitude(&m, ms, roll, pitch, yaw);
  add(&m);
}

static void position(uint32_t ms, double z, double vx, double vy, double vz) {
  mavlink_message_t m;
  const mavlink_local_position_ned_t p = {ms, 0, 0, (float)z, (float)vx, (float)vy, (float)vz};
  mavlink_msg_local_position_ned_encode_status(SYSTEM, 1, &sender, &m, &p);
  add(&m);
}

static void begin(void) {
  tvm_session_options options;
  const tvm_transport transport = {sizeof transport, NULL, take_sent, give, NULL, NULL};
  tvm_session_options_init(&options);
  options.on_imu = take_imu;
  options.on_event = take_event;
  memset(&sender, 0, sizeof sender);
  memset(&other_sender, 0, sizeof other_sender);
  queue_size = 0;
  num_sent = num_imu = num_events = 0;
  TEST_ASSERT_TRUE(tvm_session_size() <= sizeof memory);
  TEST_ASSERT_EQUAL_INT(TVS_OK,
                        tvm_session_init(&session, &options, &transport, memory, sizeof memory));
  heartbeat(SYSTEM, MAV_AUTOPILOT_PX4);
  step(1000 * MS);
}

static tvm_counters counters(void) {
  tvm_counters n;
  tvm_session_counters(session, &n);
  return n;
}

static void assert_quaternion(double w, double x, double y, double z, const double q[4]) {
  const double e[4] = {w, x, y, z};
  int k;
  for (k = 0; k < 4; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-6, e[k], q[k]);
}

/* The world's x is the heading at the start, so a vehicle that started to the east (yaw 90 degrees)
   and turns to the south has turned by 90 degrees to the right: q = (cos 45, 0, 0, sin 45). */
static void test_the_world_starts_at_the_first_heading(void) {
  const double right = 1.5707963267948966, half = 0.70710678118654752;
  begin();
  attitude(5000, 0, 0, right);
  attitude(5020, 0, 0, 2 * right);
  attitude(5040, 0.5 * right, 0, right); /* right side down by 45 degrees: about x */
  attitude(5060, 0, 0.5 * right, right); /* nose up by 45 degrees: about y */
  step(1100 * MS);
  step(1300 * MS);
  TEST_ASSERT_EQUAL_INT(4, num_imu);
  assert_quaternion(1, 0, 0, 0, samples[0].attitude.world_from_body);
  assert_quaternion(half, 0, 0, half, samples[1].attitude.world_from_body);
  assert_quaternion(cos(0.25 * right), sin(0.25 * right), 0, 0,
                    samples[2].attitude.world_from_body);
  assert_quaternion(cos(0.25 * right), 0, sin(0.25 * right), 0,
                    samples[3].attitude.world_from_body);
  TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.03, samples[0].rate_rad_s[2]);
  TEST_ASSERT_EQUAL_UINT32(TVS_IMU_ATTITUDE | TVS_IMU_RATE, samples[0].valid);
}

/* To the north at 2 m/s while the nose points to the east is to the left: body y = -2. With the
   nose up by 30 degrees, a climb of 1 m/s (NED: vz = -1) is forward by sin 30 and along -z by
   cos 30. */
static void test_velocities_turn_into_the_body(void) {
  const double right = 1.5707963267948966;
  begin();
  position(4990, -3, 2, 0, 0);
  attitude(5000, 0, 0, right);
  position(5010, -3, 2, 0, 0);
  position(5090, -3, 0, 0, -1);
  attitude(5100, 0, right / 3, 0.7);
  position(5110, -3, 0, 0, -1);
  step(1100 * MS);
  step(1300 * MS);
  TEST_ASSERT_EQUAL_INT(2, num_imu);
  /* Position messages before the first attitude belong to no world. */
  TEST_ASSERT_EQUAL_UINT32(TVS_IMU_ATTITUDE | TVS_IMU_RATE, samples[0].valid);
  TEST_ASSERT_TRUE(samples[1].valid & TVS_IMU_VELOCITY_Z);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, samples[1].velocity_m_s[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, samples[1].velocity_m_s[1]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, -0.86602540378, samples[1].velocity_m_s[2]);
  position(5190, -3, 2, 0, 0);
  attitude(5200, 0, 0, right);
  position(5210, -3, 2, 0, 0);
  step(1400 * MS);
  TEST_ASSERT_EQUAL_INT(3, num_imu);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, samples[2].velocity_m_s[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, -2, samples[2].velocity_m_s[1]);
}

static void test_velocity_and_height_are_those_of_the_attitudes_time(void) {
  int k;
  begin();
  attitude(5000, 0, 0, 0);
  for (k = 0; k < 30; ++k) { /* 3 s: the height is 2 m and rises by 0.1 m each 0.1 s */
    position((uint32_t)(5010 + 100 * k), -(2 + 0.1 * k), 0.1 * k, 0, -1);
    attitude((uint32_t)(5035 + 100 * k), 0, 0, 0);
    step((1100 + 100 * k) * MS);
  }
  TEST_ASSERT_EQUAL_INT(30, num_imu); /* the last one waits */
  for (k = 12; k < 29; ++k) {         /* heights are chosen after 1 s */
    const tvs_imu *s = &samples[k + 1];
    TEST_ASSERT_TRUE(s->valid & TVS_IMU_ALTITUDE);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 2 + 0.1 * (k + 0.25), s->altitude_m);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.1 * (k + 0.25), s->velocity_m_s[0]);
  }
}

/* The vehicle's clock is 4000 ms ahead of 1000 ms of ours, and packets take 20 ms or more to come
   but for one, which takes 8 ms. The request of TIMESYNC takes 4 ms. So host minus device lies
   between -3000 - 4 and -3000 + 8 ms. */
static void test_timesync_bounds_the_delay(void) {
  mavlink_message_t m;
  mavlink_timesync_t sync;
  tvs_attitude found;
  tvs_time time;
  int k, idx = -1;
  begin();
  for (k = 0; k < 20; ++k) {
    attitude((uint32_t)(5000 + 20 * k), 0, 0, 0.02 * k);
    step((2000 + 20 * k + (k == 5 ? 8 : 20)) * MS);
  }
  for (k = 0; k < num_sent; ++k) idx = sent[k][7] == MAVLINK_MSG_ID_TIMESYNC ? k : idx;
  TEST_ASSERT_TRUE(idx >= 0);
  memset(&sync, 0, sizeof sync);
  memcpy(&sync.ts1, sent[idx] + 10 + 8, sent[idx][1] - 8); /* trailing zeros are not sent */
  TEST_ASSERT_EQUAL_INT64(2020, sync.ts1 / MS);
  /* An answer to somebody else's request is not used. */
  sync.tc1 = 5418 * MS;
  sync.ts1 += 1;
  mavlink_msg_timesync_encode_status(SYSTEM, 1, &sender, &m, &sync);
  add(&m);
  step(2420 * MS);
  TEST_ASSERT_EQUAL_UINT64(0, counters().timesyncs);
  for (k = 0; k < 60; ++k) { /* until the next request, 1 s after that one */
    num_sent = 0;
    attitude((uint32_t)(5430 + 20 * k), 0, 0, 0.4 + 0.02 * k);
    step((2460 + 20 * k) * MS);
    for (idx = 0; idx < num_sent && sent[idx][7] != MAVLINK_MSG_ID_TIMESYNC;) ++idx;
    if (idx < num_sent) break;
  }
  TEST_ASSERT_TRUE(idx < num_sent);
  sync.tc1 = now + 3000 * MS + 4 * MS;
  sync.ts1 = now;
  mavlink_msg_timesync_encode_status(SYSTEM, 1, &sender, &m, &sync);
  add(&m);
  step(now + 12 * MS);
  TEST_ASSERT_EQUAL_UINT64(1, counters().timesyncs);
  /* The middle of -3004 and -2992 is -2998; half of the width, and 1 ms for the stamp's unit. */
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvm_session_attitude_at(session, 2202 * MS, &time, &found));
  TEST_ASSERT_INT64_WITHIN(MS / 5, 5200 * MS, time.device_ns);
  TEST_ASSERT_INT64_WITHIN(MS / 5, 7 * MS, time.uncertainty_ns);
  /* The yaw then is 0.02 * 10; the vehicle turns by 1 rad/s, 7 ms of which are uncertain. */
  TEST_ASSERT_DOUBLE_WITHIN(1e-3, sin(0.1), found.world_from_body[3]);
  TEST_ASSERT_DOUBLE_WITHIN(2e-4, hypot(0.0175, 0.007), found.sigma_rad);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvm_session_attitude_at(session, 99000 * MS, NULL, &found));
}

static void test_bad_packets_are_counted_and_not_used(void) {
  mavlink_message_t m[6];
  uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
  mavlink_attitude_t nothing;
  size_t size;
  int k;
  begin();
  for (k = 0; k < 6; ++k) make_attitude(&m[k], (uint32_t)(5000 + 20 * k), 0, 0, 0.1 * k);
  add(&m[0]);
  add(&m[0]); /* repeated */
  add(&m[3]); /* 1 and 2 are lost, or late */
  add(&m[2]); /* late, and older than the newest: no attitude of its own */
  size = mavlink_msg_to_send_buffer(bytes, &m[4]);
  bytes[15] ^= 4; /* corrupted */
  add_bytes(bytes, size);
  add(&m[5]);
  add_bytes("\xfd\xff garbage", 3);
  memset(bytes, 0, sizeof bytes);
  add_bytes(bytes, 270); /* what a wrong length swallows */
  step(1100 * MS);
  heartbeat(SYSTEM + 1, MAV_AUTOPILOT_PX4);
  step(1120 * MS);
  memset(&nothing, 0, sizeof nothing);
  nothing.time_boot_ms = 5200;
  nothing.roll = NAN;
  mavlink_msg_attitude_encode_status(SYSTEM, 1, &sender, &m[0], &nothing);
  add(&m[0]);
  step(1140 * MS);
  step(1400 * MS);
  TEST_ASSERT_EQUAL_UINT64(3, counters().attitudes);
  TEST_ASSERT_EQUAL_INT(3, num_imu);
  TEST_ASSERT_EQUAL_UINT64(1, counters().repeated);
  TEST_ASSERT_EQUAL_UINT64(6, counters().received); /* with the heartbeat and the NaN */
  TEST_ASSERT_EQUAL_UINT64(1, counters().late);
  TEST_ASSERT_EQUAL_UINT64(2, counters().lost); /* 1, and 4, which was corrupted */
  TEST_ASSERT_EQUAL_UINT64(1, counters().others);
  TEST_ASSERT_TRUE(counters().corrupted + counters().unknown >= 1);
}

static void test_a_stray_stamp_is_no_reboot_and_a_reboot_is_one(void) {
  tvs_attitude found;
  uint32_t id;
  int k;
  begin();
  for (k = 0; k < 10; ++k) {
    attitude((uint32_t)(600000 + 20 * k), 0, 0, 1);
    step((1100 + 20 * k) * MS);
  }
  attitude(70, 0, 0, 2); /* one packet of another time */
  attitude(600200, 0, 0, 1);
  step(1300 * MS);
  TEST_ASSERT_EQUAL_INT(0, num_events);
  TEST_ASSERT_EQUAL_UINT64(11, counters().attitudes);
  id = samples[0].attitude.clock_id;
  for (k = 0; k < 10; ++k) {
    attitude((uint32_t)(100 + 20 * k), 0, 0, 2.5);
    step((1320 + 20 * k) * MS);
  }
  step(1800 * MS);
  TEST_ASSERT_EQUAL_INT(1, num_events);
  TEST_ASSERT_EQUAL_UINT64(1, counters().reboots);
  TEST_ASSERT_TRUE(samples[num_imu - 1].attitude.clock_id != id);
  assert_quaternion(1, 0, 0, 0, samples[num_imu - 1].attitude.world_from_body);
  /* No attitude is interpolated across the two runs. */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvm_session_attitude_at(session, 1290 * MS, NULL, &found));
}

static void test_the_link_tells_silence_and_asks_again(void) {
  int k, requests = 0;
  begin();
  TEST_ASSERT_EQUAL_INT(TVM_LINK_NO_ATTITUDE, tvm_session_link(session));
  attitude(5000, 0, 0, 0);
  step(1100 * MS);
  TEST_ASSERT_EQUAL_INT(TVM_LINK_UP, tvm_session_link(session));
  step(2200 * MS);
  TEST_ASSERT_EQUAL_INT(TVM_LINK_NO_ATTITUDE, tvm_session_link(session));
  step(4200 * MS);
  TEST_ASSERT_EQUAL_INT(TVM_LINK_SILENT, tvm_session_link(session));
  TEST_ASSERT_EQUAL_UINT64(1, counters().silences);
  num_sent = 0;
  heartbeat(SYSTEM, MAV_AUTOPILOT_PX4);
  step(5000 * MS);
  for (k = 0; k < num_sent; ++k) requests += sent[k][7] == MAVLINK_MSG_ID_COMMAND_LONG;
  TEST_ASSERT_EQUAL_INT(4, requests);
}

static mavlink_distance_sensor_t looking_down(uint8_t quality) {
  mavlink_distance_sensor_t d;
  memset(&d, 0, sizeof d);
  d.min_distance = 20;
  d.max_distance = 1200;
  d.current_distance = 300;
  d.orientation = MAV_SENSOR_ROTATION_PITCH_270;
  d.signal_quality = quality;
  return d;
}

/* Flies level for 2.5 s at 1.5 m by the local position, with `d` at 10 Hz. Returns the last sample
   that has a height. */
static tvs_imu fly_with(mavlink_distance_sensor_t d, double roll) {
  mavlink_message_t m;
  int k;
  begin();
  attitude(5000, roll, 0, 0);
  for (k = 1; k <= 25; ++k) {
    attitude((uint32_t)(5000 + 100 * k), roll, 0, 0);
    position((uint32_t)(5001 + 100 * k), -1.5, 0.2, 0, 0);
    d.time_boot_ms = (uint32_t)(5002 + 100 * k);
    mavlink_msg_distance_sensor_encode_status(SYSTEM, 1, &sender, &m, &d);
    add(&m);
    step((1100 + 100 * k) * MS);
  }
  step(4500 * MS);
  for (k = num_imu - 1; k > 0 && !(samples[k].valid & TVS_IMU_ALTITUDE);) --k;
  TEST_ASSERT_TRUE(samples[k].valid & TVS_IMU_ALTITUDE);
  return samples[k];
}

static void test_a_distance_without_a_signal_is_no_height(void) {
  mavlink_distance_sensor_t d = looking_down(0);
  int k;
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 3.0, fly_with(d, 0).altitude_m); /* 0: the quality is not known */
  TEST_ASSERT_EQUAL_UINT64(0, tvm_session_num_invalid(session));
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 3.0, fly_with(looking_down(100), 0).altitude_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.5, fly_with(looking_down(1), 0).altitude_m);
  TEST_ASSERT_EQUAL_UINT64(25, tvm_session_num_invalid(session));
  for (k = 0; k < 5; ++k) { /* at and beyond the ends of its range, and nothing at all */
    static const uint16_t distances[5] = {20, 10, 1200, 1300, 0};
    d.current_distance = distances[k];
    if (distances[k] == 0) d.min_distance = 0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.5, fly_with(d, 0).altitude_m);
    TEST_ASSERT_EQUAL_UINT64(25, tvm_session_num_invalid(session));
  }
  d = looking_down(100);
  d.orientation = MAV_SENSOR_ROTATION_NONE; /* forward */
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.5, fly_with(d, 0).altitude_m);
  TEST_ASSERT_EQUAL_UINT64(0, tvm_session_num_invalid(session));
}

/* The sensor's own variance, where it states one; the tilt of the vehicle and of the sensor. */
static void test_a_distance_has_its_direction_and_its_error(void) {
  mavlink_distance_sensor_t d = looking_down(100);
  const double half = 0.5 * (1.5707963267948966 - 0.3); /* down is 90 degrees about y */
  tvs_imu sample;
  d.covariance = 255;
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.08, fly_with(d, 0).altitude_sigma);
  d.covariance = 225; /* cm^2 */
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.15, fly_with(d, 0).altitude_sigma);
  d.covariance = 0;
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 3 * cos(0.4), fly_with(d, 0.4).altitude_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.5, fly_with(d, 0.9).altitude_m); /* it may see a wall */
  d.orientation = MAV_SENSOR_ROTATION_CUSTOM;
  d.quaternion[0] =
      (float)cos(half); /* x is turned by -90 + 17 degrees about y: forward and down */
  d.quaternion[2] = (float)-sin(half);
  sample = fly_with(d, 0);
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 3 * cos(0.3), sample.altitude_m);
  d.quaternion[2] = (float)sin(half); /* up */
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.5, fly_with(d, 0).altitude_m);
  memset(d.quaternion, 0, sizeof d.quaternion); /* not known */
  TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1.5, fly_with(d, 0).altitude_m);
}

/* A run keeps to one sensor, as it keeps to one kind of height. */
static void test_of_two_distances_one_is_used(void) {
  mavlink_distance_sensor_t d = looking_down(100);
  mavlink_message_t m;
  int k;
  begin();
  attitude(5000, 0, 0, 0);
  for (k = 1; k <= 50; ++k) {
    attitude((uint32_t)(5000 + 50 * k), 0, 0, 0);
    d.time_boot_ms = (uint32_t)(5001 + 50 * k);
    d.id = k % 2 ? 4 : 7;
    d.current_distance = k % 2 ? 300 : 200;
    mavlink_msg_distance_sensor_encode_status(SYSTEM, 1, &sender, &m, &d);
    add(&m);
    step((1100 + 50 * k) * MS);
  }
  step(4500 * MS);
  for (k = 0; k < num_imu; ++k) {
    if (samples[k].valid & TVS_IMU_ALTITUDE)
      TEST_ASSERT_DOUBLE_WITHIN(1e-5, 3.0, samples[k].altitude_m);
  }
  TEST_ASSERT_TRUE(samples[40].valid & TVS_IMU_ALTITUDE);
}

/* Numbers that are none, and what no vehicle does: 5000 m, 300 m/s. */
static void test_impossible_positions_are_left_out_and_counted(void) {
  static const double z[4] = {NAN, -5000, -2, INFINITY}, vx[4] = {1, 1, 300, NAN};
  int k, n;
  begin();
  attitude(5000, 0, 0, 0);
  for (k = 0; k < 80; ++k) {
    attitude((uint32_t)(5010 + 50 * k), 0, 0, 0);
    position((uint32_t)(5020 + 50 * k), k % 2 ? z[k / 2 % 4] : -1.5, k % 2 ? vx[k / 2 % 4] : 1, 0,
             0);
    step((1100 + 50 * k) * MS);
  }
  step(6000 * MS);
  for (k = n = 0; k < num_imu; ++k) {
    if (samples[k].valid & TVS_IMU_ALTITUDE) {
      TEST_ASSERT_TRUE(samples[k].altitude_m >= 1.499 && samples[k].altitude_m < 2.001);
      ++n;
    }
    if (samples[k].valid & TVS_IMU_VELOCITY_Z)
      TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1, samples[k].velocity_m_s[0]);
  }
  TEST_ASSERT_TRUE(n > 40);
  TEST_ASSERT_EQUAL_UINT64(30 + 20, tvm_session_num_invalid(session));
}

static void test_wrong_arguments_are_refused(void) {
  tvm_session_options options, bad;
  tvm_transport transport = {sizeof transport, NULL, take_sent, give, NULL, NULL};
  tvm_session_options_init(&options);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, tvm_session_init(NULL, &options, &transport, memory, 1));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, tvm_session_init(&session, &options, &transport, memory,
                                                           tvm_session_size() - 1));
  bad = options;
  bad.struct_size = 0;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE,
                        tvm_session_init(&session, &bad, &transport, memory, sizeof memory));
  bad = options;
  bad.attitude_hz = NAN;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT,
                        tvm_session_init(&session, &bad, &transport, memory, sizeof memory));
  bad = options;
  bad.vehicle_system = 256;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT,
                        tvm_session_init(&session, &bad, &transport, memory, sizeof memory));
  transport.send = NULL;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL,
                        tvm_session_init(&session, &options, &transport, memory, sizeof memory));
  begin();
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvm_session_step(session, now - 1));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_world_starts_at_the_first_heading);
  RUN_TEST(test_velocities_turn_into_the_body);
  RUN_TEST(test_velocity_and_height_are_those_of_the_attitudes_time);
  RUN_TEST(test_timesync_bounds_the_delay);
  RUN_TEST(test_bad_packets_are_counted_and_not_used);
  RUN_TEST(test_a_stray_stamp_is_no_reboot_and_a_reboot_is_one);
  RUN_TEST(test_the_link_tells_silence_and_asks_again);
  RUN_TEST(test_a_distance_without_a_signal_is_no_height);
  RUN_TEST(test_a_distance_has_its_direction_and_its_error);
  RUN_TEST(test_of_two_distances_one_is_used);
  RUN_TEST(test_impossible_positions_are_left_out_and_counted);
  RUN_TEST(test_wrong_arguments_are_refused);
  return UNITY_END();
}
