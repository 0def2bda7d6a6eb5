/* A drone in memory, in virtual time: a transport whose other side acknowledges, flies, films,
   loses, doubles and reorders datagrams, cuts and stalls connections, and reboots. A picture's
   payload is its number; the decoder refuses a picture whose predecessor it has not decoded. */
#ifndef TEST_SUPPORT_ARDRONE_MOCK_H
#define TEST_SUPPORT_ARDRONE_MOCK_H

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "encode.h"
#include "support/random.h"
#include "twoview_drivers/ardrone/session.h"
#include "twoview_drivers/attitude.h"

#define MOCK_MS INT64_C(1000000)
enum { MOCK_DATAGRAMS = 64, MOCK_STREAM = 1 << 20, MOCK_GOP = 15, MOCK_PAYLOAD = 1500 };

typedef struct mock_datagram {
  int64_t due_ns;
  size_t size;
  uint8_t bytes[1200];
} mock_datagram;

typedef struct mock_drone {
  uint64_t seed;
  int64_t now_ns, boot_ns;
  int32_t lose_permille, double_permille, reorder_permille;
  int navdata_off, video_off, video_refused, deaf; /* each 1 is a fault that is on */
  int advertises; /* 1: a packet without payload announces each picture */
  /* 1: the clock of the video's time stamps starts at another time than that of navdata */
  int clocks_differ;
  int64_t video_latency_ns;

  uint32_t state, sequence;
  int client, full, acknowledged;
  int64_t next_navdata_ns, next_frame_ns;
  mock_datagram queue[MOCK_DATAGRAMS];

  int video_open, video_ended, video_half_open; /* half open: no byte arrives */
  uint32_t frame_number;
  uint8_t stream[MOCK_STREAM];
  size_t stream_begin, stream_end;
  int64_t stream_delay[64];

  int control_open, control_sent;
  const char *control_text;
  size_t control_size;

  /* the commands that the drone received */
  int32_t last_command;
  /* how often the command number fell to 1, and how often to another lower number */
  int num_restarts, num_falls;
  int num_commands, num_refs, num_take_offs, num_pcmds, num_configs;
  char last_key[64], last_value[64];
  int flies;
} mock_drone;

static inline int mock_chance(mock_drone *d, int32_t permille) {
  return random_int(&d->seed, 0, 999) < permille;
}

static inline double mock_yaw(const mock_drone *d, double device_s) {
  (void)d;
  return 0.8 * sin(1.3 * device_s) + 0.3;
}

static inline void mock_init(mock_drone *d, uint64_t seed) {
  memset(d, 0, sizeof *d);
  d->seed = seed;
  d->video_latency_ns = 120 * MOCK_MS;
  d->control_text = "general:num_version_soft = 2.4.8\ncontrol:altitude_max = 3000\n";
  d->control_size = strlen(d->control_text) + 1;
}

static inline void mock_boot(mock_drone *d) {
  d->boot_ns = d->now_ns;
  d->state = ARDRONE_STATE_BOOTSTRAP | ARDRONE_STATE_NAVDATA_THREAD;
  d->sequence = 0;
  d->client = d->full = d->acknowledged = d->flies = 0;
  d->frame_number = 0;
  d->last_command = 0;
  if (d->video_open) d->video_ended = 1;
}

static inline double mock_device_s(const mock_drone *d) {
  /* The clock starts at 2040 s, so that it soon wraps, at 2048 s. */
  return (double)(d->now_ns - d->boot_ns) * 1e-9 + 2040;
}

static inline void mock_post(mock_drone *d, const uint8_t *bytes, size_t size) {
  int copies = 1 + mock_chance(d, d->double_permille), k;
  if (mock_chance(d, d->lose_permille)) return;
  for (k = 0; k < MOCK_DATAGRAMS && copies > 0; ++k) {
    mock_datagram *q = &d->queue[k];
    if (q->size > 0) continue;
    q->due_ns = d->now_ns + random_int(&d->seed, 1000000, 4000000);
    if (mock_chance(d, d->reorder_permille)) q->due_ns += random_int(&d->seed, 0, 30000000);
    TEST_ASSERT_TRUE(size <= sizeof q->bytes);
    memcpy(q->bytes, bytes, size);
    q->size = size;
    --copies;
  }
}

static inline void mock_send_navdata(mock_drone *d) {
  static ardrone_navdata n;
  uint8_t bytes[1200];
  size_t size;
  const double t = mock_device_s(d);
  memset(&n, 0, sizeof n);
  n.state = (d->state & ~(uint32_t)ARDRONE_STATE_ACKNOWLEDGE) |
            (d->acknowledged ? ARDRONE_STATE_ACKNOWLEDGE : 0) |
            (d->flies ? ARDRONE_STATE_FLYING : 0);
  n.sequence = ++d->sequence;
  if ((d->state & ARDRONE_STATE_BOOTSTRAP) == 0) {
    n.present = 1u << ARDRONE_TAG_DEMO | 1u << ARDRONE_TAG_TIME;
    n.demo.psi_mdeg = (float)(mock_yaw(d, t) * 57.29577951308232e3);
    n.demo.battery_percent = 77;
    n.time = ardrone_encode_time((int64_t)(t * 1e9));
  }
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_navdata(&n, bytes, sizeof bytes, &size));
  mock_post(d, bytes, size);
}

static inline void mock_send_frame(mock_drone *d) {
  ardrone_pave_header h;
  uint8_t payload[MOCK_PAYLOAD] = {0};
  size_t size;
  const uint32_t number = ++d->frame_number;
  if (!d->video_open || d->video_ended || d->video_half_open) return;
  memset(&h, 0, sizeof h);
  h.version = 2;
  h.codec = ARDRONE_PAVE_H264;
  h.header_size = 68;
  h.payload_size = MOCK_PAYLOAD;
  h.encoded_width = 640;
  h.encoded_height = 368;
  h.frame_number = number;
  /* The picture was taken one latency ago. */
  h.timestamp_ms = (uint32_t)((mock_device_s(d) - (double)d->video_latency_ns * 1e-9) * 1e3 +
                              (d->clocks_differ ? 987654 : 0));
  h.frame_type = number % MOCK_GOP == 1 ? ARDRONE_PAVE_IDR : ARDRONE_PAVE_P;
  memcpy(payload, &number, sizeof number);
  payload[4] = h.frame_type;
  if (d->stream_end + MOCK_PAYLOAD + 2 * 68 > MOCK_STREAM) {
    memmove(d->stream, d->stream + d->stream_begin, d->stream_end - d->stream_begin);
    d->stream_end -= d->stream_begin;
    d->stream_begin = 0;
    /* The client has not read: the buffer is full, and this picture is dropped. */
    if (d->stream_end + MOCK_PAYLOAD + 2 * 68 > MOCK_STREAM) return;
  }
  if (d->advertises) {
    ardrone_pave_header announced = h;
    announced.payload_size = 0;
    announced.advertised_size = MOCK_PAYLOAD;
    announced.control = ARDRONE_PAVE_ADVERTISEMENT;
    TEST_ASSERT_EQUAL_INT(TVS_OK,
                          ardrone_encode_pave(&announced, payload, d->stream + d->stream_end,
                                              MOCK_STREAM - d->stream_end, &size));
    d->stream_end += size;
  }
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_pave(&h, payload, d->stream + d->stream_end,
                                                    MOCK_STREAM - d->stream_end, &size));
  d->stream_end += size;
}

static inline void mock_advance(mock_drone *d, int64_t now_ns) {
  d->now_ns = now_ns;
  if (d->next_navdata_ns == 0) d->next_navdata_ns = d->next_frame_ns = now_ns;
  while (now_ns >= d->next_navdata_ns) {
    d->next_navdata_ns += d->full ? 5 * MOCK_MS : 66 * MOCK_MS;
    if (d->client && !d->navdata_off) mock_send_navdata(d);
  }
  while (now_ns >= d->next_frame_ns) {
    d->next_frame_ns += 33333333;
    if (!d->video_off) mock_send_frame(d);
  }
}

/* ---- the mock drone's side of the connection ---- */

static inline void mock_obey(mock_drone *d, char *line) {
  char *comma = strchr(line, ',');
  const char *equals = strchr(line, '=');
  const long number = equals ? strtol(equals + 1, NULL, 10) : 0;
  ++d->num_commands;
  if (number == 1) {
    d->num_restarts += d->last_command > 0;
  } else if (number <= d->last_command) {
    ++d->num_falls;
    return;
  }
  d->last_command = (int32_t)number;
  if (strncmp(line, "AT*REF=", 7) == 0) {
    const long bits = strtol(comma + 1, NULL, 10);
    ++d->num_refs;
    d->num_take_offs += (bits >> 9) & 1;
    d->flies = (bits >> 9) & 1;
  } else if (strncmp(line, "AT*PCMD", 7) == 0) {
    ++d->num_pcmds;
  } else if (strncmp(line, "AT*CONFIG=", 10) == 0) {
    ++d->num_configs;
    d->acknowledged = 1;
    sscanf(comma, ",\"%63[^\"]\",\"%63[^\"]\"", d->last_key, d->last_value);
    if (strcmp(d->last_key, "general:navdata_demo") == 0) {
      d->state &= ~(uint32_t)ARDRONE_STATE_BOOTSTRAP;
      d->full = strcmp(d->last_value, "FALSE") == 0;
    }
  } else if (strncmp(line, "AT*CTRL=", 8) == 0) {
    const long mode = strtol(comma + 1, NULL, 10);
    if (mode == 5) d->acknowledged = 0;
    if (mode == 4 && d->control_open) d->control_sent = 1, d->acknowledged = 1;
  }
}

static inline tvs_status mock_open(void *user, ardrone_channel channel, int64_t now_ns) {
  mock_drone *d = user;
  (void)now_ns;
  if (channel == ARDRONE_CHANNEL_VIDEO) {
    if (d->video_refused) return TVS_ERR_IO;
    d->video_open = 1;
    d->video_ended = d->video_half_open = 0;
    d->stream_begin = d->stream_end = 0;
  }
  if (channel == ARDRONE_CHANNEL_CONTROL) {
    d->control_open = 1;
    d->control_sent = 0;
  }
  return TVS_OK;
}

static inline tvs_status mock_send(void *user, ardrone_channel channel, const void *bytes,
                                   size_t size) {
  mock_drone *d = user;
  char text[ARDRONE_AT_MAX_BYTES + 1];
  char *line;
  if (d->deaf || mock_chance(d, d->lose_permille)) return TVS_OK;
  if (channel == ARDRONE_CHANNEL_NAVDATA) {
    d->client = 1;
    return TVS_OK;
  }
  TEST_ASSERT_TRUE(size > 0 && size <= ARDRONE_AT_MAX_BYTES);
  memcpy(text, bytes, size);
  text[size] = '\0';
  TEST_ASSERT_EQUAL_INT('\r', text[size - 1]);
  for (line = strtok(text, "\r"); line; line = strtok(NULL, "\r")) mock_obey(d, line);
  return TVS_OK;
}

static inline tvs_status mock_receive(void *user, ardrone_channel channel, void *bytes,
                                      size_t capacity, size_t *size) {
  mock_drone *d = user;
  size_t take;
  if (channel == ARDRONE_CHANNEL_NAVDATA) {
    int k, best = -1;
    for (k = 0; k < MOCK_DATAGRAMS; ++k) {
      if (d->queue[k].size == 0 || d->queue[k].due_ns > d->now_ns) continue;
      if (best < 0 || d->queue[k].due_ns < d->queue[best].due_ns) best = k;
    }
    if (best < 0) return TVS_NONE;
    TEST_ASSERT_TRUE(d->queue[best].size <= capacity);
    memcpy(bytes, d->queue[best].bytes, d->queue[best].size);
    *size = d->queue[best].size;
    d->queue[best].size = 0;
    return TVS_OK;
  }
  if (channel == ARDRONE_CHANNEL_CONTROL) {
    if (d->control_sent != 1) return TVS_NONE;
    take = d->control_size < capacity ? d->control_size : capacity;
    memcpy(bytes, d->control_text, take);
    *size = take;
    d->control_sent = 2;
    return TVS_OK;
  }
  if (!d->video_open) return TVS_ERR_IO;
  take = d->stream_end - d->stream_begin;
  if (take == 0) return d->video_ended ? TVS_END : TVS_NONE;
  if (take > capacity) take = capacity;
  if (take > 1) take = (size_t)random_int(&d->seed, 1, (int32_t)take);
  memcpy(bytes, d->stream + d->stream_begin, take);
  d->stream_begin += take;
  *size = take;
  return TVS_OK;
}

static inline void mock_close(void *user, ardrone_channel channel) {
  mock_drone *d = user;
  if (channel == ARDRONE_CHANNEL_VIDEO) d->video_open = 0;
  if (channel == ARDRONE_CHANNEL_CONTROL) d->control_open = 0;
}

static inline ardrone_transport mock_transport(mock_drone *d) {
  const ardrone_transport t = {sizeof t, d, mock_open, mock_send, mock_receive, mock_close, NULL};
  return t;
}

/* ---- a mock video decoder ---- */

typedef struct mock_decoder {
  uint32_t last;
  int has_last, num_held, num_decoded, num_refused;
} mock_decoder;

static uint8_t mock_pixels[16];

static inline tvs_status mock_decode(void *user, const uint8_t *bytes, size_t size,
                                     tvs_picture *picture) {
  mock_decoder *m = user;
  uint32_t number;
  TEST_ASSERT_EQUAL_UINT64(MOCK_PAYLOAD, size);
  memcpy(&number, bytes, sizeof number);
  if (bytes[4] != ARDRONE_PAVE_IDR && !(m->has_last && number == m->last + 1)) {
    ++m->num_refused;
    return TVS_ERR_DATA;
  }
  m->has_last = 1;
  m->last = number;
  ++m->num_held;
  ++m->num_decoded;
  picture->image.data = mock_pixels;
  picture->image.width = picture->image.height = 4;
  picture->image.stride_bytes = 4;
  picture->handle = m;
  return TVS_OK;
}

static inline void mock_release(void *user, tvs_picture *picture) {
  mock_decoder *m = user;
  TEST_ASSERT_TRUE(picture->handle == m);
  --m->num_held;
}

static inline void mock_reset(void *user) { ((mock_decoder *)user)->has_last = 0; }

static inline tvs_decoder mock_decoder_of(mock_decoder *m) {
  const tvs_decoder decoder = {sizeof decoder, m, mock_decode, mock_release, mock_reset};
  memset(m, 0, sizeof *m);
  return decoder;
}

#endif
