/* Estimates of visual odometry as packets, and their way through a session. */
#include <math.h>
#include <string.h>

#include "../source/sized.h"
#include "session_impl.h"
#include "twoview_drivers/mavlink/estimate.h"

static const int64_t TELL_NS = 1 * SECOND; /* between two STATUSTEXT */
/* Between the map's vertical and the attitude's: beyond it the map is not upright. As the tracker's
   own check of a frame's attitude, and added to three standard deviations. */
static const double MOST_TILT_RAD = 0.1;

/* ---- packing ---- */

/* The upper triangle of a 6 x 6, row by row; NaN first where it is not known. */
static void upper_triangle(const double *covariance, int is_known, float *out) {
  int i, j, k = 0;
  for (i = 0; i < 6; ++i)
    for (j = i; j < 6; ++j) out[k++] = is_known ? (float)covariance[6 * i + j] : 0;
  if (!is_known) out[0] = NAN;
}

static void copy_floats(const double *from, int count, float *to) {
  int k;
  for (k = 0; k < count; ++k) to[k] = (float)from[k];
}

static void pack_odometry(const tvm_estimate *e, uint8_t system, uint8_t component,
                          mavlink_status_t *sender, mavlink_message_t *m) {
  mavlink_odometry_t o;
  float v[3];
  memset(&o, 0, sizeof o);
  o.time_usec = e->time_us;
  o.frame_id = e->world == TVM_WORLD_NED ? MAV_FRAME_LOCAL_NED : MAV_FRAME_LOCAL_FRD;
  o.child_frame_id = MAV_FRAME_BODY_FRD;
  copy_floats(e->position_m, 3, v);
  o.x = v[0], o.y = v[1], o.z = v[2];
  copy_floats(e->world_from_body, 4, o.q);
  copy_floats(e->velocity_m_s, 3, v);
  o.vx = v[0], o.vy = v[1], o.vz = v[2];
  copy_floats(e->rate_rad_s, 3, v);
  o.rollspeed = v[0], o.pitchspeed = v[1], o.yawspeed = v[2];
  upper_triangle(e->pose_covariance, e->has_covariance, o.pose_covariance);
  upper_triangle(e->velocity_covariance, e->has_covariance, o.velocity_covariance);
  o.reset_counter = (uint8_t)e->reset_counter;
  o.estimator_type = MAV_ESTIMATOR_TYPE_VIO; /* the vertical and the metre are the vehicle's */
  o.quality = (int8_t)e->quality;
  mavlink_msg_odometry_encode_status(system, component, sender, m, &o);
}

static void pack_position(const tvm_estimate *e, uint8_t system, uint8_t component,
                          mavlink_status_t *sender, mavlink_message_t *m) {
  const double *q = e->world_from_body;
  const double sine = 2 * (q[0] * q[2] - q[3] * q[1]);
  mavlink_vision_position_estimate_t v;
  memset(&v, 0, sizeof v);
  v.usec = e->time_us;
  v.x = (float)e->position_m[0];
  v.y = (float)e->position_m[1];
  v.z = (float)e->position_m[2];
  v.roll = (float)atan2(2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[1] * q[1] + q[2] * q[2]));
  v.pitch = (float)asin(sine > 1 ? 1 : sine < -1 ? -1 : sine);
  v.yaw = (float)atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
  upper_triangle(e->pose_covariance, e->has_covariance, v.covariance);
  v.reset_counter = (uint8_t)e->reset_counter;
  mavlink_msg_vision_position_estimate_encode_status(system, component, sender, m, &v);
}

/* 0 where the estimate is silent or the message is none of the two. */
static int make_message(const tvm_estimate *estimate, int message, uint8_t system,
                        uint8_t component, mavlink_status_t *sender, mavlink_message_t *m) {
  if (estimate->silence != TVM_SILENCE_NONE) return 0;
  if (message == TVM_SEND_ODOMETRY) {
    pack_odometry(estimate, system, component, sender, m);
  } else if (message == TVM_SEND_VISION_POSITION) {
    pack_position(estimate, system, component, sender, m);
  } else {
    return 0;
  }
  return 1;
}

size_t tvm_estimate_pack(const tvm_estimate *estimate, int message, uint8_t system,
                         uint8_t component, uint8_t sequence, uint8_t *bytes) {
  mavlink_message_t m;
  mavlink_status_t sender;
  tvm_estimate own;
  if (!estimate || !bytes ||
      tvs_read_sized(estimate, TVS_SIZE_THROUGH(tvm_estimate, velocity_covariance), &own,
                     sizeof own) != TVS_OK) {
    return 0;
  }
  memset(&sender, 0, sizeof sender);
  sender.current_tx_seq = sequence;
  if (!make_message(&own, message, system, component, &sender, &m)) return 0;
  return mavlink_msg_to_send_buffer(bytes, &m);
}

/* ---- through a session ---- */

static const char *words_of(int silence) {
  switch (silence) {
    case TVM_SILENCE_NONE: return "twoview: position";
    case TVM_SILENCE_STARTING: return "twoview: no map yet, no position";
    case TVM_SILENCE_LOST: return "twoview: lost, no position";
    case TVM_SILENCE_ROTATION: return "twoview: only turning is seen, no position";
    case TVM_SILENCE_WEAK: return "twoview: weak, no position";
    case TVM_SILENCE_MOTION: return "twoview: not as the vehicle moves, no position";
    case TVM_SILENCE_SCALE: return "twoview: metre not known, no position";
    default: return "twoview: vertical not known, no position";
  }
}

/* Tells when it begins and ceases that positions are sent, and why. */
static void tell(tvm_session *s, tvm_estimator *e, int silence) {
  mavlink_message_t m;
  mavlink_statustext_t text;
  if (silence == TVM_SILENCE_VELOCITY || (e->has_told && silence == e->told_silence)) return;
  if (e->has_told && s->now_ns - e->told_ns < TELL_NS) return;
  memset(&text, 0, sizeof text);
  text.severity = silence == TVM_SILENCE_NONE ? MAV_SEVERITY_INFO : MAV_SEVERITY_WARNING;
  strncpy(text.text, words_of(silence), sizeof text.text);
  mavlink_msg_statustext_encode_status(tvm_own_system(s), (uint8_t)s->options.own_component,
                                       &s->sender, &m, &text);
  if (!tvm_send_message(s, &m)) return;
  e->has_told = 1;
  e->told_silence = silence;
  e->told_ns = s->now_ns;
}

/* Whether the camera's attitude in the map has the vertical that the vehicle's attitude has. */
static int is_upright(const tvm_estimator *e, const tv_odometry_state *state,
                      const tvs_attitude *attitude) {
  const double *q = attitude->world_from_body, *R = state->world_from_cam_R;
  /* Down along the body's axes, by the attitude; and along the camera's, by the mount. */
  const double down[3] = {2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]),
                          1 - 2 * (q[1] * q[1] + q[2] * q[2])};
  double cosine = 0;
  int i, k;
  for (i = 0; i < 3; ++i) {
    double in_camera = 0;
    for (k = 0; k < 3; ++k) in_camera += e->options.body_from_camera[3 * k + i] * down[k];
    cosine += R[6 + i] * in_camera;
  }
  return acos(cosine > 1    ? 1
              : cosine < -1 ? -1
                            : cosine) <= MOST_TILT_RAD + 3 * attitude->sigma_rad;
}

/* Whether the segment's x axis is that of the session's world: a segment from before the vehicle
   started again keeps the heading of the run that it began in. */
static int has_heading(const tvm_session *s, tvm_estimator *e, const tv_odometry_state *state) {
  if (s->clock_id != e->run_id) {
    if (e->run_id != 0) e->first_segment = e->max_segment + 1;
    e->run_id = s->clock_id;
  }
  if (!state->has_pose) return 0;
  if (state->segment > e->max_segment) e->max_segment = state->segment;
  return state->segment >= e->first_segment;
}

tvs_status tvm_session_send_track(tvm_session *session, tvm_estimator *estimator,
                                  const tvm_track *tracked, tvm_estimate *estimate) {
  tvm_estimate own;
  tvm_track known;
  tvs_attitude attitude;
  tvs_time time;
  tvs_status status;
  mavlink_message_t m;
  int message, num_sent = 0;
  if (!session || !estimator || !tracked) return TVS_ERR_NULL;
  status = tvs_read_sized(tracked, TVS_SIZE_THROUGH(tvm_track, heading_rad), &known, sizeof known);
  if (status != TVS_OK) return status;
  if (!tracked->state) return TVS_ERR_NULL;
  if (estimate && !tvs_is_sized(estimate, TVS_SIZE_THROUGH(tvm_estimate, velocity_covariance))) {
    return TVS_ERR_STRUCT_SIZE;
  }
  known.is_upright = 0;
  memset(&own, 0, sizeof own);
  own.struct_size = sizeof own;
  session->sends_estimates = 1;
  if (tvm_session_attitude_at(session, tracked->host_ns, &time, &attitude) == TVS_OK &&
      time.device_ns > 0) {
    known.time_us = (uint64_t)time.device_ns / 1000;
    if (tracked->state->has_pose) {
      known.is_upright = is_upright(estimator, tracked->state, &attitude) ? 1 : -1;
    }
    known.heading_rad = session->yaw0_rad;
  }
  if (!has_heading(session, estimator, tracked->state) &&
      estimator->options.world == TVM_WORLD_NED) {
    known.is_upright = 0;
  }
  status = tvm_estimator_update(estimator, &known, &own);
  if (status != TVS_OK) return status;
  if (estimate) tvs_write_sized(&own, sizeof own, estimate, estimate->struct_size);
  if (session->options.listen_only || session->vehicle == 0) return TVS_NONE;
  tell(session, estimator, own.silence);
  for (message = TVM_SEND_ODOMETRY; message <= TVM_SEND_VISION_POSITION; message <<= 1) {
    if (!(estimator->options.messages & message) ||
        !make_message(&own, message, tvm_own_system(session),
                      (uint8_t)session->options.own_component, &session->sender, &m)) {
      continue;
    }
    num_sent += tvm_send_message(session, &m);
  }
  return num_sent > 0 ? TVS_OK : TVS_NONE;
}
