/* A recording of the drone in memory is played back, complete and cut at any byte. */
#include <stdio.h>
#include <unistd.h>

#include "support/ardrone_mock.h"
#include "twoview_drivers/ardrone/replay.h"

static mock_drone drone;
static mock_decoder own_decoder;
static char folder[] = "/tmp/ardrone_replay_XXXXXX";
static FILE *navdata_log, *video_pave, *frames_txt;
static int64_t now;
static int num_recorded_packets, num_recorded_navdata;
static int num_undecodable; /* packets before the first IDR picture, where decoding begins */
static int num_navdata, num_frames, num_gaps;
static ardrone_replay replay;
/* 1: frames.txt has when each picture was taken, as `twoview drone record` writes it; 0: when its
   packet came. */
static int writes_taken;
static int64_t taken_ns[256]; /* of each picture, by its number, when it was recorded */
static int64_t worst_ns;      /* the largest difference from that when it was played */

void setUp(void) {}
void tearDown(void) {}

static FILE *create(const char *name) {
  char path[256];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return fopen(path, "wb");
}

static void record_navdata(void *user, const uint8_t *bytes, size_t size,
                           const ardrone_navdata *navdata, const tvs_imu *imu) {
  uint8_t header[12];
  uint64_t time = (uint64_t)now;
  int k;
  (void)user;
  (void)navdata;
  (void)imu;
  for (k = 0; k < 8; ++k) header[k] = (uint8_t)(time >> 8 * k);
  for (k = 0; k < 4; ++k) header[8 + k] = (uint8_t)(size >> 8 * k);
  fwrite(header, 1, sizeof header, navdata_log);
  fwrite(bytes, 1, size, navdata_log);
  ++num_recorded_navdata;
}

static void record_packet(void *user, const ardrone_pave_packet *packet, const tvs_time *time,
                          int gate) {
  (void)user;
  (void)gate;
  fwrite(packet->bytes, 1, packet->size, video_pave);
  fprintf(frames_txt, "%lld %lld %u %d\n", (long long)(writes_taken ? time->host_ns : now),
          (long long)time->device_ns, packet->header.frame_number,
          packet->header.frame_type == ARDRONE_PAVE_IDR);
  TEST_ASSERT_TRUE(packet->header.frame_number < 256);
  taken_ns[packet->header.frame_number] = time->host_ns;
  if (num_undecodable == num_recorded_packets && packet->header.frame_type != ARDRONE_PAVE_IDR) {
    ++num_undecodable;
  }
  ++num_recorded_packets;
}

/* Makes a recording of four seconds. It has no video for `silent_ms` from the end of its first
   second on, and no navdata in the last 250 ms of this silence. */
static void make_recording(int64_t silent_ms) {
  ardrone_session_options options;
  const ardrone_transport transport = mock_transport(&drone);
  ardrone_session *session;
  size_t size;
  void *memory;
  navdata_log = create("navdata.log");
  video_pave = create("video.pave");
  frames_txt = create("frames.txt");
  mock_init(&drone, 3);
  now = drone.now_ns = 5000 * MOCK_MS;
  mock_boot(&drone);
  drone.video_latency_ns = 50 * MOCK_MS;
  ardrone_session_options_init(&options);
  options.skip_to_latest = 0;
  options.on_navdata = record_navdata;
  options.on_packet = record_packet;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_size(&options, &size));
  memory = malloc(size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_init(&session, &options, &transport, memory, size));
  num_recorded_packets = num_recorded_navdata = num_undecodable = 0;
  for (; now < 9000 * MOCK_MS; now += 4 * MOCK_MS) {
    drone.video_off = now >= 6000 * MOCK_MS && now < (6000 + silent_ms) * MOCK_MS;
    drone.navdata_off = drone.video_off && now >= (6000 + silent_ms - 250) * MOCK_MS;
    mock_advance(&drone, now);
    ardrone_session_step(session, now);
  }
  ardrone_session_close(session);
  free(memory);
  fclose(navdata_log);
  fclose(video_pave);
  fclose(frames_txt);
}

static void count_navdata(void *user, const uint8_t *bytes, size_t size,
                          const ardrone_navdata *navdata, const tvs_imu *imu) {
  (void)user;
  (void)bytes;
  (void)size;
  (void)navdata;
  (void)imu;
  ++num_navdata;
}

static void count_frame(void *user, const tvs_frame *frame) {
  (void)user;
  ++num_frames;
  num_gaps += (frame->flags & TVS_FRAME_GAP) != 0;
  {
    const int64_t taken = ardrone_replay_host_ns(&replay, frame->time.host_ns);
    const int64_t off = llabs(taken - taken_ns[frame->number]);
    if (off > worst_ns) worst_ns = off;
  }
}

/* Plays the recording without waiting. Returns the playing time in ms. */
static int64_t play(void) {
  ardrone_session_options options;
  ardrone_transport transport;
  tvs_decoder decoder = mock_decoder_of(&own_decoder);
  ardrone_session *session;
  size_t size;
  void *memory;
  const int64_t begin = 77 * MOCK_MS;
  int64_t t = begin;
  num_navdata = num_frames = num_gaps = 0;
  worst_ns = 0;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_replay_open(&replay, folder, &transport));
  ardrone_session_options_init(&options);
  options.listen_only = 1;
  options.skip_to_latest = 0;
  options.queue_frames = 0;
  options.decoder = &decoder;
  options.on_navdata = count_navdata;
  options.on_frame = count_frame;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_size(&options, &size));
  memory = malloc(size);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_init(&session, &options, &transport, memory, size));
  for (;;) {
    ardrone_replay_advance(&replay, t);
    TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_step(session, t));
    if (ardrone_replay_next_ns(&replay) == INT64_MAX) break;
    TEST_ASSERT_TRUE(ardrone_replay_next_ns(&replay) > t);
    t = ardrone_replay_next_ns(&replay);
    TEST_ASSERT_TRUE(t < begin + 60000 * MOCK_MS);
  }
  ardrone_session_close(session);
  free(memory);
  ardrone_replay_close(&replay);
  return (t - begin) / MOCK_MS;
}

static void test_a_recording_plays_back_whole(void) {
  const int64_t took = play();
  TEST_ASSERT_TRUE(took > 3500 && took < 4100);
  TEST_ASSERT_EQUAL_INT(num_recorded_navdata, num_navdata);
  TEST_ASSERT_EQUAL_INT(num_recorded_packets - num_undecodable, num_frames);
  TEST_ASSERT_EQUAL_INT(0, num_gaps);
}

/* Whichever of its two times frames.txt has, a picture is of the same instant as when it was
   recorded, but for the milliseconds in which the first packets find the drone's clock. */
static void test_a_played_picture_was_taken_when_it_was(void) {
  TEST_ASSERT_TRUE(worst_ns < 3 * MOCK_MS);
  writes_taken = 1;
  make_recording(0);
  play();
  TEST_ASSERT_EQUAL_INT(num_recorded_packets - num_undecodable, num_frames);
  TEST_ASSERT_TRUE(worst_ns < 3 * MOCK_MS);
  writes_taken = 0;
  make_recording(0);
}

/* After the silence the session closes the video stream, and opens it again shortly after the
   next packet is due. */
static void test_a_silence_is_played_over(void) {
  make_recording(1300);
  TEST_ASSERT_TRUE(play() > 3500);
  TEST_ASSERT_EQUAL_INT(num_recorded_navdata, num_navdata);
  TEST_ASSERT_TRUE(num_frames > 40 && num_gaps > 0);
  make_recording(0);
}

static void cut(const char *name, long bytes) {
  char path[256];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  TEST_ASSERT_EQUAL_INT(0, truncate(path, bytes));
}

static long length_of(const char *name) {
  char path[256];
  FILE *file;
  long length;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  file = fopen(path, "rb");
  fseek(file, 0, SEEK_END);
  length = ftell(file);
  fclose(file);
  return length;
}

static void test_a_log_is_an_imu_source(void) {
  ardrone_log log;
  tvs_imu_source source;
  tvs_imu sample;
  char path[256];
  int64_t last = 0;
  int num = 0;
  snprintf(path, sizeof path, "%s/navdata.log", folder);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_log_open(&log, path, &source));
  sample.struct_size = sizeof sample;
  while (source.next(source.user, &sample) == TVS_OK) {
    TEST_ASSERT_TRUE(sample.valid & TVS_IMU_ATTITUDE);
    TEST_ASSERT_EQUAL_UINT32(1, sample.time.clock_id);
    TEST_ASSERT_TRUE(sample.time.device_ns > last);
    last = sample.time.device_ns;
    ++num;
  }
  TEST_ASSERT_TRUE(num > 700 && last > 8900 * MOCK_MS && last < 9000 * MOCK_MS);
  ardrone_log_close(&log);
  TEST_ASSERT_EQUAL_INT(TVS_ERR_IO, ardrone_log_open(&log, "/nowhere/at/all", &source));
}

/* The recording is cut shorter and shorter: the counts never rise from one cut to the next, and
   the decoder refuses no picture. */
static void test_a_recording_cut_at_any_byte(void) {
  long video = length_of("video.pave"), navdata = length_of("navdata.log");
  int frames_before = num_recorded_packets, navdata_before = num_recorded_navdata;
  int k;
  for (k = 0; k < 150 && video > 0; ++k) {
    video -= k < 70 ? 1 : 1567; /* steps of 1 byte cut everywhere in a packet */
    navdata -= k < 70 ? 3 : 1001;
    if (video < 0) video = 0;
    if (navdata < 0) navdata = 0;
    cut("video.pave", video);
    cut("navdata.log", navdata);
    if (k == 30) cut("frames.txt", length_of("frames.txt") / 2);
    play();
    {
      const int whole = (int)(video / (MOCK_PAYLOAD + 68)) - num_undecodable;
      TEST_ASSERT_EQUAL_INT(whole > 0 ? whole : 0, num_frames);
    }
    TEST_ASSERT_TRUE(num_frames <= frames_before && num_navdata <= navdata_before);
    TEST_ASSERT_EQUAL_INT(0, own_decoder.num_refused);
    frames_before = num_frames;
    navdata_before = num_navdata;
  }
}

static void test_a_folder_that_is_no_recording(void) {
  ardrone_transport transport;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_IO, ardrone_replay_open(&replay, "/nowhere/at/all", &transport));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, ardrone_replay_open(&replay, NULL, &transport));
}

static void remove_recording(void) {
  static const char *const names[] = {"navdata.log", "video.pave", "frames.txt"};
  char path[256];
  int k;
  for (k = 0; k < 3; ++k) {
    snprintf(path, sizeof path, "%s/%s", folder, names[k]);
    remove(path);
  }
  rmdir(folder);
}

int main(void) {
  int result;
  UNITY_BEGIN();
  if (!mkdtemp(folder)) return 1;
  make_recording(0);
  RUN_TEST(test_a_recording_plays_back_whole);
  RUN_TEST(test_a_played_picture_was_taken_when_it_was);
  RUN_TEST(test_a_silence_is_played_over);
  RUN_TEST(test_a_log_is_an_imu_source);
  RUN_TEST(test_a_recording_cut_at_any_byte);
  RUN_TEST(test_a_folder_that_is_no_recording);
  result = UNITY_END();
  remove_recording();
  return result;
}
