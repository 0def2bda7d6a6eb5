#include <math.h>
#include <string.h>

#include "../source/sized.h"
#include "session_impl.h"

static const int64_t SILENT_NS = 3 * SECOND, NO_ATTITUDE_NS = 1 * SECOND;
enum { MAX_DATAGRAMS = 512 };

static void set_defaults(tvm_session_options *options) {
  memset(options, 0, sizeof *options);
  options->own_component = MAV_COMP_ID_ONBOARD_COMPUTER;
  options->attitude_hz = 50;
  options->position_hz = 30;
  options->height_hz = 10;
  options->attitude_sigma_rad = 0.0175;
  options->velocity_sigma_m_s = 0.15;
  options->max_gap_ns = 250 * MS;
  options->hold_frame_ns = 200 * MS;
}

void tvm_session_options_init_sized(tvm_session_options *options, size_t struct_size) {
  tvm_session_options own;
  if (!options) return;
  set_defaults(&own);
  tvs_write_sized(&own, sizeof own, options, struct_size);
}

size_t tvm_session_size(void) { return sizeof(tvm_session); }

static int is_rate(double hz) { return hz > 0 && hz <= 1000; }

static tvs_status read_options(const tvm_session_options *given, tvm_session_options *o) {
  tvs_status status;
  set_defaults(o);
  status = tvs_read_sized(given, TVS_SIZE_THROUGH(tvm_session_options, on_event), o, sizeof *o);
  if (status != TVS_OK) return status;
  if (o->vehicle_system < 0 || o->vehicle_system > 255 || o->own_system < 0 ||
      o->own_system > 255 || o->own_component < 1 || o->own_component > 255 ||
      !is_rate(o->attitude_hz) || !is_rate(o->position_hz) || !is_rate(o->height_hz) ||
      !(o->attitude_sigma_rad > 0 && o->attitude_sigma_rad < 1000) ||
      !(o->velocity_sigma_m_s > 0 && o->velocity_sigma_m_s < 1e6) || o->max_gap_ns < 0 ||
      o->hold_frame_ns < 0) {
    return TVS_ERR_ARGUMENT;
  }
  return TVS_OK;
}

tvs_status tvm_session_init(tvm_session **session, const tvm_session_options *options,
                            const tvm_transport *transport, void *memory, size_t size_bytes) {
  tvm_session *s = memory;
  tvm_session_options read;
  tvm_transport own;
  tvs_clock_options clock;
  tvs_status status;
  if (!session || !options || !transport || !memory) return TVS_ERR_NULL;
  status = read_options(options, &read);
  if (status != TVS_OK) return status;
  status = tvs_read_sized(transport, TVS_SIZE_THROUGH(tvm_transport, descriptor), &own, sizeof own);
  if (status != TVS_OK) return status;
  if (!own.send || !own.receive) return TVS_ERR_NULL;
  if (size_bytes < sizeof *s) return TVS_ERR_CAPACITY;
  memset(s, 0, sizeof *s);
  s->options = read;
  s->transport = own;
  s->now_ns = s->heartbeat_due_ns = s->timesync_due_ns = s->requests_due_ns = INT64_MIN;
  s->requests[0] = (wanted){MAVLINK_MSG_ID_ATTITUDE, read.attitude_hz, 1, 0, 0};
  s->requests[1] = (wanted){MAVLINK_MSG_ID_LOCAL_POSITION_NED, read.position_hz, 0, 0, 0};
  s->requests[2] = (wanted){MAVLINK_MSG_ID_ALTITUDE, read.height_hz, 0, 0, 0};
  s->requests[3] = (wanted){MAVLINK_MSG_ID_DISTANCE_SENSOR, read.height_hz, 0, 0, 0};
  tvs_clock_options_init(&clock);
  clock.period_ns = INT64_C(4294967296) * MS; /* time_boot_ms has 32 bits */
  tvs_clock_init(&s->clock, &clock, 1, 1);
  tvs_attitudes_init(&s->attitudes);
  s->height = NUM_HEIGHTS;
  s->range_id = -1;
  *session = s;
  return TVS_OK;
}

static tvm_link link_of(const tvm_session *s) {
  if (s->vehicle == 0) return TVM_LINK_WAITING;
  if (s->now_ns - s->heard_ns > SILENT_NS) return TVM_LINK_SILENT;
  if (s->counters.attitudes == 0 || s->now_ns - s->attitude_heard_ns > NO_ATTITUDE_NS)
    return TVM_LINK_NO_ATTITUDE;
  return TVM_LINK_UP;
}

static void supervise(tvm_session *s) {
  const tvm_link link = link_of(s);
  if (link == s->link) return;
  s->link = link;
  if (link == TVM_LINK_SILENT) ++s->counters.silences;
  /* After a silence the vehicle may have started again with its own rates. */
  if (link == TVM_LINK_NO_ATTITUDE) s->requests_due_ns = INT64_MIN;
  if (s->options.on_event) s->options.on_event(s->options.user, TVM_EVENT_LINK);
}

tvs_status tvm_session_step(tvm_session *session, int64_t now_ns) {
  uint8_t bytes[2048];
  size_t size;
  tvs_status status = TVS_OK;
  int num;
  if (!session) return TVS_ERR_NULL;
  if (now_ns < session->now_ns || now_ns < -(INT64_C(1) << 61) || now_ns > INT64_C(1) << 61)
    return TVS_ERR_ARGUMENT;
  session->now_ns = now_ns;
  for (num = 0; num < MAX_DATAGRAMS; ++num) {
    status = session->transport.receive(session->transport.user, bytes, sizeof bytes, &size);
    if (status != TVS_OK) break;
    tvm_receive(session, bytes, size < sizeof bytes ? size : sizeof bytes);
  }
  tvm_drain(session);
  supervise(session);
  if (!session->options.listen_only) tvm_send_due(session);
  if (status == TVS_END) return TVS_END;
  return status == TVS_OK || status == TVS_NONE ? TVS_OK : TVS_ERR_IO;
}

tvm_link tvm_session_link(const tvm_session *session) {
  return session ? session->link : TVM_LINK_WAITING;
}

tvm_autopilot tvm_session_autopilot(const tvm_session *session, int *system) {
  if (system) *system = session ? session->vehicle : 0;
  return session ? session->autopilot : TVM_AUTOPILOT_UNKNOWN;
}

void tvm_session_counters(const tvm_session *session, tvm_counters *counters) {
  if (session && counters) *counters = session->counters;
}

uint64_t tvm_session_num_invalid(const tvm_session *session) {
  return session ? session->num_invalid : 0;
}

static tvs_status next_imu(void *user, tvs_imu *sample) {
  tvm_session *s = user;
  if (!sample) return TVS_ERR_NULL;
  if (!tvs_is_sized(sample, TVS_SIZE_THROUGH(tvs_imu, pressure_sigma))) return TVS_ERR_STRUCT_SIZE;
  if (s->num_imu == 0) return TVS_NONE;
  tvs_write_sized(&s->imu[s->first_imu], sizeof *sample, sample, sample->struct_size);
  s->first_imu = (s->first_imu + 1) % QUEUE_IMU;
  --s->num_imu;
  return TVS_OK;
}

tvs_status tvm_session_imu_sized(tvm_session *session, tvs_imu_source *source, size_t source_size) {
  const tvs_imu_source own = {0, session, next_imu};
  if (!session || !source) return TVS_ERR_NULL;
  tvs_write_sized(&own, sizeof own, source, source_size);
  return TVS_OK;
}

tvs_status tvm_session_attitude_at(const tvm_session *session, int64_t host_ns, tvs_time *time,
                                   tvs_attitude *attitude) {
  tvs_attitude found, earlier;
  int64_t device_ns, uncertainty_ns;
  tvs_status status;
  if (!session || !attitude) return TVS_ERR_NULL;
  if (!tvm_has_clock(session)) return TVS_NONE;
  device_ns = host_ns - tvm_shift(session, &uncertainty_ns);
  status = tvs_attitudes_at(&session->attitudes, session->clock_id, device_ns,
                            session->options.max_gap_ns, &found);
  if (status != TVS_OK) return status;
  /* The angle that the vehicle turned within the time's uncertainty is an error of its own. */
  if (tvs_attitudes_at(&session->attitudes, session->clock_id, device_ns - uncertainty_ns,
                       session->options.max_gap_ns, &earlier) == TVS_OK)
    found.sigma_rad =
        hypot(found.sigma_rad, tvs_angle_between(found.world_from_body, earlier.world_from_body));
  if (time) {
    time->device_ns = device_ns;
    time->clock_id = session->clock_id;
    time->uncertainty_ns = uncertainty_ns;
  }
  *attitude = found;
  return TVS_OK;
}

/* ---- frames ---- */

/* Takes the frames that the camera has, so that none is lost while an older one waits. */
static tvs_status fill_held(tvm_session *s) {
  tvs_status status = TVS_OK;
  while (s->num_held < QUEUE_FRAMES) {
    tvs_frame *frame = &s->held[(s->first_held + s->num_held) % QUEUE_FRAMES];
    memset(frame, 0, sizeof *frame);
    frame->struct_size = sizeof *frame;
    status = s->camera.next(s->camera.user, frame);
    if (status != TVS_OK) break;
    frame->time.received_ns += s->options.camera_offset_ns;
    frame->time.host_ns += s->options.camera_offset_ns;
    frame->time.device_ns = 0;
    frame->time.clock_id = 0;
    ++s->num_held;
  }
  return s->num_held > 0 ? TVS_OK : status;
}

static tvs_status next_frame(void *user, tvs_frame *frame) {
  tvm_session *s = user;
  tvs_frame *first;
  tvs_time time;
  tvs_status status;
  if (!frame) return TVS_ERR_NULL;
  if (!tvs_is_sized(frame, TVS_SIZE_THROUGH(tvs_frame, handle))) return TVS_ERR_STRUCT_SIZE;
  status = fill_held(s);
  if (status != TVS_OK) return status;
  first = &s->held[s->first_held];
  time = first->time;
  status = tvm_session_attitude_at(s, time.host_ns, &time, &first->attitude);
  /* The sample that follows the frame has velocity and height; the caller is to have it first. */
  if ((status != TVS_OK || s->emitted_device_ns < time.device_ns) &&
      s->now_ns - first->time.host_ns < s->options.hold_frame_ns) {
    return TVS_NONE;
  }
  if (status == TVS_OK) {
    first->flags |= TVS_FRAME_HAS_ATTITUDE;
    first->time = time;
  }
  tvs_write_sized(first, sizeof *first, frame, frame->struct_size);
  s->first_held = (s->first_held + 1) % QUEUE_FRAMES;
  --s->num_held;
  return TVS_OK;
}

static void release_frame(void *user, tvs_frame *frame) {
  tvm_session *s = user;
  if (frame) s->camera.release(s->camera.user, frame);
}

tvs_status tvm_session_frames_sized(tvm_session *session, const tvs_frame_source *camera,
                                    tvs_frame_source *source, size_t source_size) {
  const tvs_frame_source own = {0, session, next_frame, release_frame};
  tvs_frame_source read;
  tvs_status status;
  if (!session || !camera || !source) return TVS_ERR_NULL;
  status = tvs_read_sized(camera, TVS_SIZE_THROUGH(tvs_frame_source, release), &read, sizeof read);
  if (status != TVS_OK) return status;
  if (!read.next || !read.release) return TVS_ERR_NULL;
  for (; session->num_held > 0; --session->num_held) {
    session->camera.release(session->camera.user, &session->held[session->first_held]);
    session->first_held = (session->first_held + 1) % QUEUE_FRAMES;
  }
  session->camera = read;
  tvs_write_sized(&own, sizeof own, source, source_size);
  return TVS_OK;
}
