/* Bytes to messages by MAVLink's library, the sequence numbers, and what the session sends. */
#include <math.h>
#include <string.h>

#include "session_impl.h"

static const int64_t REQUESTS_NS = 2 * SECOND;
enum { MAX_TRIES = 5 };

/* ---- receiving ---- */

/* Hands over a message as it was on the wire. The library's own mavlink_msg_to_send_buffer may
   shorten the payload, which the checksum then does not fit. */
static void tell_packet(tvm_session *s, const mavlink_message_t *m) {
  uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
  size_t size = 0;
  if (!s->options.on_packet) return;
  bytes[size++] = m->magic;
  bytes[size++] = m->len;
  if (m->magic == MAVLINK_STX) {
    bytes[size++] = m->incompat_flags;
    bytes[size++] = m->compat_flags;
  }
  bytes[size++] = m->seq;
  bytes[size++] = m->sysid;
  bytes[size++] = m->compid;
  bytes[size++] = (uint8_t)(m->msgid & 255);
  if (m->magic == MAVLINK_STX) {
    bytes[size++] = (uint8_t)(m->msgid >> 8 & 255);
    bytes[size++] = (uint8_t)(m->msgid >> 16 & 255);
  }
  memcpy(bytes + size, m->payload64, m->len);
  size += m->len;
  bytes[size++] = m->ck[0];
  bytes[size++] = m->ck[1];
  if (m->magic == MAVLINK_STX && (m->incompat_flags & MAVLINK_IFLAG_SIGNED)) {
    memcpy(bytes + size, m->signature, MAVLINK_SIGNATURE_BLOCK_LEN);
    size += MAVLINK_SIGNATURE_BLOCK_LEN;
  }
  s->options.on_packet(s->options.user, s->now_ns, bytes, size);
}

static int is_own(const tvm_session *s, const mavlink_message_t *m) {
  const int own = s->options.own_system ? s->options.own_system : s->vehicle;
  return m->compid == s->options.own_component && (own == 0 || m->sysid == own);
}

/* The autopilot is the first component that says that it is one. */
static void take_heartbeat(tvm_session *s, const mavlink_message_t *m) {
  mavlink_heartbeat_t heartbeat;
  const int only = s->options.vehicle_system;
  mavlink_msg_heartbeat_decode(m, &heartbeat);
  if (s->vehicle != 0 || heartbeat.autopilot == MAV_AUTOPILOT_INVALID || m->sysid == 0 ||
      (only != 0 && m->sysid != only)) {
    return;
  }
  s->vehicle = m->sysid;
  s->component = m->compid;
  s->autopilot = heartbeat.autopilot == MAV_AUTOPILOT_ARDUPILOTMEGA ? TVM_AUTOPILOT_ARDUPILOT
                 : heartbeat.autopilot == MAV_AUTOPILOT_PX4         ? TVM_AUTOPILOT_PX4
                                                                    : TVM_AUTOPILOT_OTHER;
}

/* Whether the packet is to be used: not where it repeats the one before it. Counts what is missing
   and what comes late. */
static int take_sequence(tvm_session *s, const mavlink_message_t *m) {
  uint8_t *next = &s->next_sequence[m->compid], *num_late = &s->num_late[m->compid];
  const int ahead = (uint8_t)(m->seq - *next);
  if (!s->has_sequence[m->compid] || *num_late >= 8) {
    /* the first packet; or so many in succession look late that the vehicle began to count again */
    s->has_sequence[m->compid] = 1;
  } else if (ahead == 255) {
    ++s->counters.repeated;
    return 0;
  } else if (ahead >= 128) {
    ++s->counters.late;
    ++*num_late;
    if (s->counters.lost > 0) --s->counters.lost; /* it was counted as lost when it was overtaken */
    return 1;
  } else {
    s->counters.lost += (uint64_t)ahead;
  }
  *num_late = 0;
  *next = (uint8_t)(m->seq + 1);
  return 1;
}

/* Answers the autopilot's request with its own clock: it then finds an offset of 0 to the times
   that estimates state, which are of that clock already. */
static void answer_timesync(tvm_session *s, int64_t asked_ns) {
  mavlink_message_t m;
  mavlink_timesync_t sync;
  int64_t uncertainty_ns;
  if (!s->sends_estimates || s->options.listen_only || !tvm_has_clock(s)) return;
  memset(&sync, 0, sizeof sync);
  sync.tc1 = s->now_ns - tvm_shift(s, &uncertainty_ns);
  sync.ts1 = asked_ns;
  if (sync.tc1 <= 0) return;
  mavlink_msg_timesync_encode_status(tvm_own_system(s), (uint8_t)s->options.own_component,
                                     &s->sender, &m, &sync);
  tvm_send_message(s, &m);
}

static void take_packet(tvm_session *s, const mavlink_message_t *m) {
  mavlink_timesync_t sync;
  int k;
  if (is_own(s, m)) {
    /* In a recording the session's own packets tell which TIMESYNC answers are to them. */
    if (!s->options.listen_only || m->msgid != MAVLINK_MSG_ID_TIMESYNC) return;
    mavlink_msg_timesync_decode(m, &sync);
    if (sync.tc1 != 0) return;
    s->sent_ns[s->idx_sent] = sync.ts1;
    s->idx_sent = (s->idx_sent + 1) % NUM_SENT_TIMES;
    return;
  }
  if (m->msgid == MAVLINK_MSG_ID_HEARTBEAT) take_heartbeat(s, m);
  if (s->vehicle == 0 || m->sysid != s->vehicle) {
    ++s->counters.others;
    return;
  }
  if (!take_sequence(s, m)) return;
  ++s->counters.received;
  tell_packet(s, m);
  if (m->compid != s->component) return;
  s->heard_ns = s->now_ns;
  if (s->transport.keep_sender) s->transport.keep_sender(s->transport.user);
  for (k = 0; k < NUM_WANTED; ++k) s->requests[k].num_seen += m->msgid == s->requests[k].id;
  if (m->msgid == MAVLINK_MSG_ID_TIMESYNC) {
    mavlink_msg_timesync_decode(m, &sync);
    if (sync.tc1 == 0) answer_timesync(s, sync.ts1);
    for (k = 0; k < NUM_SENT_TIMES; ++k) {
      if (sync.tc1 == 0 || sync.ts1 == 0 || sync.ts1 != s->sent_ns[k]) continue;
      s->sent_ns[k] = 0;
      tvm_take_timesync(s, sync.tc1, sync.ts1);
    }
    return;
  }
  tvm_take_message(s, m);
}

/* A wrong checksum: a packet of an unknown message looks the same to the parser. Its sequence
   number counts only if it is the next one, since nothing in the packet is certain. */
static void take_bad(tvm_session *s, const mavlink_message_t *m) {
  if (mavlink_get_msg_entry(m->msgid)) {
    ++s->counters.corrupted;
    return;
  }
  ++s->counters.unknown;
  if (m->sysid == s->vehicle && s->has_sequence[m->compid] &&
      m->seq == s->next_sequence[m->compid]) {
    ++s->next_sequence[m->compid];
  }
}

void tvm_receive(tvm_session *s, const uint8_t *bytes, size_t size) {
  mavlink_message_t message;
  mavlink_status_t status;
  size_t k;
  for (k = 0; k < size; ++k) {
    switch (mavlink_frame_char_buffer(&s->parsed, &s->parser, bytes[k], &message, &status)) {
      case MAVLINK_FRAMING_OK: take_packet(s, &message); break;
      case MAVLINK_FRAMING_BAD_CRC: take_bad(s, &message); break;
      default: break;
    }
  }
}

/* ---- sending: HEARTBEAT, TIMESYNC and requests for rates; what visual odometry tells is in
   send_track.c; nothing else ---- */

uint8_t tvm_own_system(const tvm_session *s) {
  if (s->options.own_system) return (uint8_t)s->options.own_system;
  return (uint8_t)(s->vehicle                  ? s->vehicle
                   : s->options.vehicle_system ? s->options.vehicle_system
                                               : 1);
}

int tvm_send_message(tvm_session *s, const mavlink_message_t *m) {
  uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
  const size_t size = mavlink_msg_to_send_buffer(bytes, m);
  if (s->transport.send(s->transport.user, bytes, size) != TVS_OK) return 0;
  if (s->options.on_packet && s->vehicle)
    s->options.on_packet(s->options.user, s->now_ns, bytes, size);
  return 1;
}

static void send_heartbeat(tvm_session *s) {
  mavlink_message_t m;
  mavlink_heartbeat_t heartbeat;
  memset(&heartbeat, 0, sizeof heartbeat);
  /* Not a ground station: ArduPilot and PX4 act when a ground station that they heard is gone. */
  heartbeat.type = MAV_TYPE_ONBOARD_CONTROLLER;
  heartbeat.autopilot = MAV_AUTOPILOT_INVALID;
  heartbeat.system_status = MAV_STATE_ACTIVE;
  heartbeat.mavlink_version = 3;
  mavlink_msg_heartbeat_encode_status(tvm_own_system(s), (uint8_t)s->options.own_component,
                                      &s->sender, &m, &heartbeat);
  tvm_send_message(s, &m);
}

static void send_timesync(tvm_session *s) {
  mavlink_message_t m;
  mavlink_timesync_t sync;
  memset(&sync, 0, sizeof sync);
  sync.ts1 = s->now_ns;
  mavlink_msg_timesync_encode_status(tvm_own_system(s), (uint8_t)s->options.own_component,
                                     &s->sender, &m, &sync);
  if (!tvm_send_message(s, &m)) return;
  s->sent_ns[s->idx_sent] = s->now_ns;
  s->idx_sent = (s->idx_sent + 1) % NUM_SENT_TIMES;
}

static void send_interval(tvm_session *s, const wanted *w) {
  mavlink_message_t m;
  mavlink_command_long_t command;
  memset(&command, 0, sizeof command);
  command.target_system = (uint8_t)s->vehicle;
  command.target_component = (uint8_t)s->component;
  command.command = MAV_CMD_SET_MESSAGE_INTERVAL;
  command.param1 = (float)w->id;
  command.param2 = (float)(1e6 / w->hz);
  mavlink_msg_command_long_encode_status(tvm_own_system(s), (uint8_t)s->options.own_component,
                                         &s->sender, &m, &command);
  tvm_send_message(s, &m);
}

/* Old ArduPilot knows no SET_MESSAGE_INTERVAL, only groups of messages. */
static void send_stream(tvm_session *s, uint8_t stream, double hz) {
  mavlink_message_t m;
  mavlink_request_data_stream_t request;
  memset(&request, 0, sizeof request);
  request.target_system = (uint8_t)s->vehicle;
  request.target_component = (uint8_t)s->component;
  request.req_stream_id = stream;
  request.req_message_rate = (uint16_t)ceil(hz);
  request.start_stop = 1;
  mavlink_msg_request_data_stream_encode_status(
      tvm_own_system(s), (uint8_t)s->options.own_component, &s->sender, &m, &request);
  tvm_send_message(s, &m);
}

/* Requests what came less than half as often as wanted since the last call. A message that the
   vehicle may not have is requested MAX_TRIES times, ATTITUDE for as long as none comes. */
static void send_requests(tvm_session *s) {
  const double window_s = (double)REQUESTS_NS * 1e-9;
  int k;
  for (k = 0; k < NUM_WANTED; ++k) {
    wanted *w = &s->requests[k];
    const int is_slow = w->num_seen < 0.5 * w->hz * window_s;
    const int is_missing = w->is_needed && w->num_seen == 0;
    w->num_seen = 0;
    if (!is_slow || (w->num_tries >= MAX_TRIES && !is_missing)) continue;
    if (w->num_tries < MAX_TRIES) ++w->num_tries;
    send_interval(s, w);
    if (s->autopilot != TVM_AUTOPILOT_ARDUPILOT || w->num_tries < 3) continue;
    if (w->id == MAVLINK_MSG_ID_ATTITUDE) send_stream(s, MAV_DATA_STREAM_EXTRA1, w->hz);
    if (w->id == MAVLINK_MSG_ID_LOCAL_POSITION_NED) send_stream(s, MAV_DATA_STREAM_POSITION, w->hz);
  }
}

void tvm_send_due(tvm_session *s) {
  if (s->now_ns >= s->heartbeat_due_ns) {
    send_heartbeat(s);
    s->heartbeat_due_ns = s->now_ns + SECOND;
  }
  if (s->vehicle == 0 || s->link == TVM_LINK_SILENT) return;
  if (s->now_ns >= s->timesync_due_ns) {
    send_timesync(s);
    s->timesync_due_ns = s->now_ns + SECOND;
  }
  if (s->now_ns >= s->requests_due_ns) {
    send_requests(s);
    s->requests_due_ns = s->now_ns + REQUESTS_NS;
  }
}
