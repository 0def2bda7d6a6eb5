#include <string.h>

#include "../source/sized.h"
#include "session_impl.h"

static const uint32_t DEFAULT_OPTIONS =
    1u << ARDRONE_TAG_DEMO | 1u << ARDRONE_TAG_TIME | 1u << ARDRONE_TAG_PHYS_MEASURES |
    1u << ARDRONE_TAG_ALTITUDE | 1u << ARDRONE_TAG_PRESSURE | 1u << ARDRONE_TAG_VISION_DETECT;

static void set_defaults(ardrone_session_options *options) {
  memset(options, 0, sizeof *options);
  options->navdata_options = DEFAULT_OPTIONS;
  options->full_navdata = 1;
  options->video = 1;
  options->skip_to_latest = 1;
  options->name = "twoview";
  options->queue_frames = 4;
  options->max_gap_ns = 150 * MS;
}

void ardrone_session_options_init_sized(ardrone_session_options *options, size_t struct_size) {
  ardrone_session_options own;
  if (!options) return;
  set_defaults(&own);
  tvs_write_sized(&own, sizeof own, options, struct_size);
}

static tvs_status read_options(const ardrone_session_options *given,
                               ardrone_session_options *options, tvs_decoder *decoder) {
  tvs_status status;
  if (!given) return TVS_ERR_NULL;
  set_defaults(options);
  status = tvs_read_sized(given, TVS_SIZE_THROUGH(ardrone_session_options, on_frame), options,
                          sizeof *options);
  if (status != TVS_OK) return status;
  if (!options->name) return TVS_ERR_NULL;
  if (strlen(options->name) > MAX_NAME_BYTES || options->max_gap_ns < 0 ||
      options->video_codec < 0 || options->video_codec > 255 || options->queue_frames < 0 ||
      options->queue_frames > QUEUE_FRAMES) {
    return TVS_ERR_ARGUMENT;
  }
  memset(decoder, 0, sizeof *decoder);
  return options->decoder ? tvs_read_sized(options->decoder, TVS_SIZE_THROUGH(tvs_decoder, reset),
                                           decoder, sizeof *decoder)
                          : TVS_OK;
}

static size_t bytes_needed(const ardrone_session_options *options) {
  return sizeof(ardrone_session) +
         ARDRONE_PAVE_BUFFER_BYTES * (size_t)((options->video != 0) + (options->recording != 0));
}

tvs_status ardrone_session_size(const ardrone_session_options *options, size_t *size_bytes) {
  ardrone_session_options read;
  tvs_decoder decoder;
  const tvs_status status = read_options(options, &read, &decoder);
  if (status != TVS_OK) return status;
  if (!size_bytes) return TVS_ERR_NULL;
  *size_bytes = bytes_needed(&read);
  return TVS_OK;
}

static uint8_t *init_stream(stream *s, ardrone_channel channel, int wanted, uint8_t *buffer) {
  s->channel = channel;
  s->retry_ns = INT64_MIN;
  if (!wanted) return buffer;
  ardrone_pave_init(&s->parser, buffer, ARDRONE_PAVE_BUFFER_BYTES);
  return buffer + ARDRONE_PAVE_BUFFER_BYTES;
}

static void init_clocks(ardrone_session *session) {
  tvs_clock_options options;
  tvs_clock_options_init(&options);
  options.period_ns = ARDRONE_TIME_PERIOD_NS;
  tvs_clock_init(&session->navdata_clock, &options, 1, 2);
  options.period_ns = INT64_C(4294967296) * MS; /* the stamp is a 32-bit count of milliseconds */
  options.least_delay_ns =
      300 * MS; /* the delay of exposure, encoder and queues, which cannot be observed here */
  tvs_clock_init(&session->video_clock, &options, 2, 2);
}

/* The ids of the user and the application are made from the name; the session's id is made from the
   name and the time of the first step, so that it differs each time. */
static void make_ids(ardrone_session *session) {
  char text[MAX_NAME_BYTES + 24];
  const size_t length = strlen(session->options.name);
  uint64_t left = (uint64_t)session->now_ns;
  size_t k;
  memcpy(text, session->options.name, length + 1);
  ardrone_make_id(text, session->ids[2]);
  memcpy(text + length, " user", 6);
  ardrone_make_id(text, session->ids[1]);
  for (k = 0; k < 16; ++k, left >>= 4) text[length + k] = (char)('a' + (left & 15));
  text[length + 16] = '\0';
  ardrone_make_id(text, session->ids[0]);
}

tvs_status ardrone_session_init(ardrone_session **session, const ardrone_session_options *options,
                                const ardrone_transport *transport, void *memory,
                                size_t size_bytes) {
  ardrone_session *s = memory;
  ardrone_session_options read;
  ardrone_transport own;
  tvs_decoder decoder;
  uint8_t *buffer;
  tvs_status status = read_options(options, &read, &decoder);
  if (status != TVS_OK) return status;
  if (!session || !transport || !memory) return TVS_ERR_NULL;
  status =
      tvs_read_sized(transport, TVS_SIZE_THROUGH(ardrone_transport, descriptor), &own, sizeof own);
  if (status != TVS_OK) return status;
  if (!own.open || !own.send || !own.receive || !own.close) return TVS_ERR_NULL;
  if (size_bytes < bytes_needed(&read)) return TVS_ERR_CAPACITY;
  memset(s, 0, sizeof *s);
  s->options = read;
  s->options.use_ids = read.use_ids || read.video_codec;
  s->transport = own;
  s->decoder = decoder;
  s->now_ns = s->open_retry_ns = INT64_MIN;
  buffer = init_stream(&s->video, ARDRONE_CHANNEL_VIDEO, read.video, (uint8_t *)(s + 1));
  init_stream(&s->recording, ARDRONE_CHANNEL_RECORDING, read.recording, buffer);
  init_clocks(s);
  tvs_attitudes_init(&s->attitudes);
  ardrone_pilot_init(&s->pilot);
  *session = s;
  return TVS_OK;
}

void ardrone_session_close(ardrone_session *session) {
  int channel;
  if (!session) return;
  for (channel = 0; channel < ARDRONE_NUM_CHANNELS; ++channel) {
    session->transport.close(session->transport.user, (ardrone_channel)channel);
  }
  ardrone_video_close(session);
}

tvs_status ardrone_session_step(ardrone_session *session, int64_t now_ns) {
  if (!session) return TVS_ERR_NULL;
  if (now_ns < session->now_ns) return TVS_ERR_ARGUMENT;
  if (session->now_ns == INT64_MIN) {
    session->now_ns = now_ns;
    make_ids(session);
  }
  session->now_ns = now_ns;
  ardrone_link_open(session);
  ardrone_link_receive(session);
  ardrone_exchanges_receive(session);
  ardrone_link_supervise(session);
  ardrone_exchanges_advance(session);
  ardrone_link_send(session);
  ardrone_video_step(session);
  return TVS_OK;
}

int64_t ardrone_session_next_ns(const ardrone_session *session) {
  const int64_t soon = session->now_ns + 10 * MS;
  const int64_t tick = session->pilot.next_tick_ns;
  return tick > session->now_ns && tick < soon ? tick : soon;
}

int ardrone_session_is_up(const ardrone_session *session) { return session && session->is_up; }

const ardrone_navdata *ardrone_session_navdata(const ardrone_session *session) {
  if (!session || !session->has_link || session->now_ns - session->heard_ns > 500 * MS) return NULL;
  return &session->navdata;
}

tvs_status ardrone_session_text(const ardrone_session *session, const char **text, size_t *size) {
  if (!session || !text || !size) return TVS_ERR_NULL;
  if (!session->has_text) return TVS_NONE;
  *text = session->text;
  *size = session->text_size;
  return TVS_OK;
}

void ardrone_session_counters(const ardrone_session *session, ardrone_counters *counters) {
  if (session && counters) *counters = session->counters;
}

static tvs_status next_imu(void *user, tvs_imu *sample) {
  ardrone_session *session = user;
  if (!sample) return TVS_ERR_NULL;
  if (!tvs_is_sized(sample, TVS_SIZE_THROUGH(tvs_imu, pressure_sigma))) return TVS_ERR_STRUCT_SIZE;
  if (session->num_imu == 0) return TVS_NONE;
  tvs_write_sized(&session->imu[session->first_imu], sizeof *sample, sample, sample->struct_size);
  session->first_imu = (session->first_imu + 1) % QUEUE_IMU;
  --session->num_imu;
  return TVS_OK;
}

tvs_status ardrone_session_imu_sized(ardrone_session *session, tvs_imu_source *source,
                                     size_t source_size) {
  const tvs_imu_source own = {0, session, next_imu};
  if (!session || !source) return TVS_ERR_NULL;
  tvs_write_sized(&own, sizeof own, source, source_size);
  return TVS_OK;
}

/* ---- the caller's requests ---- */

tvs_status ardrone_session_take_off(ardrone_session *session) {
  if (!session) return TVS_ERR_NULL;
  if (!ardrone_session_navdata(session) || !session->is_up) return TVS_ERR_STATE;
  return ardrone_pilot_take_off(&session->pilot, session->now_ns);
}

tvs_status ardrone_session_land(ardrone_session *session) {
  return session ? ardrone_pilot_land(&session->pilot) : TVS_ERR_NULL;
}

tvs_status ardrone_session_hover(ardrone_session *session) {
  return session ? ardrone_pilot_hover(&session->pilot) : TVS_ERR_NULL;
}

tvs_status ardrone_session_move(ardrone_session *session, const ardrone_move *move) {
  return session ? ardrone_pilot_move(&session->pilot, move, session->now_ns) : TVS_ERR_NULL;
}

tvs_status ardrone_session_cut_motors(ardrone_session *session) {
  return session ? ardrone_pilot_cut_motors(&session->pilot, session->now_ns) : TVS_ERR_NULL;
}

tvs_status ardrone_session_rearm(ardrone_session *session) {
  return session ? ardrone_pilot_rearm(&session->pilot, session->now_ns) : TVS_ERR_NULL;
}

tvs_status ardrone_session_flat_trim(ardrone_session *session) {
  return session ? ardrone_pilot_flat_trim(&session->pilot) : TVS_ERR_NULL;
}

static request *add_request(ardrone_session *session, ardrone_exchange_kind kind) {
  const int at = (session->first_request + session->num_requests) % QUEUE_REQUESTS;
  if (session->num_requests == QUEUE_REQUESTS) return NULL;
  ++session->num_requests;
  memset(&session->requests[at], 0, sizeof session->requests[at]);
  session->requests[at].kind = kind;
  return &session->requests[at];
}

tvs_status ardrone_session_set(ardrone_session *session, const char *key, const char *value) {
  request *r;
  tvs_status status;
  if (!session) return TVS_ERR_NULL;
  status = ardrone_config_check(key, value);
  if (status != TVS_OK && status != TVS_NONE) return status;
  if (ardrone_config_needs_ids(key) && !session->options.use_ids) return TVS_ERR_ARGUMENT;
  r = add_request(session, ARDRONE_EXCHANGE_SET);
  if (!r) return TVS_ERR_CAPACITY;
  strcpy(r->key, key); /* ardrone_config_check has checked the lengths */
  strcpy(r->value, value);
  return TVS_OK;
}

tvs_status ardrone_session_read_config(ardrone_session *session) {
  if (!session) return TVS_ERR_NULL;
  return add_request(session, ARDRONE_EXCHANGE_READ_CONFIG) ? TVS_OK : TVS_ERR_CAPACITY;
}

tvs_status ardrone_session_read_ids(ardrone_session *session) {
  if (!session) return TVS_ERR_NULL;
  return add_request(session, ARDRONE_EXCHANGE_READ_IDS) ? TVS_OK : TVS_ERR_CAPACITY;
}

tvs_status ardrone_session_set_gps(ardrone_session *session, double latitude_deg,
                                   double longitude_deg, double altitude_m) {
  static const char *const keys[3] = {"gps:latitude", "gps:longitude", "gps:altitude"};
  const double numbers[3] = {latitude_deg, longitude_deg, altitude_m};
  char values[3][32];
  int k;
  if (!session) return TVS_ERR_NULL;
  for (k = 0; k < 3; ++k) { /* all three values are checked before any is queued */
    tvs_status status = ardrone_format_number(numbers[k], 9, values[k], sizeof values[k]);
    if (status == TVS_OK) status = ardrone_config_check(keys[k], values[k]);
    if (status != TVS_OK) return status;
  }
  if (QUEUE_REQUESTS - session->num_requests < 3) return TVS_ERR_CAPACITY;
  for (k = 0; k < 3; ++k) ardrone_session_set(session, keys[k], values[k]);
  return TVS_OK;
}
