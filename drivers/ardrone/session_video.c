/* Receives the video streams, and decodes the live stream's packets to pictures in the queue. */
#include <math.h>
#include <string.h>

#include "../source/sized.h"
#include "session_impl.h"

static const int64_t SILENT_NS = 1000 * MS, RETRY_NS = 150 * MS;
enum { MAX_BYTES_A_STEP = 4 << 20 };

static void close_stream(ardrone_session *session, stream *s) {
  if (!s->is_open) return;
  session->transport.close(session->transport.user, s->channel);
  s->is_open = 0;
  s->retry_ns = session->now_ns + RETRY_NS;
  ardrone_pave_clear(&s->parser);
  if (s != &session->video || !s->has_bytes) return;
  ardrone_tell(session, ARDRONE_EVENT_VIDEO_CLOSED, NULL);
}

static void begin_connection(ardrone_session *session, stream *s) {
  s->has_bytes = 1;
  ++s->num_connections;
  if (s != &session->video) return;
  ++session->counters.video_connections;
  session->new_stream = 1;
  memset(&session->gate, 0, sizeof session->gate);
  ardrone_tell(session, ARDRONE_EVENT_VIDEO_OPEN, NULL);
}

/* A stream that was silent for 1 s counts as closed, since a drone that is switched off does not
   close its connections. */
static void supervise_stream(ardrone_session *session, stream *s) {
  const ardrone_transport *t = &session->transport;
  if (s->is_open && session->now_ns - s->heard_ns > SILENT_NS) close_stream(session, s);
  if (s->is_open || session->now_ns < s->retry_ns) return;
  s->retry_ns = session->now_ns + RETRY_NS;
  if (t->open(t->user, s->channel, session->now_ns) != TVS_OK) return;
  s->is_open = 1;
  s->has_bytes = 0;
  s->heard_ns = session->now_ns;
}

/* Receives into the parser as much as it has room for. Returns how many bytes came. */
static size_t receive_stream(ardrone_session *session, stream *s) {
  const ardrone_transport *t = &session->transport;
  size_t total = 0;
  while (s->is_open) {
    size_t room, size = 0;
    uint8_t *to = ardrone_pave_space(&s->parser, &room);
    tvs_status status;
    if (room == 0) return total;
    status = t->receive(t->user, s->channel, to, room, &size);
    if (status == TVS_NONE) return total;
    if (status != TVS_OK || size == 0) {
      /* The bytes before the end of the stream are still valid: they are cut into packets before
         the next receive returns the end. */
      if (total == 0) close_stream(session, s);
      return total;
    }
    s->heard_ns = session->now_ns;
    if (!s->has_bytes) begin_connection(session, s);
    ardrone_pave_filled(&s->parser, size);
    total += size;
  }
  return total;
}

/* ---- the time and attitude of a picture ---- */

/* When the stamps of the pictures and of navdata both count from the drone's start, a picture's
   stamp names an instant of the navdata clock. The arrival times show whether that is so: measured
   on that clock, the picture then came between 250 ms before and 1.5 s after its stamp (the least
   delay subtracted). The chance that two unrelated clocks agree so well is 1 in 1200. */
typedef enum clock_relation { UNRELATED, BY_ARRIVAL, BY_STAMP } clock_relation;

static clock_relation to_navdata_clock(const ardrone_session *session, const tvs_time *time,
                                       uint32_t *clock_id, int64_t *device_ns,
                                       int64_t *uncertainty_ns) {
  int64_t by_host, late;
  if (tvs_clock_to_device(&session->navdata_clock, time->host_ns, clock_id, &by_host,
                          uncertainty_ns) != TVS_OK) {
    return UNRELATED;
  }
  late = (by_host - time->device_ns) % ARDRONE_TIME_PERIOD_NS;
  if (late > ARDRONE_TIME_PERIOD_NS / 2) late -= ARDRONE_TIME_PERIOD_NS;
  if (late < -ARDRONE_TIME_PERIOD_NS / 2) late += ARDRONE_TIME_PERIOD_NS;
  if (late > -250 * MS && late < 1500 * MS) {
    *device_ns = by_host - late;
    *uncertainty_ns = 1 * MS; /* the stamp counts whole milliseconds */
    return BY_STAMP;
  }
  *device_ns = by_host;
  *uncertainty_ns += time->uncertainty_ns;
  return BY_ARRIVAL;
}

static tvs_time time_of(ardrone_session *session, const ardrone_pave_header *header) {
  tvs_time time;
  uint32_t clock_id;
  int64_t device_ns, host_ns, uncertainty_ns;
  memset(&time, 0, sizeof time);
  tvs_clock_observe(&session->video_clock, header->timestamp_ms * MS, session->now_ns, &time);
  if (to_navdata_clock(session, &time, &clock_id, &device_ns, &uncertainty_ns) == BY_STAMP &&
      tvs_clock_to_host(&session->navdata_clock, clock_id, device_ns, &host_ns, &uncertainty_ns) ==
          TVS_OK) {
    time.host_ns = host_ns;
    time.uncertainty_ns = uncertainty_ns + 1 * MS;
  }
  return time;
}

tvs_status ardrone_session_attitude_at(const ardrone_session *session, const tvs_time *time,
                                       tvs_attitude *attitude) {
  tvs_attitude found, earlier;
  uint32_t clock_id;
  int64_t device_ns, uncertainty_ns = 0, gap_ns;
  tvs_status status;
  if (!session || !time || !attitude) return TVS_ERR_NULL;
  if (time->clock_id == 0) return TVS_NONE;
  gap_ns = session->options.max_gap_ns;
  if (time->clock_id == session->navdata_clock.clock_id) {
    clock_id = time->clock_id;
    device_ns = time->device_ns;
  } else if (time->clock_id != session->video_clock.clock_id ||
             to_navdata_clock(session, time, &clock_id, &device_ns, &uncertainty_ns) == UNRELATED) {
    return TVS_NONE;
  }
  status = tvs_attitudes_at(&session->attitudes, clock_id, device_ns, gap_ns, &found);
  if (status != TVS_OK) return status;
  /* An uncertain instant makes the attitude uncertain: the angle that the drone turned within that
     uncertainty is added to sigma as an independent error. */
  if (uncertainty_ns > 0) {
    status = tvs_attitudes_at(&session->attitudes, clock_id, device_ns - uncertainty_ns, gap_ns,
                              &earlier);
    if (status != TVS_OK) return status;
    found.sigma_rad =
        hypot(found.sigma_rad, tvs_angle_between(found.world_from_body, earlier.world_from_body));
  }
  *attitude = found;
  return TVS_OK;
}

/* ---- the queue of pictures ---- */

static void give_back(ardrone_session *session, tvs_frame *frame) {
  tvs_picture picture;
  picture.image = frame->image;
  picture.handle = frame->handle;
  session->decoder.release(session->decoder.user, &picture);
}

static tvs_frame *frame_at(ardrone_session *session, int k) {
  return &session->frames[(session->first_frame + k) % QUEUE_FRAMES];
}

static void drop_oldest(ardrone_session *session) {
  give_back(session, frame_at(session, 0));
  session->first_frame = (session->first_frame + 1) % QUEUE_FRAMES;
  --session->num_frames;
}

static void add_attitude(const ardrone_session *session, tvs_frame *frame) {
  if (ardrone_session_attitude_at(session, &frame->time, &frame->attitude) == TVS_OK) {
    frame->flags |= TVS_FRAME_HAS_ATTITUDE;
  }
}

static void queue_picture(ardrone_session *session, const ardrone_pave_header *header,
                          const tvs_time *time, const tvs_picture *picture) {
  tvs_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.struct_size = sizeof frame;
  if (header->frame_type == ARDRONE_PAVE_IDR) frame.flags |= TVS_FRAME_KEY;
  if (session->gap) frame.flags |= TVS_FRAME_GAP;
  if (session->new_stream) frame.flags |= TVS_FRAME_NEW_STREAM;
  session->gap = session->new_stream = 0;
  frame.image = picture->image;
  frame.handle = picture->handle;
  frame.number = header->frame_number;
  frame.time = *time;
  add_attitude(session, &frame);
  ++session->counters.frames_decoded;
  if (session->options.on_frame) session->options.on_frame(session->options.user, &frame);
  if (session->options.queue_frames == 0) {
    give_back(session, &frame);
    return;
  }
  if (session->num_frames == session->options.queue_frames) {
    drop_oldest(session);
    ++session->counters.frames_dropped;
    if (session->num_frames > 0)
      frame_at(session, 0)->flags |= TVS_FRAME_GAP;
    else
      frame.flags |= TVS_FRAME_GAP;
  }
  *frame_at(session, session->num_frames++) = frame;
}

static void decode_packet(ardrone_session *session, const ardrone_pave_packet *packet,
                          const tvs_time *time) {
  tvs_picture picture;
  tvs_status status;
  memset(&picture, 0, sizeof picture);
  status = session->decoder.decode(session->decoder.user, packet->payload,
                                   packet->header.payload_size, &picture);
  if (status == TVS_OK) {
    queue_picture(session, &packet->header, time, &picture);
  } else {
    session->gap = 1;
    if (status != TVS_NONE) {
      ++session->counters.frames_failed;
      session->gate.is_open = 0; /* the next pictures refer to this one, which did not decode */
    }
  }
}

static void take_live(ardrone_session *session, const ardrone_pave_packet *packet) {
  /* An advertisement is no picture: where it is left out, none is missing. */
  const int is_picture = (packet->header.control & ARDRONE_PAVE_ADVERTISEMENT) == 0;
  const int is_rejoin = is_picture && session->video.num_connections > 1 && !session->gate.has_last;
  const int gate = ardrone_pave_gate_check(&session->gate, &packet->header);
  const tvs_time time = time_of(session, &packet->header);
  ++session->counters.packets;
  if ((gate & ARDRONE_PAVE_GAP) || is_rejoin) {
    ++session->counters.gaps;
    session->gap = 1;
  }
  if (session->options.on_packet) {
    session->options.on_packet(session->options.user, packet, &time, gate);
  }
  if (!is_picture) return;
  if ((gate & (ARDRONE_PAVE_DECODE | ARDRONE_PAVE_REPEAT)) == 0) {
    ++session->counters.packets_skipped;
    if (session->counters.frames_decoded > 0) session->gap = 1;
  }
  if (!session->decoder.decode || !(gate & ARDRONE_PAVE_DECODE)) return;
  if (gate & ARDRONE_PAVE_RESET) session->decoder.reset(session->decoder.user);
  decode_packet(session, packet, &time);
}

static void step_live(ardrone_session *session) {
  size_t total = 0, size;
  do {
    ardrone_pave_packet packet;
    size = receive_stream(session, &session->video);
    total += size;
    if (session->options.skip_to_latest && size > 0) {
      const int skipped = ardrone_pave_skip_to_latest(&session->video.parser);
      session->counters.packets += (uint64_t)skipped;
      session->counters.packets_skipped += (uint64_t)skipped;
    }
    while (ardrone_pave_next(&session->video.parser, &packet) == TVS_OK) {
      take_live(session, &packet);
    }
  } while (size > 0 && total < MAX_BYTES_A_STEP);
  /* This follows the receiving, so that a pause of the caller's does not count as a silence of the
     drone's. */
  supervise_stream(session, &session->video);
  session->counters.bytes_skipped = session->video.parser.bytes_skipped;
}

/* Reports every packet of the recording. ardrone_pave_gate_check and skip_to_latest are not
   used. */
static void step_recording(ardrone_session *session) {
  size_t total = 0, size;
  do {
    ardrone_pave_packet packet;
    size = receive_stream(session, &session->recording);
    total += size;
    while (ardrone_pave_next(&session->recording.parser, &packet) == TVS_OK) {
      if (!session->options.on_recording) continue;
      session->options.on_recording(session->options.user, &packet, session->now_ns);
    }
  } while (size > 0 && total < MAX_BYTES_A_STEP);
  supervise_stream(session, &session->recording);
}

void ardrone_video_step(ardrone_session *session) {
  if (session->options.video) step_live(session);
  if (session->options.recording) step_recording(session);
}

void ardrone_video_reboot(ardrone_session *session) { tvs_clock_restart(&session->video_clock); }

void ardrone_video_close(ardrone_session *session) {
  while (session->num_frames > 0) drop_oldest(session);
}

static tvs_status next_frame(void *user, tvs_frame *frame) {
  ardrone_session *session = user;
  tvs_frame own;
  if (!frame) return TVS_ERR_NULL;
  if (!tvs_is_sized(frame, TVS_SIZE_THROUGH(tvs_frame, handle))) return TVS_ERR_STRUCT_SIZE;
  if (session->num_frames == 0) return TVS_NONE;
  own = *frame_at(session, 0);
  session->first_frame = (session->first_frame + 1) % QUEUE_FRAMES;
  --session->num_frames;
  if ((own.flags & TVS_FRAME_HAS_ATTITUDE) == 0) add_attitude(session, &own);
  tvs_write_sized(&own, sizeof own, frame, frame->struct_size);
  return TVS_OK;
}

static void release_frame(void *user, tvs_frame *frame) {
  if (frame) give_back(user, frame);
}

tvs_status ardrone_session_frames_sized(ardrone_session *session, tvs_frame_source *source,
                                        size_t source_size) {
  const tvs_frame_source own = {0, session, next_frame, release_frame};
  if (!session || !source) return TVS_ERR_NULL;
  if (!session->decoder.decode) return TVS_ERR_STATE;
  tvs_write_sized(&own, sizeof own, source, source_size);
  return TVS_OK;
}
