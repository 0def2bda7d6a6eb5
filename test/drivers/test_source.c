/* The clock mapper, attitudes between two samples, and the file source. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "twoview_drivers/attitude.h"
#include "twoview_drivers/clock.h"
#include "twoview_drivers/file_source.h"

void setUp(void) {}
void tearDown(void) {}

#define MS INT64_C(1000000)
#define S INT64_C(1000000000)
#define PERIOD (2048 * S)

static tvs_clock mapper(void) {
  tvs_clock clock;
  tvs_clock_options options;
  tvs_clock_options_init(&options);
  options.period_ns = PERIOD;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_clock_init(&clock, &options, 1, 2));
  return clock;
}

static tvs_time observe(tvs_clock *clock, int64_t device, int64_t host) {
  tvs_time time;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_clock_observe(clock, device % PERIOD, host, &time));
  return time;
}

/* Two hours of packets with random delays and a drift of 50 ppm, over four wraps of the device's
   counter (2048 s) and a silence of 50 minutes: the host time is right within the reported
   uncertainty. */
static void test_unwrapped_and_mapped_within_its_uncertainty(void) {
  tvs_clock clock = mapper();
  uint32_t seed = 12345;
  int64_t t, device0 = 1000 * S, worst = 0;
  for (t = 0; t < 7200 * S; t += 67 * MS) {
    int64_t delay, host, error;
    tvs_time time;
    if (t > 1000 * S && t < 4000 * S) continue;
    seed = seed * 1664525u + 1013904223u;
    delay = 1 * MS + (int64_t)(-20e6 * log((seed / 2 + 1.0) / 2147483650.0));
    host = 77 * S + t + t / 20000; /* the host's clock runs 50 ppm faster */
    time = observe(&clock, device0 + t, host + delay);
    TEST_ASSERT_EQUAL_INT64(device0 + t, time.device_ns);
    TEST_ASSERT_EQUAL_UINT32(1, time.clock_id);
    error = llabs(time.host_ns - host);
    if (t > 4 * S && t < 1000 * S && error > worst) worst = error;
    TEST_ASSERT_TRUE(t < S || error <= time.uncertainty_ns + 1 * MS);
  }
  TEST_ASSERT_TRUE(worst < 12 * MS);
}

static void test_a_late_packet_keeps_its_time(void) {
  tvs_clock clock = mapper();
  tvs_time time;
  observe(&clock, 10 * S, 100 * S);
  observe(&clock, 11 * S, 101 * S);
  time = observe(&clock, 12 * S, 117 * S); /* this packet arrives 15 s late */
  TEST_ASSERT_EQUAL_INT64(12 * S, time.device_ns);
  TEST_ASSERT_EQUAL_UINT32(1, time.clock_id);
  TEST_ASSERT_TRUE(llabs(time.host_ns - 102 * S) < 10 * MS);
  /* This packet was sent before the last one, but arrives after it. */
  time = observe(&clock, 11 * S + 500 * MS, 117 * S + 1);
  TEST_ASSERT_EQUAL_INT64(11 * S + 500 * MS, time.device_ns);
  TEST_ASSERT_EQUAL_UINT32(1, time.clock_id);
}

static void test_a_reboot_or_jump_is_another_clock(void) {
  tvs_clock clock = mapper();
  int64_t host, device;
  uint32_t id;
  int64_t uncertainty;
  observe(&clock, 500 * S, 100 * S);
  /* The device's time went back by 498 s, so it has a new clock id. */
  TEST_ASSERT_EQUAL_UINT32(3, observe(&clock, 2 * S, 101 * S).clock_id);
  /* The device's time went on by 58 s within 1 s, which is impossible, so it has a new clock id. */
  TEST_ASSERT_EQUAL_UINT32(5, observe(&clock, 60 * S, 102 * S).clock_id);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_clock_to_host(&clock, 3, 2 * S, &host, &uncertainty));
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_clock_to_host(&clock, 5, 61 * S, &host, &uncertainty));
  TEST_ASSERT_EQUAL_INT64(103 * S - 1 * MS, host); /* less half of the least delay */
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_clock_to_device(&clock, host, &id, &device, &uncertainty));
  TEST_ASSERT_EQUAL_INT64(61 * S, device);
  tvs_clock_restart(&clock);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_clock_to_device(&clock, 103 * S, &id, &device, &uncertainty));
  TEST_ASSERT_EQUAL_UINT32(7, observe(&clock, 61 * S, 103 * S).clock_id);
}

static void test_stamps_outside_the_period_are_refused(void) {
  tvs_clock clock = mapper();
  tvs_time time;
  tvs_clock_options options;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_clock_observe(&clock, PERIOD, 0, &time));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_clock_observe(&clock, -1, 0, &time));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_clock_observe(&clock, 0, INT64_MAX, &time));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, tvs_clock_observe(NULL, 0, 0, &time));
  tvs_clock_options_init(&options);
  options.period_ns = S;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_clock_init(&clock, &options, 1, 1));
}

/* ---- tests of the history of attitudes ---- */

static tvs_attitude yaw(double radians, uint32_t id) {
  tvs_attitude a;
  memset(&a, 0, sizeof a);
  tvs_quaternion_from_euler(radians, 0, 0, a.world_from_body);
  a.sigma_rad = 0.01 + radians / 100;
  a.clock_id = id;
  return a;
}

static tvs_attitudes history;

static void add(double radians, int64_t time, uint32_t id) {
  const tvs_attitude a = yaw(radians, id);
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_attitudes_add(&history, time, &a));
}

static void test_attitude_between_neighbours_or_unknown(void) {
  tvs_attitude a;
  tvs_attitudes_init(&history);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 1, 0, S, &a));
  add(0.0, 0, 1);
  add(0.4, 100, 1);
  add(0.8, 200, 1);
  add(1.0, 900, 1);
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_attitudes_at(&history, 1, 125, 100, &a));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, 2 * atan2(a.world_from_body[3], a.world_from_body[0]));
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.018, a.sigma_rad);
  /* At the instant of a sample, the attitude is that sample. */
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_attitudes_at(&history, 1, 900, 100, &a));
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_attitudes_at(&history, 1, 200, 100, &a));
  /* No attitude: the samples around the instant are more than 100 ns apart. */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 1, 201, 100, &a));
  /* No attitude: the instant is after the last sample or before the first. */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 1, 901, 100, &a));
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 1, -1, 100, &a));
  /* No attitude: the samples have clock id 1, and the instant has 2. */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 2, 125, 100, &a));
  add(0.0, 50, 3); /* clock id 3: the drone was restarted */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 1, 125, 100, &a));
  a = yaw(0, 3);
  /* A sample that is not newer than the last one is ignored. */
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_add(&history, 50, &a));
}

static void test_the_ring_forgets_the_oldest(void) {
  tvs_attitude a;
  int k;
  tvs_attitudes_init(&history);
  for (k = 0; k < 2 * TVS_ATTITUDES_CAPACITY + 5; ++k) add(k * 1e-4, k * 10, 1);
  k = 2 * TVS_ATTITUDES_CAPACITY + 4;
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_attitudes_at(&history, 1, (k - 1023) * 10, 100, &a));
  TEST_ASSERT_EQUAL_INT(TVS_NONE, tvs_attitudes_at(&history, 1, (k - 1024) * 10, 100, &a));
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_attitudes_at(&history, 1, k * 10 - 5, 100, &a));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, (k - 0.5) * 1e-4,
                            2 * atan2(a.world_from_body[3], a.world_from_body[0]));
}

static void test_bad_attitudes_are_refused(void) {
  tvs_attitude a = yaw(0, 1);
  tvs_attitudes_init(&history);
  a.world_from_body[0] = 1.01;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_attitudes_add(&history, 0, &a));
  a.world_from_body[0] = NAN;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_attitudes_add(&history, 0, &a));
  a = yaw(0, 0);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, tvs_attitudes_add(&history, 0, &a));
}

/* Slerp takes the shorter arc and divides its angle in the given proportion (here a quarter),
   also between nearly equal and nearly opposite quaternions. */
static void test_slerp(void) {
  const double angles[] = {1e-9, 1e-5, 0.1, 1.0, 3.0};
  size_t k;
  for (k = 0; k < 5; ++k) {
    const double a[4] = {cos(0.2), sin(0.2), 0, 0};
    /* -q is the same rotation as q. */
    const double b[4] = {-cos(0.2 + angles[k] / 2), -sin(0.2 + angles[k] / 2), 0, 0};
    double q[4];
    tvs_slerp(a, b, 0.25, q);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4 + angles[k] / 4, 2 * atan2(q[1], q[0]));
  }
}

static void test_euler_angles_turn_as_documented(void) {
  double q[4];
  tvs_quaternion_from_euler(0, 0.3, 0, q); /* nose up: the body's x points to -z; z is down */
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -sin(0.3), 2 * (q[1] * q[3] - q[0] * q[2]));
  tvs_quaternion_from_euler(0, 0, 0.3, q); /* right side down: the body's y points to +z */
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, sin(0.3), 2 * (q[2] * q[3] + q[0] * q[1]));
  tvs_quaternion_from_euler(0.3, 0, 0, q); /* clockwise from above: x turns to y */
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, sin(0.3), 2 * (q[1] * q[2] + q[0] * q[3]));
}

/* ---- tests of the source that reads files ---- */

static uint8_t pixels[12];
static int num_released, imu_index;

static tvs_status read_picture(void *user, uint64_t index, tvs_picture *picture,
                               int64_t *device_ns) {
  (void)user;
  if (index >= 5) return TVS_END;
  if (index == 2) return TVS_ERR_DATA;
  TEST_ASSERT_EQUAL_INT64((int64_t)index * 100 * MS, *device_ns);
  picture->image.data = pixels;
  picture->image.width = 4;
  picture->image.height = 3;
  picture->image.stride_bytes = 4;
  picture->handle = (void *)pixels;
  return TVS_OK;
}

static void release_picture(void *user, tvs_picture *picture) {
  (void)user;
  TEST_ASSERT_TRUE(picture->handle == pixels);
  ++num_released;
}

static tvs_status next_imu(void *user, tvs_imu *sample) {
  (void)user;
  if (imu_index > 8) return TVS_END;
  sample->valid = TVS_IMU_ATTITUDE;
  sample->attitude = yaw(0.1 * imu_index, 1);
  sample->time.device_ns = imu_index * 40 * MS;
  sample->time.clock_id = 1;
  ++imu_index;
  return TVS_OK;
}

static void test_the_file_source(void) {
  const tvs_imu_source imu = {sizeof imu, NULL, next_imu};
  tvs_file_options options;
  tvs_frame_source source;
  tvs_frame frame;
  void *memory = malloc(tvs_file_source_size());
  int k, num = 0;
  imu_index = num_released = 0;
  tvs_file_options_init(&options);
  options.read = read_picture;
  options.release = release_picture;
  options.frames_per_second = 10;
  options.imu = &imu;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_CAPACITY, tvs_file_source_init(memory, tvs_file_source_size() - 1,
                                                               &options, &source));
  TEST_ASSERT_EQUAL_INT(TVS_OK,
                        tvs_file_source_init(memory, tvs_file_source_size(), &options, &source));
  frame.struct_size = sizeof frame;
  for (k = 0; source.next(source.user, &frame) == TVS_OK; ++k, ++num) {
    const uint64_t number = (uint64_t)(k < 2 ? k : k + 1);
    TEST_ASSERT_EQUAL_UINT64(number, frame.number);
    TEST_ASSERT_EQUAL_INT(k == 2, (frame.flags & TVS_FRAME_GAP) != 0);
    /* The samples end at 320 ms: later frames have no attitude. */
    TEST_ASSERT_EQUAL_INT(number <= 3, (frame.flags & TVS_FRAME_HAS_ATTITUDE) != 0);
    if (number <= 3) {
      TEST_ASSERT_DOUBLE_WITHIN(
          1e-9, 0.25 * (double)number,
          2 * atan2(frame.attitude.world_from_body[3], frame.attitude.world_from_body[0]));
    }
    source.release(source.user, &frame);
  }
  TEST_ASSERT_EQUAL_INT(4, num);
  TEST_ASSERT_EQUAL_INT(4, num_released);
  TEST_ASSERT_EQUAL_INT(TVS_END, source.next(source.user, &frame));
  free(memory);
}

/* ---- callers with the headers of other releases ---- */

/* A caller whose structs have a field more. */
typedef struct newer_options {
  tvs_file_options known;
  uint64_t more;
} newer_options;

typedef struct newer_frame {
  tvs_frame known;
  uint64_t more;
} newer_frame;

static void test_a_newer_callers_structs_are_read_and_written_whole(void) {
  newer_options options;
  newer_frame frame;
  struct {
    tvs_frame_source known;
    uint64_t more;
  } source;
  void *memory = malloc(tvs_file_source_size());
  memset(&options, 0xff, sizeof options);
  memset(&source, 0xff, sizeof source);
  memset(&frame, 0xff, sizeof frame);
  tvs_file_options_init_sized(&options.known, sizeof options);
  TEST_ASSERT_EQUAL_UINT32(sizeof options, options.known.struct_size);
  TEST_ASSERT_EQUAL_UINT64(0, options.more);
  options.known.read = read_picture;
  options.known.frames_per_second = 10;
  TEST_ASSERT_EQUAL_INT(TVS_OK,
                        tvs_file_source_init_sized(memory, tvs_file_source_size(), &options.known,
                                                   &source.known, sizeof source));
  TEST_ASSERT_EQUAL_UINT32(sizeof source, source.known.struct_size);
  TEST_ASSERT_EQUAL_UINT64(0, source.more);
  frame.known.struct_size = sizeof frame;
  TEST_ASSERT_EQUAL_INT(TVS_OK, source.known.next(source.known.user, &frame.known));
  TEST_ASSERT_EQUAL_UINT32(sizeof frame, frame.known.struct_size);
  TEST_ASSERT_TRUE(frame.known.image.data == pixels);
  TEST_ASSERT_EQUAL_UINT64(0, frame.more);
  options.more = 1; /* what this library does not know */
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, tvs_file_source_init(memory, tvs_file_source_size(),
                                                                  &options.known, &source.known));
  free(memory);
}

/* An older caller's struct ends before its guard. */
static void test_an_older_callers_structs_are_not_written_beyond(void) {
  const size_t older = offsetof(tvs_file_options, imu);
  tvs_file_options options;
  tvs_frame frame;
  tvs_imu_source imu = {sizeof imu, NULL, next_imu};
  tvs_frame_source source;
  void *memory = malloc(tvs_file_source_size());
  memset(&options, 0x5a, sizeof options);
  tvs_file_options_init_sized(&options, older);
  TEST_ASSERT_EQUAL_UINT32(older, options.struct_size);
  TEST_ASSERT_EQUAL_DOUBLE(30, options.frames_per_second);
  TEST_ASSERT_EACH_EQUAL_HEX8(0x5a, (const uint8_t *)&options + older, sizeof options - older);
  /* No release had so small a struct, nor any of the sizes that follow. */
  options.read = read_picture;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE,
                        tvs_file_source_init(memory, tvs_file_source_size(), &options, &source));
  tvs_file_options_init(&options);
  options.read = read_picture;
  options.frames_per_second = 10;
  options.imu = &imu;
  imu.struct_size = 8;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE,
                        tvs_file_source_init(memory, tvs_file_source_size(), &options, &source));
  options.imu = NULL;
  TEST_ASSERT_EQUAL_INT(TVS_OK,
                        tvs_file_source_init(memory, tvs_file_source_size(), &options, &source));
  memset(&frame, 0, sizeof frame);
  frame.struct_size = offsetof(tvs_frame, attitude);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, source.next(source.user, &frame));
  TEST_ASSERT_NULL(frame.image.data);
  free(memory);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_unwrapped_and_mapped_within_its_uncertainty);
  RUN_TEST(test_a_late_packet_keeps_its_time);
  RUN_TEST(test_a_reboot_or_jump_is_another_clock);
  RUN_TEST(test_stamps_outside_the_period_are_refused);
  RUN_TEST(test_attitude_between_neighbours_or_unknown);
  RUN_TEST(test_the_ring_forgets_the_oldest);
  RUN_TEST(test_bad_attitudes_are_refused);
  RUN_TEST(test_slerp);
  RUN_TEST(test_euler_angles_turn_as_documented);
  RUN_TEST(test_the_file_source);
  RUN_TEST(test_a_newer_callers_structs_are_read_and_written_whole);
  RUN_TEST(test_an_older_callers_structs_are_not_written_beyond);
  return UNITY_END();
}
