/* Navdata and commands: it wakes the drone, recognises a lost link and a reboot, and sends a
   datagram at each tick. */
#include <string.h>

#include "session_impl.h"

static const int64_t WAKE_PERIOD_NS = 200 * MS, RETRY_NS = 200 * MS;
static const int64_t LOST_NS = 2000 * MS, STALE_NS = 500 * MS;
enum { MAX_DATAGRAMS = 64 };

void ardrone_link_open(ardrone_session *session) {
  const ardrone_transport *t = &session->transport;
  if (session->is_open || session->now_ns < session->open_retry_ns) return;
  session->open_retry_ns = session->now_ns + RETRY_NS;
  if (t->open(t->user, ARDRONE_CHANNEL_AT, session->now_ns) != TVS_OK) return;
  if (t->open(t->user, ARDRONE_CHANNEL_NAVDATA, session->now_ns) != TVS_OK) {
    t->close(t->user, ARDRONE_CHANNEL_AT);
    return;
  }
  session->is_open = 1;
  session->wake_ns = session->heard_ns = session->now_ns;
}

static void queue_imu(ardrone_session *session, const tvs_imu *imu) {
  if (session->num_imu == QUEUE_IMU) {
    session->first_imu = (session->first_imu + 1) % QUEUE_IMU;
    --session->num_imu;
  }
  session->imu[(session->first_imu + session->num_imu++) % QUEUE_IMU] = *imu;
}

static void take_time(ardrone_session *session, tvs_time *time) {
  memset(time, 0, sizeof *time);
  time->received_ns = time->host_ns = session->now_ns;
  time->uncertainty_ns = INT64_MAX;
  if (!ARDRONE_HAS(&session->navdata, ARDRONE_TAG_TIME)) return;
  tvs_clock_observe(&session->navdata_clock, ardrone_time_ns(session->navdata.time),
                    session->now_ns, time);
}

/* Takes the first yaw of each run of the drone's clock as the zero of the yaws that follow. */
static void take_psi0(ardrone_session *session, uint32_t clock_id) {
  const double radian_per_mdeg = 1.7453292519943295e-5;
  const float psi = session->navdata.demo.psi_mdeg;
  if (!ARDRONE_HAS(&session->navdata, ARDRONE_TAG_DEMO) || !(psi >= -360e3f && psi <= 360e3f)) {
    return;
  }
  if (session->has_psi0 && session->psi0_clock_id == clock_id) return;
  session->has_psi0 = 1;
  session->psi0_clock_id = clock_id;
  session->psi0_rad = psi * radian_per_mdeg;
}

static void take_imu(ardrone_session *session, tvs_imu *imu) {
  tvs_time time;
  take_time(session, &time);
  take_psi0(session, time.clock_id);
  imu->struct_size = sizeof *imu;
  ardrone_navdata_to_imu(&session->navdata, session->psi0_rad, imu);
  imu->time = time;
  imu->attitude.clock_id = (imu->valid & TVS_IMU_ATTITUDE) ? time.clock_id : 0;
  if (imu->attitude.clock_id != 0) {
    tvs_attitudes_add(&session->attitudes, time.device_ns, &imu->attitude);
  }
  if (imu->valid) queue_imu(session, imu);
}

static void lose_link(ardrone_session *session) {
  session->has_link = session->is_up = 0;
  session->sequence.has_last = 0;
  ardrone_pilot_new_link(&session->pilot);
  ardrone_tell(session, ARDRONE_EVENT_LINK_LOST, NULL);
}

static void make_link(ardrone_session *session) {
  session->has_link = 1;
  ++session->counters.links;
  ardrone_exchanges_new_link(session);
}

/* The drone started again: its clocks, its yaw and its picture numbers start again. */
static void begin_anew(ardrone_session *session) {
  ++session->counters.reboots;
  if (session->has_link) lose_link(session);
  /* The packet that revealed the reboot counts as the latest one of session->sequence. */
  session->sequence.has_last = 1;
  session->has_psi0 = 0;
  tvs_clock_restart(&session->navdata_clock);
  ardrone_video_reboot(session);
  ardrone_tell(session, ARDRONE_EVENT_REBOOT, NULL);
}

static int is_reboot(const ardrone_session *session, ardrone_order order) {
  const uint32_t ahead = session->navdata.sequence - session->last_number;
  if (session->is_up && (session->navdata.state & ARDRONE_STATE_BOOTSTRAP)) return 1;
  return order == ARDRONE_ORDER_RESTART && session->was_heard &&
         (ahead == 0 || ahead >= UINT32_C(0x80000000));
}

static void take_packet(ardrone_session *session, const uint8_t *bytes, size_t size,
                        ardrone_order order) {
  tvs_imu imu;
  if (is_reboot(session, order)) begin_anew(session);
  if (order == ARDRONE_ORDER_GAP) {
    session->counters.navdata_missing += session->navdata.sequence - session->last_number - 1;
  }
  session->last_number = session->navdata.sequence;
  session->was_heard = 1;
  session->heard_ns = session->now_ns;
  if (!session->has_link) make_link(session);
  ardrone_pilot_state(&session->pilot, session->navdata.state, session->now_ns);
  ardrone_exchange_navdata(&session->exchange, session->navdata.state, session->now_ns);
  take_imu(session, &imu);
  if (session->options.on_navdata) {
    session->options.on_navdata(session->options.user, bytes, size, &session->navdata, &imu);
  }
}

static void take_datagram(ardrone_session *session, const uint8_t *bytes, size_t size) {
  ardrone_navdata decoded;
  ardrone_order order;
  ++session->counters.navdata_received;
  if (ardrone_navdata_decode(bytes, size, &decoded) != TVS_OK) {
    ++session->counters.navdata_rejected;
    return;
  }
  order = ardrone_sequence_check(&session->sequence, &decoded);
  if (order == ARDRONE_ORDER_LATE) {
    ++session->counters.navdata_late;
    return;
  }
  session->navdata = decoded;
  take_packet(session, bytes, size, order);
}

void ardrone_link_receive(ardrone_session *session) {
  const ardrone_transport *t = &session->transport;
  uint8_t bytes[ARDRONE_NAVDATA_MAX_BYTES];
  int k;
  if (!session->is_open) return;
  for (k = 0; k < MAX_DATAGRAMS; ++k) {
    size_t size = 0;
    const tvs_status status =
        t->receive(t->user, ARDRONE_CHANNEL_NAVDATA, bytes, sizeof bytes, &size);
    if (status != TVS_OK)
      return; /* a failed socket receives nothing; 2 s without navdata reopen it */
    take_datagram(session, bytes, size);
  }
}

void ardrone_link_supervise(ardrone_session *session) {
  const ardrone_transport *t = &session->transport;
  static const uint8_t wake[4] = {1, 0, 0, 0};
  if (!session->is_open) return;
  if (session->now_ns - session->heard_ns > LOST_NS) {
    if (session->has_link) lose_link(session);
    t->close(t->user, ARDRONE_CHANNEL_NAVDATA);
    t->close(t->user, ARDRONE_CHANNEL_AT);
    session->is_open = 0;
    session->open_retry_ns = session->now_ns;
    ardrone_link_open(session);
  }
  if (session->is_open && session->now_ns >= session->wake_ns &&
      (!session->has_link || session->now_ns - session->heard_ns >= WAKE_PERIOD_NS)) {
    t->send(t->user, ARDRONE_CHANNEL_NAVDATA, wake, sizeof wake);
    session->wake_ns = session->now_ns + WAKE_PERIOD_NS;
  }
}

/* With a link, a datagram goes out at each tick and keeps the link alive. Without a link one goes
   out only after the caller's first flight request (pilot->active); it says "land", since a lost
   link ends the request to fly. With listen_only none goes out. */
void ardrone_link_send(ardrone_session *session) {
  const ardrone_transport *t = &session->transport;
  ardrone_pilot *pilot = &session->pilot;
  if (!session->is_open || session->options.listen_only) return;
  if (!session->has_link && !pilot->active) return;
  if (session->now_ns - session->heard_ns > STALE_NS) ardrone_pilot_hover(pilot);
  if (!ardrone_pilot_tick(pilot, session->now_ns)) return;
  if (session->has_link) ardrone_exchange_tick(&session->exchange, &pilot->at, session->now_ns);
  if (pilot->at.size == 0) return;
  t->send(t->user, ARDRONE_CHANNEL_AT, pilot->at.text, pilot->at.size);
  ++session->counters.commands_sent;
}
