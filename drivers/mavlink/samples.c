/* Messages to samples of source.h. MAVLink's body axes (forward, right, down) are ours; its world
   is north, east, down, ours is that turned about the vertical so that x is the body's x at the
   start:  world_from_body = Rz(-yaw0) ned_from_body,  velocity_body = ned_from_body^T velocity_ned,
   height = -z.  docs/mavlink.md derives it. */
#include <math.h>
#include <string.h>

#include "session_impl.h"

static const int64_t WAIT_NS = 150 * MS;  /* how long a sample waits for its later neighbour */
static const int64_t ALIVE_NS = 400 * MS; /* a quantity that is older no longer comes */
static const int64_t VELOCITY_GAP_NS = 250 * MS, HEIGHT_GAP_NS = 500 * MS;
static const int64_t CHOICE_NS = 1 * SECOND; /* how long heights are listened to before a choice */
static const int64_t LATEST_REPLY_NS = 500 * MS;
static const int64_t DRIFT_PPM = 100;
static const double RATE_SIGMA = 0.01; /* rad/s */
/* What no vehicle with a camera that looks at the ground has: such a reading is no measurement. */
static const double MOST_HEIGHT_M = 3000, MOST_SPEED_M_S = 150;
/* The least share of the vertical in the direction of a rangefinder: a beam that is 45 degrees off
   it may meet a wall. */
static const double LEAST_DOWN = 0.7;

/* ---- the vehicle's clock ---- */

int tvm_has_clock(const tvm_session *s) {
  return s->clock_id != 0 && s->clock.clock_id == s->clock_id;
}

int64_t tvm_shift(const tvm_session *s, int64_t *uncertainty_ns) {
  int64_t host_ns = 0, upper_ns, lower_ns, age_ns;
  *uncertainty_ns = INT64_MAX;
  tvs_clock_to_host(&s->clock, s->clock.clock_id, s->newest_device_ns, &host_ns, uncertainty_ns);
  if (!s->has_lower) return host_ns - s->newest_device_ns;
  /* The clock subtracts half of the least delay that it assumes; TIMESYNC measures a bound of it.
   */
  upper_ns = host_ns - s->newest_device_ns + s->clock.options.least_delay_ns / 2;
  age_ns = s->now_ns - s->lower_received_ns;
  lower_ns = s->lower_ns - age_ns / 1000000 * DRIFT_PPM;
  if (lower_ns > upper_ns) lower_ns = upper_ns;
  *uncertainty_ns = (upper_ns - lower_ns) / 2 + MS; /* 1 ms: the unit of time_boot_ms */
  return lower_ns + (upper_ns - lower_ns) / 2;
}

void tvm_take_timesync(tvm_session *s, int64_t vehicle_ns, int64_t sent_ns) {
  int64_t uncertainty_ns, shift_ns, lower_ns, aged_ns;
  if (!tvm_has_clock(s) || sent_ns > s->now_ns || s->now_ns - sent_ns > LATEST_REPLY_NS) return;
  if (vehicle_ns <= 0 || vehicle_ns > INT64_C(1) << 61) return;
  /* The vehicle read its clock after the request was sent. */
  lower_ns = sent_ns - vehicle_ns;
  shift_ns = tvm_shift(s, &uncertainty_ns);
  /* Some vehicles answer in another time than that of time_boot_ms, such as that of day. */
  if (lower_ns > shift_ns + uncertainty_ns + 5 * MS || lower_ns < shift_ns - SECOND) return;
  ++s->counters.timesyncs;
  aged_ns = s->lower_ns - (s->now_ns - s->lower_received_ns) / 1000000 * DRIFT_PPM;
  if (s->has_lower && lower_ns < aged_ns) return;
  s->has_lower = 1;
  s->lower_ns = lower_ns;
  s->lower_received_ns = s->now_ns;
}

static void emit_all(tvm_session *s);

/* Forgets all that belongs to the last run of the vehicle's clock. */
static void begin_run(tvm_session *s, const tvs_time *time, double yaw_rad) {
  int k;
  emit_all(s);
  if (s->clock_id != 0) {
    ++s->counters.reboots;
    memset(s->has_sequence, 0, sizeof s->has_sequence);
    for (k = 0; k < NUM_WANTED; ++k) s->requests[k].num_tries = 0;
    s->requests_due_ns = INT64_MIN;
    if (s->options.on_event) s->options.on_event(s->options.user, TVM_EVENT_REBOOT);
  }
  s->clock_id = time->clock_id;
  s->emitted_device_ns = INT64_MIN;
  s->first_device_ns = time->device_ns;
  s->yaw0_rad = yaw_rad;
  s->has_lower = 0;
  s->velocity.num = 0;
  for (k = 0; k < NUM_HEIGHTS; ++k) s->heights[k].num = 0;
  s->height = NUM_HEIGHTS;
  s->range_id = -1;
  tvs_attitudes_init(&s->attitudes);
}

/* Whether the clock would begin a new run with this stamp. */
static int looks_rebooted(const tvm_session *s, int64_t stamp_ns) {
  const int64_t period_ns = s->clock.options.period_ns;
  int64_t device_ns, unused_ns, ahead_ns;
  uint32_t id;
  if (s->clock_id == 0 ||
      tvs_clock_to_device(&s->clock, s->now_ns, &id, &device_ns, &unused_ns) != TVS_OK) {
    return 0;
  }
  ahead_ns = (stamp_ns - device_ns) % period_ns;
  if (ahead_ns > period_ns / 2) ahead_ns -= period_ns;
  if (ahead_ns < -period_ns / 2) ahead_ns += period_ns;
  return ahead_ns > 900 * MS || ahead_ns < -29 * SECOND ||
         device_ns + ahead_ns < s->newest_device_ns - 900 * MS;
}

/* The time of a stamp. A new run of the clock needs three stamps in succession that agree with each
   other, so that one stray packet does not begin one. Returns 0 where the stamp is not used. */
static int time_of(tvm_session *s, uint32_t time_boot_ms, tvs_time *time) {
  const int64_t stamp_ns = time_boot_ms * MS;
  if (looks_rebooted(s, stamp_ns)) {
    const int64_t step_ns = (stamp_ns - s->suspect_stamp_ns) - (s->now_ns - s->suspect_received_ns);
    const int agrees = s->num_suspects > 0 && step_ns < SECOND && step_ns > -SECOND;
    s->num_suspects = agrees ? s->num_suspects + 1 : 1;
    s->suspect_stamp_ns = stamp_ns;
    s->suspect_received_ns = s->now_ns;
    if (s->num_suspects < 3) {
      ++s->counters.late;
      return 0;
    }
    tvs_clock_restart(&s->clock);
  }
  s->num_suspects = 0;
  memset(time, 0, sizeof *time);
  if (tvs_clock_observe(&s->clock, stamp_ns, s->now_ns, time) != TVS_OK) return 0;
  if (time->clock_id != s->clock_id || time->device_ns > s->newest_device_ns)
    s->newest_device_ns = time->device_ns;
  return 1;
}

static void refine_time(const tvm_session *s, tvs_time *time) {
  time->host_ns = time->device_ns + tvm_shift(s, &time->uncertainty_ns);
}

/* ---- values between two measurements ---- */

static void add_value(tvm_session *s, track *t, int64_t device_ns, const double value[3]) {
  if (t->num > 0 && device_ns <= t->device_ns[1]) return;
  t->device_ns[0] = t->device_ns[1];
  memcpy(t->value[0], t->value[1], sizeof t->value[0]);
  t->device_ns[1] = device_ns;
  memcpy(t->value[1], value, sizeof t->value[1]);
  t->received_ns = s->now_ns;
  if (t->num < 2) ++t->num;
}

static int value_at(const track *t, int64_t device_ns, int64_t max_gap_ns, double value[3]) {
  const int64_t gap_ns = t->device_ns[1] - t->device_ns[0];
  double share;
  int k;
  if (t->num > 0 && device_ns == t->device_ns[1]) {
    memcpy(value, t->value[1], sizeof t->value[1]);
    return 1;
  }
  if (t->num < 2 || gap_ns > max_gap_ns || device_ns < t->device_ns[0] ||
      device_ns > t->device_ns[1]) {
    return 0;
  }
  share = (double)(device_ns - t->device_ns[0]) / (double)gap_ns;
  for (k = 0; k < 3; ++k) value[k] = (1 - share) * t->value[0][k] + share * t->value[1][k];
  return 1;
}

/* Whether a value after device_ns is still to be waited for. */
static int will_come(const tvm_session *s, const track *t, int64_t device_ns) {
  return t->num > 0 && t->device_ns[1] < device_ns && s->now_ns - t->received_ns < ALIVE_NS;
}

/* ---- samples ---- */

/* v in the body's axes of an attitude q (ned_from_body): q* v q. */
static void to_body(const double q[4], const double v[3], double out[3]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                       2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  int k;
  for (k = 0; k < 3; ++k) out[k] = r[k] * v[0] + r[3 + k] * v[1] + r[6 + k] * v[2];
}

static double height_sigma(int kind, double height_m) {
  switch (kind) {
    case HEIGHT_RANGE: return 0.05 + 0.01 * fabs(height_m);
    case HEIGHT_CLEARANCE: return 0.1 + 0.02 * fabs(height_m);
    case HEIGHT_LOCAL: return 0.2;
    default: return 0.5;
  }
}

static void choose_height(tvm_session *s, int64_t device_ns) {
  int k;
  if (s->height != NUM_HEIGHTS || device_ns - s->first_device_ns < CHOICE_NS) return;
  for (k = 0; k < NUM_HEIGHTS && s->height == NUM_HEIGHTS; ++k)
    if (s->heights[k].num == 2) s->height = k;
}

/* Puts what is known by now into a waiting sample. It is done at each message, since a quantity's
   two latest values are soon later than the sample. */
static void complete(const tvm_session *s, struct pending *p) {
  tvs_imu *sample = &p->sample;
  double value[3];
  if ((sample->valid & TVS_IMU_VELOCITY_Z) == 0 &&
      value_at(&s->velocity, sample->time.device_ns, VELOCITY_GAP_NS, value)) {
    to_body(p->ned_from_body, value, sample->velocity_m_s);
    sample->velocity_sigma = s->options.velocity_sigma_m_s;
    sample->valid |= TVS_IMU_VELOCITY_XY | TVS_IMU_VELOCITY_Z;
  }
  if ((sample->valid & TVS_IMU_ALTITUDE) == 0 && s->height < NUM_HEIGHTS &&
      value_at(&s->heights[s->height], sample->time.device_ns, HEIGHT_GAP_NS, value)) {
    sample->altitude_m = value[0];
    sample->altitude_sigma = value[1];
    sample->valid |= TVS_IMU_ALTITUDE;
  }
}

static void emit_first(tvm_session *s) {
  const tvs_imu sample = s->pending[s->first_pending].sample;
  s->emitted_device_ns = sample.time.device_ns;
  s->first_pending = (s->first_pending + 1) % QUEUE_PENDING;
  --s->num_pending;
  if (s->num_imu == QUEUE_IMU) {
    s->first_imu = (s->first_imu + 1) % QUEUE_IMU;
    --s->num_imu;
  }
  s->imu[(s->first_imu + s->num_imu++) % QUEUE_IMU] = sample;
  if (s->options.on_imu) s->options.on_imu(s->options.user, &sample);
}

static void emit_all(tvm_session *s) {
  while (s->num_pending > 0) emit_first(s);
}

void tvm_drain(tvm_session *s) {
  int k;
  choose_height(s, s->newest_device_ns);
  for (k = 0; k < s->num_pending; ++k)
    complete(s, &s->pending[(s->first_pending + k) % QUEUE_PENDING]);
  while (s->num_pending > 0) {
    const struct pending *first = &s->pending[s->first_pending];
    const tvs_time *time = &first->sample.time;
    if (s->now_ns - time->received_ns < WAIT_NS &&
        (((first->sample.valid & TVS_IMU_VELOCITY_Z) == 0 &&
          will_come(s, &s->velocity, time->device_ns)) ||
         (s->height < NUM_HEIGHTS && will_come(s, &s->heights[s->height], time->device_ns)))) {
      return;
    }
    emit_first(s);
  }
}

static void take_attitude(tvm_session *s, const mavlink_message_t *m) {
  mavlink_attitude_t a;
  tvs_imu sample;
  struct pending *p;
  mavlink_msg_attitude_decode(m, &a);
  if (!(fabs((double)a.roll) < 10 && fabs((double)a.pitch) < 10 && fabs((double)a.yaw) < 10)) {
    ++s->num_invalid; /* NaN too */
    return;
  }
  memset(&sample, 0, sizeof sample);
  if (!time_of(s, a.time_boot_ms, &sample.time)) return;
  if (sample.time.clock_id != s->clock_id) begin_run(s, &sample.time, (double)a.yaw);
  refine_time(s, &sample.time);
  sample.struct_size = sizeof sample;
  sample.valid = TVS_IMU_ATTITUDE;
  tvs_quaternion_from_euler((double)a.yaw - s->yaw0_rad, (double)a.pitch, (double)a.roll,
                            sample.attitude.world_from_body);
  sample.attitude.sigma_rad = s->options.attitude_sigma_rad;
  sample.attitude.clock_id = sample.time.clock_id;
  if (isfinite(a.rollspeed) && isfinite(a.pitchspeed) && isfinite(a.yawspeed)) {
    sample.valid |= TVS_IMU_RATE;
    sample.rate_rad_s[0] = (double)a.rollspeed;
    sample.rate_rad_s[1] = (double)a.pitchspeed;
    sample.rate_rad_s[2] = (double)a.yawspeed;
    sample.rate_sigma = RATE_SIGMA;
  }
  if (tvs_attitudes_add(&s->attitudes, sample.time.device_ns, &sample.attitude) != TVS_OK) return;
  ++s->counters.attitudes;
  s->attitude_heard_ns = s->now_ns;
  if (s->num_pending == QUEUE_PENDING) emit_first(s);
  p = &s->pending[(s->first_pending + s->num_pending++) % QUEUE_PENDING];
  p->sample = sample;
  tvs_quaternion_from_euler((double)a.yaw, (double)a.pitch, (double)a.roll, p->ned_from_body);
}

/* least_sigma_m: what the sensor itself says of its error; 0 where it says nothing. */
static void add_height(tvm_session *s, height_kind kind, int64_t device_ns, double height_m,
                       double least_sigma_m) {
  const double value[3] = {height_m, fmax(height_sigma(kind, height_m), least_sigma_m), 0};
  if (fabs(height_m) <= MOST_HEIGHT_M)
    add_value(s, &s->heights[kind], device_ns, value);
  else
    ++s->num_invalid; /* NaN too */
}

static void take_position(tvm_session *s, const mavlink_message_t *m) {
  mavlink_local_position_ned_t p;
  tvs_time time;
  mavlink_msg_local_position_ned_decode(m, &p);
  if (!time_of(s, p.time_boot_ms, &time) || time.clock_id != s->clock_id) return;
  add_height(s, HEIGHT_LOCAL, time.device_ns, -(double)p.z, 0);
  if (hypot(hypot((double)p.vx, (double)p.vy), (double)p.vz) <= MOST_SPEED_M_S) {
    const double velocity[3] = {(double)p.vx, (double)p.vy, (double)p.vz};
    add_value(s, &s->velocity, time.device_ns, velocity);
  } else {
    ++s->num_invalid; /* NaN too */
  }
}

/* The vehicle's present time, for messages whose stamp is of another clock. */
static int present_ns(const tvm_session *s, int64_t *device_ns) {
  int64_t unused_ns;
  if (!tvm_has_clock(s)) return 0;
  *device_ns = s->now_ns - tvm_shift(s, &unused_ns);
  return 1;
}

static void take_altitude(tvm_session *s, const mavlink_message_t *m) {
  mavlink_altitude_t a;
  int64_t device_ns;
  mavlink_msg_altitude_decode(m, &a);
  if (!present_ns(s, &device_ns)) return;
  /* time_usec counts from the boot or is the time of day; the vehicle does not say which. */
  if (a.time_usec < UINT64_C(1) << 50) {
    const int64_t stamp_ns = (int64_t)a.time_usec * 1000;
    if (stamp_ns - device_ns < SECOND && device_ns - stamp_ns < SECOND) device_ns = stamp_ns;
  }
  /* A clearance that is not known is NaN or below 0, and 0 on the ground: nothing is wrong with it.
   */
  if ((double)a.bottom_clearance > 0)
    add_height(s, HEIGHT_CLEARANCE, device_ns, (double)a.bottom_clearance, 0);
  add_height(s, HEIGHT_RELATIVE, device_ns, (double)a.altitude_relative, 0);
}

/* Whether a DISTANCE_SENSOR looks down the body's z axis or, with an orientation of its own, in a
   direction of the body's axes that its quaternion turns x to. False: it looks elsewhere. */
static int direction_of(const mavlink_distance_sensor_t *d, double direction[3]) {
  const double w = (double)d->quaternion[0], x = (double)d->quaternion[1],
               y = (double)d->quaternion[2], z = (double)d->quaternion[3];
  const double norm_sq = w * w + x * x + y * y + z * z;
  direction[0] = direction[1] = 0;
  direction[2] = 1;
  if (d->orientation == MAV_SENSOR_ROTATION_PITCH_270) return 1;
  if (d->orientation != MAV_SENSOR_ROTATION_CUSTOM || !(norm_sq > 0.5 && norm_sq < 2)) return 0;
  direction[0] = (w * w + x * x - y * y - z * z) / norm_sq;
  direction[1] = 2 * (x * y + w * z) / norm_sq;
  direction[2] = 2 * (x * z - w * y) / norm_sq;
  return direction[2] >= LEAST_DOWN;
}

/* Whether the sensor measured anything. Its quality is 1 for an invalid signal, 0 where it is not
   known and else a percentage. At the ends of its range a sensor repeats them, whatever is there.
 */
static int is_reading(const mavlink_distance_sensor_t *d) {
  return d->signal_quality != 1 && d->current_distance > 0 &&
         d->current_distance > d->min_distance && d->current_distance < d->max_distance;
}

/* The vertical's share of a direction of the body's axes: the third row of the rotation times it.
 */
static double share_of_down(const double q[4], const double v[3]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return 2 * (x * z - w * y) * v[0] + 2 * (y * z + w * x) * v[1] + (1 - 2 * (x * x + y * y)) * v[2];
}

static void take_distance(tvm_session *s, const mavlink_message_t *m) {
  mavlink_distance_sensor_t d;
  tvs_attitude attitude;
  tvs_time time;
  double direction[3], down, sigma_m;
  mavlink_msg_distance_sensor_decode(m, &d);
  if (!direction_of(&d, direction)) return;
  if (!is_reading(&d)) {
    ++s->num_invalid;
    return;
  }
  if (!time_of(s, d.time_boot_ms, &time) || time.clock_id != s->clock_id || s->attitudes.count == 0)
    return;
  /* Two sensors differ by where they are mounted: a run keeps to the first one that measured. */
  if (s->range_id < 0) s->range_id = d.id;
  if (s->range_id != d.id) return;
  attitude =
      s->attitudes.entries[(s->attitudes.first + s->attitudes.count - 1) % TVS_ATTITUDES_CAPACITY]
          .attitude;
  down = share_of_down(attitude.world_from_body, direction);
  if (down < LEAST_DOWN) return;
  /* The variance in cm^2; 255: not known, and many sensors leave it 0. */
  sigma_m = d.covariance < 255 ? 0.01 * sqrt((double)d.covariance) : 0;
  add_height(s, HEIGHT_RANGE, time.device_ns, 0.01 * d.current_distance * down, sigma_m * down);
}

void tvm_take_message(tvm_session *s, const mavlink_message_t *m) {
  switch (m->msgid) {
    case MAVLINK_MSG_ID_ATTITUDE: take_attitude(s, m); break;
    case MAVLINK_MSG_ID_LOCAL_POSITION_NED: take_position(s, m); break;
    case MAVLINK_MSG_ID_ALTITUDE: take_altitude(s, m); break;
    case MAVLINK_MSG_ID_DISTANCE_SENSOR: take_distance(s, m); break;
    default: return;
  }
  tvm_drain(s);
}
