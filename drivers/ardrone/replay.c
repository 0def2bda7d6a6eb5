#include "twoview_drivers/ardrone/replay.h"

#include <stdio.h>
#include <string.h>

#include "../source/sized.h"
#include "bytes.h"

#define MS INT64_C(1000000)
enum { RECORD_BYTES = 12, MAX_FOLDER_BYTES = 4000 };
static const int64_t TAKEN_LATER_NS = 10 * MS;

/* ---- reading the recorded files ---- */

/* Reads the next whole record of a navdata.log. A record with an impossible time or length ends the
   log. */
static int read_record(FILE *file, int64_t *host_ns, uint8_t *bytes, size_t capacity,
                       size_t *size) {
  uint8_t header[RECORD_BYTES];
  uint64_t time;
  if (fread(header, 1, sizeof header, file) != sizeof header) return 0;
  time = ardrone_get64(header);
  *size = ardrone_get32(header + 8);
  if (time > INT64_MAX / 4 || *size > capacity) return 0;
  *host_ns = (int64_t)time;
  return fread(bytes, 1, *size, file) == *size;
}

static void load_datagram(ardrone_replay *replay) {
  replay->has_datagram =
      replay->navdata && read_record(replay->navdata, &replay->datagram_ns, replay->datagram,
                                     sizeof replay->datagram, &replay->datagram_size);
}

/* Reads the next packet's header into the buffer: first its fixed part, which holds the length of
   the whole header, and then the rest. */
static int load_header(ardrone_replay *replay, ardrone_pave_header *header) {
  tvs_status status;
  FILE *file = replay->video;
  size_t size;
  if (fread(replay->header, 1, ARDRONE_PAVE_MIN_HEADER, file) != ARDRONE_PAVE_MIN_HEADER) return 0;
  status = ardrone_pave_decode(replay->header, ARDRONE_PAVE_MIN_HEADER, header);
  size = ardrone_get16(replay->header + 6);
  if (status == TVS_NONE) {
    /* TVS_NONE means that size is at most ARDRONE_PAVE_MAX_HEADER. */
    const size_t more = size - ARDRONE_PAVE_MIN_HEADER;
    if (fread(replay->header + ARDRONE_PAVE_MIN_HEADER, 1, more, file) != more) return 0;
    status = ardrone_pave_decode(replay->header, size, header);
  }
  replay->header_size = size;
  return status == TVS_OK;
}

static int read_frame_line(FILE *file, uint32_t number, int64_t *host_ns) {
  long long host, device;
  unsigned long long found;
  int key;
  return file && fscanf(file, "%lld %lld %llu %d", &host, &device, &found, &key) == 4 &&
         found == number && host >= 0 && host <= INT64_MAX / 4 && (*host_ns = host, 1);
}

static void load_packet(ardrone_replay *replay) {
  ardrone_pave_header header;
  replay->has_packet = replay->video && load_header(replay, &header);
  if (!replay->has_packet) return;
  replay->header_sent = 0;
  replay->payload_left = header.payload_size;
  if (!read_frame_line(replay->frames, header.frame_number, &replay->packet_ns)) {
    /* frames.txt is missing, at its end or not in step: from here on the packets' stamps give the
       times. Where a stamp goes back or jumps by more than 1 s, the packet comes after 33 ms. */
    const uint32_t step_ms = header.timestamp_ms - replay->paced_ms;
    replay->packet_ns = replay->paced_ns + (step_ms > 1000 ? 33 : step_ms) * MS;
    if (replay->frames) fclose(replay->frames);
    replay->frames = NULL;
  }
  replay->paced_ns = replay->packet_ns;
  replay->paced_ms = header.timestamp_ms;
}

/* ---- the recording as a transport ---- */

static int64_t due(const ardrone_replay *replay, int64_t recorded_ns) {
  return recorded_ns - replay->origin_ns + replay->begin_ns;
}

static tvs_status open_channel(void *user, ardrone_channel channel, int64_t now_ns) {
  const ardrone_replay *replay = user;
  (void)now_ns;
  if (channel == ARDRONE_CHANNEL_VIDEO) return replay->video ? TVS_OK : TVS_ERR_IO;
  return channel == ARDRONE_CHANNEL_AT || channel == ARDRONE_CHANNEL_NAVDATA ? TVS_OK : TVS_ERR_IO;
}

static tvs_status send_nowhere(void *user, ardrone_channel channel, const void *bytes,
                               size_t size) {
  (void)user;
  (void)channel;
  (void)bytes;
  (void)size;
  return TVS_OK;
}

static tvs_status receive_navdata(ardrone_replay *replay, void *bytes, size_t capacity,
                                  size_t *size) {
  if (!replay->has_datagram || due(replay, replay->datagram_ns) > replay->now_ns) return TVS_NONE;
  *size = replay->datagram_size < capacity ? replay->datagram_size : capacity;
  memcpy(bytes, replay->datagram, *size);
  load_datagram(replay);
  return TVS_OK;
}

static tvs_status receive_video(ardrone_replay *replay, void *bytes, size_t capacity,
                                size_t *size) {
  const size_t header_left = replay->header_size - replay->header_sent;
  if (!replay->has_packet) return TVS_END;
  if (due(replay, replay->packet_ns) > replay->now_ns) return TVS_NONE;
  if (header_left > 0) {
    *size = header_left < capacity ? header_left : capacity;
    memcpy(bytes, replay->header + replay->header_sent, *size);
    replay->header_sent += *size;
  } else {
    *size = replay->payload_left < capacity ? replay->payload_left : capacity;
    *size = fread(bytes, 1, *size, replay->video);
    replay->payload_left -= *size;
    /* Where the file ends within a payload, the parser drops the incomplete packet. */
    if (*size == 0) replay->payload_left = 0;
  }
  if (replay->header_sent == replay->header_size && replay->payload_left == 0) {
    load_packet(replay);
  }
  return *size > 0 ? TVS_OK : TVS_NONE;
}

static tvs_status receive_bytes(void *user, ardrone_channel channel, void *bytes, size_t capacity,
                                size_t *size) {
  if (capacity == 0) return TVS_NONE;
  if (channel == ARDRONE_CHANNEL_NAVDATA) return receive_navdata(user, bytes, capacity, size);
  if (channel == ARDRONE_CHANNEL_VIDEO) return receive_video(user, bytes, capacity, size);
  return TVS_NONE;
}

static void close_channel(void *user, ardrone_channel channel) {
  (void)user;
  (void)channel;
}

static FILE *open_file(const char *folder, const char *name) {
  char path[MAX_FOLDER_BYTES + 32];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return fopen(path, "rb");
}

tvs_status ardrone_replay_open_sized(ardrone_replay *replay, const char *folder,
                                     ardrone_transport *transport, size_t transport_size) {
  const ardrone_transport own = {
      0, replay, open_channel, send_nowhere, receive_bytes, close_channel, NULL};
  if (!replay || !folder || !transport) return TVS_ERR_NULL;
  if (strlen(folder) >= MAX_FOLDER_BYTES) return TVS_ERR_ARGUMENT;
  memset(replay, 0, sizeof *replay);
  replay->navdata = open_file(folder, "navdata.log");
  replay->video = open_file(folder, "video.pave");
  if (!replay->navdata && !replay->video) return TVS_ERR_IO;
  replay->frames = open_file(folder, "frames.txt");
  replay->now_ns = INT64_MIN;
  load_datagram(replay);
  replay->paced_ns = replay->has_datagram ? replay->datagram_ns : 0;
  load_packet(replay);
  replay->origin_ns = replay->has_datagram ? replay->datagram_ns : replay->packet_ns;
  if (replay->has_packet && replay->packet_ns < replay->origin_ns) {
    replay->origin_ns = replay->packet_ns;
  }
  tvs_write_sized(&own, sizeof own, transport, transport_size);
  return TVS_OK;
}

void ardrone_replay_close(ardrone_replay *replay) {
  if (!replay) return;
  if (replay->navdata) fclose(replay->navdata);
  if (replay->video) fclose(replay->video);
  if (replay->frames) fclose(replay->frames);
  memset(replay, 0, sizeof *replay);
}

void ardrone_replay_advance(ardrone_replay *replay, int64_t now_ns) {
  if (!replay) return;
  if (replay->now_ns == INT64_MIN) replay->begin_ns = now_ns;
  replay->now_ns = now_ns;
}

int64_t ardrone_replay_next_ns(const ardrone_replay *replay) {
  int64_t next_ns = INT64_MAX;
  if (!replay) return next_ns;
  if (replay->has_datagram) next_ns = due(replay, replay->datagram_ns);
  if (replay->has_packet && due(replay, replay->packet_ns) < next_ns) {
    next_ns = due(replay, replay->packet_ns);
  }
  /* If bytes are due already, the session is not receiving them: it has closed their channel, and
     opens it again after its clock has advanced. Ask again in 10 ms. */
  return next_ns > replay->now_ns ? next_ns : replay->now_ns + TAKEN_LATER_NS;
}

int64_t ardrone_replay_host_ns(const ardrone_replay *replay, int64_t now_ns) {
  return replay ? now_ns - replay->begin_ns + replay->origin_ns : 0;
}

/* ---- a log as an IMU source ---- */

static void read_packet(ardrone_log *log, const ardrone_navdata *navdata, int64_t host_ns,
                        tvs_imu *sample) {
  const double radian_per_mdeg = 1.7453292519943295e-5;
  tvs_time time;
  memset(&time, 0, sizeof time);
  time.host_ns = time.received_ns = host_ns;
  if (ARDRONE_HAS(navdata, ARDRONE_TAG_TIME)) {
    tvs_clock_observe(&log->clock, ardrone_time_ns(navdata->time), host_ns, &time);
  }
  time.device_ns = time.host_ns;
  if (ARDRONE_HAS(navdata, ARDRONE_TAG_DEMO) && navdata->demo.psi_mdeg >= -360e3f &&
      navdata->demo.psi_mdeg <= 360e3f && (!log->has_psi0 || log->psi0_clock_id != time.clock_id)) {
    log->has_psi0 = 1;
    log->psi0_clock_id = time.clock_id;
    log->psi0_rad = navdata->demo.psi_mdeg * radian_per_mdeg;
  }
  ardrone_navdata_to_imu(navdata, log->psi0_rad, sample);
  sample->time = time;
  sample->attitude.clock_id = time.clock_id;
}

static tvs_status next_sample(void *user, tvs_imu *sample) {
  ardrone_log *log = user;
  tvs_imu own;
  uint8_t bytes[ARDRONE_NAVDATA_MAX_BYTES];
  ardrone_navdata navdata;
  int64_t host_ns;
  size_t size;
  if (!sample) return TVS_ERR_NULL;
  if (!tvs_is_sized(sample, TVS_SIZE_THROUGH(tvs_imu, pressure_sigma))) return TVS_ERR_STRUCT_SIZE;
  memset(&own, 0, sizeof own);
  own.struct_size = sizeof own;
  while (log->file && read_record(log->file, &host_ns, bytes, sizeof bytes, &size)) {
    if (ardrone_navdata_decode(bytes, size, &navdata) != TVS_OK ||
        ardrone_sequence_check(&log->sequence, &navdata) == ARDRONE_ORDER_LATE) {
      continue;
    }
    read_packet(log, &navdata, host_ns, &own);
    if (own.valid == 0) continue;
    tvs_write_sized(&own, sizeof own, sample, sample->struct_size);
    return TVS_OK;
  }
  return TVS_END;
}

tvs_status ardrone_log_open_sized(ardrone_log *log, const char *path, tvs_imu_source *source,
                                  size_t source_size) {
  const tvs_imu_source own = {0, log, next_sample};
  tvs_clock_options options;
  if (!log || !path || !source) return TVS_ERR_NULL;
  memset(log, 0, sizeof *log);
  log->file = fopen(path, "rb");
  if (!log->file) return TVS_ERR_IO;
  tvs_clock_options_init(&options);
  options.period_ns = ARDRONE_TIME_PERIOD_NS;
  tvs_clock_init(&log->clock, &options, 1, 1);
  tvs_write_sized(&own, sizeof own, source, source_size);
  return TVS_OK;
}

void ardrone_log_close(ardrone_log *log) {
  if (!log || !log->file) return;
  fclose(log->file);
  log->file = NULL;
}
