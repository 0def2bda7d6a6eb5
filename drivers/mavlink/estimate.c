/* What visual odometry says of a frame, as an estimate of the body's pose and motion.

   tv_odometry_state.cam_from_world_covariance is that of (w, d) with x_true = exp([w]x) x + d for a
   point x of the camera, so the camera's place errs by -R d and its attitude by the turn -R w about
   the world's axes, R = world_from_cam. */
#include "twoview_drivers/mavlink/estimate.h"

#include <math.h>
#include <string.h>

#include "../source/sized.h"

static const int64_t MOST_STEP_NS = INT64_C(500000000); /* between frames that give a velocity */
/* The acceleration of a vehicle of which one velocity alone is known, m/s^2 and rad/s^2. */
static const double ACCELERATION = 5.0;
/* Where the quality is 50: what PX4 (EKF2_EVP_NOISE) and ArduPilot (VISO_POS_M_NSE, 0.2) take for
   the noise of such a position. */
static const double HALF_QUALITY_M = 0.1;
enum { WEAK_QUALITY = 20 };
/* By how much a segment that begins in flight drifts more than the first one, from fewer attitudes:
   the root mean square of its turn was 0.0077 rad in 19 rendered segments, for 0.0030 of the first
   ones. */
static const double LATER_DRIFT = 2.0;
/* How long a map whose vertical was not the vehicle's must agree with it before it is believed. */
static const double DOUBT_S = 1.0;
/* The way of the pictures is compared with that of the vehicle's own velocities over a time that
   fades: chi square of three degrees of freedom, 99.9 %. A segment that is new, or was found again,
   is believed after as long as this has been possible for TRIAL_S. For longer than MOST_REFUSED_S
   the vehicle's own velocity may be what is wrong, since it gets no estimates. */
static const double COMPARED_S = 0.4, TRIAL_S = 0.2, MOST_REFUSED_S = 2.0, CONTRADICTED = 16.27;
/* The least noise of a velocity that PX4 (EKF2_EVV_NOISE) and ArduPilot (VISO_VEL_M_NSE) take. */
static const double LEAST_VELOCITY_NOISE = 0.1;
/* A correction of a pose without a covariance that counts as a reset: metres, radians. */
static const double LEAST_JUMP_M = 0.05, LEAST_JUMP_RAD = 0.01;
/* The cosine of the pitch below which roll and yaw cannot be told apart. */
static const double LEAST_COS_PITCH = 0.05;

/* ---- 3 x 3 and 6 x 6, row-major ---- */

static void multiply(const double *a, const double *b, double *out) {
  int i, j, k;
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 3; ++j) {
      double sum = 0;
      for (k = 0; k < 3; ++k) sum += a[3 * i + k] * b[3 * k + j];
      out[3 * i + j] = sum;
    }
  }
}

static void transpose(const double *a, double *out) {
  int i, j;
  for (i = 0; i < 3; ++i)
    for (j = 0; j < 3; ++j) out[3 * j + i] = a[3 * i + j];
}

static void apply(const double *a, const double *v, double *out) {
  int i;
  for (i = 0; i < 3; ++i) out[i] = a[3 * i] * v[0] + a[3 * i + 1] * v[1] + a[3 * i + 2] * v[2];
}

static void cross_matrix(const double *v, double *out) {
  const double m[9] = {0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0};
  memcpy(out, m, sizeof m);
}

static double length_sq(const double *v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

/* out = J C J^T, and symmetric to the last bit. */
static void propagate(const double *J, const double *C, double *out) {
  double JC[36];
  int i, j, k;
  for (i = 0; i < 6; ++i) {
    for (j = 0; j < 6; ++j) {
      double sum = 0;
      for (k = 0; k < 6; ++k) sum += J[6 * i + k] * C[6 * k + j];
      JC[6 * i + j] = sum;
    }
  }
  for (i = 0; i < 6; ++i) {
    for (j = i; j < 6; ++j) {
      double sum = 0;
      for (k = 0; k < 6; ++k) sum += JC[6 * i + k] * J[6 * j + k];
      out[6 * i + j] = out[6 * j + i] = sum;
    }
  }
}

/* Puts a 3 x 3 block, times `factor`, into a 6 x 6 matrix. */
static void put_block(double *J, int row, int column, const double *block, double factor) {
  int i, j;
  for (i = 0; i < 3; ++i)
    for (j = 0; j < 3; ++j) J[6 * (row + i) + column + j] = factor * block[3 * i + j];
}

static void quaternion_of(const double *R, double *q) {
  /* The largest component by a root, the others by division (Shepperd, 1978). */
  const double trace = R[0] + R[4] + R[8];
  const double squares[4] = {1 + trace, 1 + 2 * R[0] - trace, 1 + 2 * R[4] - trace,
                             1 + 2 * R[8] - trace};
  double length;
  int best = 0, k;
  for (k = 1; k < 4; ++k)
    if (squares[k] > squares[best]) best = k;
  switch (best) {
    case 0: q[0] = squares[0], q[1] = R[7] - R[5], q[2] = R[2] - R[6], q[3] = R[3] - R[1]; break;
    case 1: q[0] = R[7] - R[5], q[1] = squares[1], q[2] = R[1] + R[3], q[3] = R[2] + R[6]; break;
    case 2: q[0] = R[2] - R[6], q[1] = R[1] + R[3], q[2] = squares[2], q[3] = R[5] + R[7]; break;
    default: q[0] = R[3] - R[1], q[1] = R[2] + R[6], q[2] = R[5] + R[7], q[3] = squares[3]; break;
  }
  length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (q[0] < 0) length = -length;
  for (k = 0; k < 4; ++k) q[k] /= length;
}

/* The rotation vector of R. */
static void logarithm(const double *R, double *w) {
  double q[4], sine, factor;
  int k;
  quaternion_of(R, q);
  sine = sqrt(length_sq(q + 1));
  factor = sine > 1e-9 ? 2 * atan2(sine, q[0]) / sine : 2;
  for (k = 0; k < 3; ++k) w[k] = factor * q[1 + k];
}

static int is_rotation(const double *R) {
  double Rt[9], product[9], determinant;
  int k;
  transpose(R, Rt);
  multiply(R, Rt, product);
  for (k = 0; k < 9; ++k)
    if (!(fabs(product[k] - (k % 4 == 0)) < 1e-6)) return 0;
  determinant = R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) +
                R[2] * (R[3] * R[7] - R[4] * R[6]);
  return determinant > 0;
}

/* ---- options ---- */

static void set_defaults(tvm_estimator_options *options) {
  static const double ahead[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
  memset(options, 0, sizeof *options);
  options->messages = TVM_SEND_ODOMETRY;
  options->weak_factor = 3;
  options->drift_share = 0.005;
  options->drift_turn_rad = 0.008;
  options->filter_memory_s = 1;
  memcpy(options->body_from_camera, ahead, sizeof ahead);
}

void tvm_estimator_options_init_sized(tvm_estimator_options *options, size_t struct_size) {
  tvm_estimator_options own;
  if (!options) return;
  set_defaults(&own);
  tvs_write_sized(&own, sizeof own, options, struct_size);
}

tvs_status tvm_estimator_init(tvm_estimator *estimator, const tvm_estimator_options *given) {
  tvm_estimator_options own, *options = &own;
  tvs_status status;
  if (!estimator || !given) return TVS_ERR_NULL;
  set_defaults(options);
  status = tvs_read_sized(given, TVS_SIZE_THROUGH(tvm_estimator_options, drift_turn_rad), options,
                          sizeof *options);
  if (status != TVS_OK) return status;
  if (options->messages < 1 || options->messages > 3 || options->weak < TVM_WEAK_SILENT ||
      options->weak > TVM_WEAK_GROWN || options->world < TVM_WORLD_FRD ||
      options->world > TVM_WORLD_NED ||
      !(options->weak_factor >= 1 && options->weak_factor <= 100) ||
      !(options->drift_share >= 0 && options->drift_share <= 1) ||
      !(options->drift_turn_rad >= 0 && options->drift_turn_rad <= 1) ||
      !(options->filter_memory_s >= 0 && options->filter_memory_s <= 100) ||
      !is_rotation(options->body_from_camera) || !(length_sq(options->camera_in_body) < 1e6)) {
    return TVS_ERR_ARGUMENT;
  }
  memset(estimator, 0, sizeof *estimator);
  estimator->options = *options;
  estimator->last_segment = estimator->max_segment = -1;
  estimator->last_ns = estimator->told_ns = INT64_MIN;
  return TVS_OK;
}

/* ---- one frame ---- */

/* Whether the pose is one that a filter may be given: finite, and as large as a float holds. */
static int is_usable(const tv_odometry_state *s) {
  double sum = fabs(s->scale_sigma);
  int k;
  for (k = 0; k < 3; ++k) sum += fabs(s->world_from_cam_t[k]);
  for (k = 0; k < 36 && s->has_covariance; ++k) sum += fabs(s->cam_from_world_covariance[k]);
  return is_rotation(s->world_from_cam_R) && sum < 1e6;
}

static tvm_silence silence_of(const tvm_estimator *e, const tvm_track *track) {
  const tv_odometry_state *s = track->state;
  if (s->status == TV_ODOMETRY_STARTING) return TVM_SILENCE_STARTING;
  if (s->status == TV_ODOMETRY_ROTATION) return TVM_SILENCE_ROTATION;
  if (s->status == TV_ODOMETRY_LOST || !s->has_pose || !is_usable(s)) return TVM_SILENCE_LOST;
  if (s->scale_source == TV_SCALE_UNIT) return TVM_SILENCE_SCALE;
  if (track->is_upright != 1 || e->doubt_ms > 0) return TVM_SILENCE_ATTITUDE;
  if (s->status == TV_ODOMETRY_WEAK && e->options.weak == TVM_WEAK_SILENT) return TVM_SILENCE_WEAK;
  return TVM_SILENCE_NONE;
}

/* A map that was turned once, such as one of another place, may be upright by chance in the next
   frame. */
static void count_doubt(tvm_estimator *e, const tvm_track *track) {
  /* In floating point, since last_ns is the least number before the first frame. */
  const double step_ms = 1e-6 * ((double)track->host_ns - (double)e->last_ns);
  if (track->state->has_pose && track->state->segment != e->last_segment) e->doubt_ms = 0;
  if (track->is_upright < 0) {
    e->doubt_ms = (int32_t)(1e3 * DOUBT_S);
  } else if (track->is_upright) {
    e->doubt_ms = step_ms < e->doubt_ms ? e->doubt_ms - (int32_t)step_ms : 0;
  }
}

/* Whether previous_R and previous_t hold a pose. */
static int has_previous(const tvm_track *track) {
  const double *t = track->previous_t;
  return track->has_previous && is_rotation(track->previous_R) &&
         fabs(t[0]) + fabs(t[1]) + fabs(t[2]) < 1e6;
}

/* Whether the map's adjustment has moved the last frame by more than its own standard deviation. */
static int was_corrected(const tvm_estimator *e, const tvm_track *track) {
  double moved[3], Rt[9], turn[9], w[3];
  int k;
  if (!has_previous(track) || !e->has_last) return 0;
  for (k = 0; k < 3; ++k) moved[k] = track->previous_t[k] - e->last_t[k];
  transpose(e->last_R, Rt);
  multiply(Rt, track->previous_R, turn);
  logarithm(turn, w);
  return length_sq(moved) > e->last_place_sq || length_sq(w) > e->last_turn_sq;
}

/* Counts what makes a pose jump. */
static void count_resets(tvm_estimator *e, const tvm_track *track) {
  const tv_odometry_state *s = track->state;
  const int is_metric = s->scale_source != TV_SCALE_UNIT;
  const int jumps =
      s->relocated || s->loop_closed ||
      (e->last_segment >= 0 && (s->segment != e->last_segment || is_metric != e->was_metric));
  if (jumps || was_corrected(e, track)) e->reset_counter = (e->reset_counter + 1) & 255;
  /* The way since the last frame is then not one of the vehicle. */
  if (jumps) e->has_last = 0;
  if (e->last_segment >= 0 && (s->relocated || s->segment != e->last_segment)) e->is_on_trial = 1;
  /* A loop that joins a segment to an older one leads to what all the way since has drifted. */
  if (s->segment < e->last_segment) {
    e->path_m = e->way_m;
  } else if (s->segment > e->last_segment || is_metric != e->was_metric) {
    /* Before the metre is known the way is not, but it is no shorter than this. */
    e->path_m = is_metric ? sqrt(length_sq(s->world_from_cam_t)) : 0;
  }
  e->last_segment = s->segment;
  e->was_metric = is_metric;
}

/* The body's pose (R, p) in the map of a camera's pose. */
static void body_pose(const tvm_estimator *e, const double *R_camera, const double *t, double *R,
                      double *p) {
  double camera_from_body[9], arm[3];
  int k;
  transpose(e->options.body_from_camera, camera_from_body);
  multiply(R_camera, camera_from_body, R);
  apply(R, e->options.camera_in_body, arm);
  for (k = 0; k < 3; ++k) p[k] = t[k] - arm[k];
}

/* The covariance of the body's place and of its turn about the world's axes: dp = -R d + arm x w,
   dtheta = -R w, where arm is the camera's place in the body along the world's axes. */
static void body_covariance(const tvm_estimator *e, const double *R_camera, const double *R_body,
                            const double *covariance, double *out) {
  double J[36] = {0}, arm[3], arm_cross[9], lever[9];
  apply(R_body, e->options.camera_in_body, arm);
  cross_matrix(arm, arm_cross);
  multiply(arm_cross, R_camera, lever);
  put_block(J, 0, 0, lever, -1);
  put_block(J, 0, 3, R_camera, -1);
  put_block(J, 3, 0, R_camera, -1);
  propagate(J, covariance, out);
}

/* Turns about the world's axes into those of roll, pitch and yaw. Returns 0 near a pitch of 90
   degrees. */
static int to_euler(const double *R, const double *covariance, double *out) {
  const double sine = -R[6], cosine = sqrt(R[0] * R[0] + R[3] * R[3]);
  double J[36] = {0}, E[9];
  static const double one[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double cy, sy;
  if (cosine < LEAST_COS_PITCH) return 0;
  cy = R[0] / cosine;
  sy = R[3] / cosine;
  E[0] = cy / cosine, E[1] = sy / cosine, E[2] = 0;
  E[3] = -sy, E[4] = cy, E[5] = 0;
  E[6] = cy * sine / cosine, E[7] = sy * sine / cosine, E[8] = 1;
  put_block(J, 0, 0, one, 1);
  put_block(J, 3, 3, E, 1);
  propagate(J, covariance, out);
  return 1;
}

/* Turns a vector of the map about the vertical. */
static void turn_to_north(double cosine, double sine, double *v) {
  const double x = cosine * v[0] - sine * v[1], y = sine * v[0] + cosine * v[1];
  v[0] = x;
  v[1] = y;
}

/* `place`: the covariance of the place and the turn, of the error of one message. */
static int quality_of(const double *place, int is_weak) {
  const double largest = fmax(fmax(place[0], place[7]), place[14]);
  double quality = floor(100 / (1 + largest / (HALF_QUALITY_M * HALF_QUALITY_M)) + 0.5);
  if (is_weak && quality > WEAK_QUALITY) quality = WEAK_QUALITY;
  return quality < 1 ? 1 : (int)quality;
}

/* The share of a metre that errs in the covariance of a length v. */
static void add_scale(double sigma, const double *v, double *covariance) {
  int i, j;
  for (i = 0; i < 3; ++i)
    for (j = 0; j < 3; ++j) covariance[6 * i + j] += sigma * sigma * v[i] * v[j];
}

/* How often the filter counts an error that stays; at least 1. */
static double messages_in_memory(const tvm_estimator *e, const tvm_track *track) {
  const double dt = (double)(track->host_ns - e->last_ns) * 1e-9;
  return dt < e->options.filter_memory_s ? e->options.filter_memory_s / dt : 1;
}

/* The standard deviation of the map's turn about each axis, radians. */
static double turn_of(const tvm_estimator *e, int32_t segment) {
  return e->options.drift_turn_rad * (segment > 0 ? LATER_DRIFT : 1);
}

/* That of the map's drift along each axis, metres. */
static double drift_of(const tvm_estimator *e, int32_t segment) {
  return e->options.drift_share * e->path_m * (segment > 0 ? LATER_DRIFT : 1);
}

/* What stays the same from message to message: a metre that errs moves all places
   away from the map's origin together, the map drifts, and it is turned about its origin, which
   moves a place at p by the turn x p. */
static void add_common(const tvm_estimator *e, const tv_odometry_state *s, const double *p,
                       double *covariance) {
  const double place = drift_of(e, s->segment), turn = turn_of(e, s->segment);
  const double turn_sq = turn * turn;
  double p_cross[9];
  int i, k;
  add_scale(s->scale_sigma, p, covariance);
  cross_matrix(p, p_cross);
  for (k = 0; k < 3; ++k) {
    covariance[7 * k] += place * place + turn_sq * length_sq(p);
    covariance[7 * (k + 3)] += turn_sq;
    for (i = 0; i < 3; ++i) {
      covariance[6 * i + k] -= turn_sq * p[i] * p[k];
      covariance[6 * i + 3 + k] -= turn_sq * p_cross[3 * i + k];
      covariance[6 * (3 + k) + i] -= turn_sq * p_cross[3 * i + k];
    }
  }
}

/* Velocity and rate by the difference to the last pose; `now` and `last` are the covariances of the
   body's place and turn. Their change since the last difference is what the acceleration may have
   changed within half of the step. By how much the way differs from the vehicle's own stays the
   same from message to message: its variance counts as often as there were messages. */
static void add_velocity(tvm_estimator *e, const tvm_track *track, const double *R, const double *p,
                         const double *now, const double *last_R, const double *last_p,
                         const double *last, tvm_estimate *out) {
  const double dt = (double)(track->host_ns - e->last_ns) * 1e-9;
  double body_from_world[9], last_from_world[9], turn[9], v[3], w[3], rate[3], cross[9], by_turn[9];
  double J[36] = {0}, sum[36], shares[36];
  double change_v = ACCELERATION * ACCELERATION * dt * dt, change_w = change_v, difference = 0;
  int k;
  for (k = 0; k < 3; ++k) v[k] = (p[k] - last_p[k]) / dt;
  transpose(R, body_from_world);
  transpose(last_R, last_from_world);
  multiply(last_from_world, R, turn);
  logarithm(turn, w);
  for (k = 0; k < 3; ++k) out->rate_rad_s[k] = w[k] / dt;
  apply(body_from_world, v, out->velocity_m_s);
  apply(R, out->rate_rad_s, rate);
  if (e->has_velocity) {
    double dv[3], dw[3];
    for (k = 0; k < 3; ++k) {
      dv[k] = v[k] - e->last_velocity[k];
      dw[k] = rate[k] - e->last_rate[k];
    }
    change_v = length_sq(dv);
    change_w = length_sq(dw);
  }
  if (out->has_covariance) {
    for (k = 0; k < 36; ++k) sum[k] = (now[k] + last[k]) / (dt * dt);
    put_block(J, 0, 0, body_from_world, 1);
    put_block(J, 3, 3, body_from_world, 1);
    propagate(J, sum, out->velocity_covariance);
    /* The velocity is turned into the body by an attitude that errs, too. */
    memset(J, 0, sizeof J);
    cross_matrix(out->velocity_m_s, cross);
    multiply(cross, body_from_world, by_turn);
    put_block(J, 0, 3, by_turn, 1);
    propagate(J, now, shares);
    for (k = 0; k < 36; ++k) out->velocity_covariance[k] += shares[k];
    add_scale(track->state->scale_sigma * sqrt(messages_in_memory(e, track)), out->velocity_m_s,
              out->velocity_covariance);
    if (e->compared_s > 0) difference = length_sq(e->compared_gap) / (e->compared_s * dt);
    for (k = 0; k < 3; ++k) {
      out->velocity_covariance[7 * k] += change_v / 4 + difference;
      out->velocity_covariance[7 * (k + 3)] += change_w / 4;
    }
  }
  memcpy(e->last_velocity, v, sizeof v);
  memcpy(e->last_rate, rate, sizeof rate);
  e->has_velocity = 1;
}

/* Whether the way of the pictures contradicts the vehicle's own velocities, or a map on trial has
   not been compared with them for long enough. */
static int is_contradicted(tvm_estimator *e, const tvm_track *track) {
  const tv_odometry_state *s = track->state;
  const double *C = s->cam_from_world_covariance, sigma = track->velocity_sigma_m_s;
  const double dt = (double)(track->host_ns - e->last_ns) * 1e-9;
  const double turn = turn_of(e, s->segment);
  const double share = turn * turn + s->scale_sigma * s->scale_sigma;
  double R[9], p[3], last_R[9], last_p[3], by_vehicle[3], variance, fade;
  int k;
  if (!(sigma > 0)) return 0;
  body_pose(e, s->world_from_cam_R, s->world_from_cam_t, R, p);
  body_pose(e, has_previous(track) ? track->previous_R : e->last_R,
            has_previous(track) ? track->previous_t : e->last_t, last_R, last_p);
  apply(R, track->velocity_m_s, by_vehicle);
  e->compared_s += dt;
  fade = e->compared_s > COMPARED_S ? COMPARED_S / e->compared_s : 1;
  e->compared_s *= fade;
  for (k = 0; k < 3; ++k) {
    e->compared_way[k] = fade * (e->compared_way[k] + p[k] - last_p[k]);
    e->compared_gap[k] = fade * (e->compared_gap[k] + p[k] - last_p[k] - dt * by_vehicle[k]);
  }
  variance = sigma * sigma * e->compared_s * e->compared_s + share * length_sq(e->compared_way);
  if (s->has_covariance) variance += 2 * (C[21] + C[28] + C[35]) / 3;
  if (e->is_on_trial && e->compared_s < TRIAL_S) return 1;
  e->is_on_trial = 0;
  e->refused_s = length_sq(e->compared_gap) > CONTRADICTED * variance ? e->refused_s + dt : 0;
  return e->refused_s > 0 && e->refused_s < MOST_REFUSED_S;
}

/* The way since the last frame, by the map as it is now. */
static void add_way(tvm_estimator *e, const tvm_track *track) {
  const double *from = has_previous(track) ? track->previous_t : e->last_t;
  double step[3];
  int k;
  for (k = 0; k < 3; ++k) step[k] = track->state->world_from_cam_t[k] - from[k];
  e->path_m += sqrt(length_sq(step));
  e->way_m += sqrt(length_sq(step));
}

/* Before the first frame of a stretch without a jump. */
static void begin_stretch(tvm_estimator *e) {
  e->has_velocity = 0;
  e->compared_s = e->refused_s = 0;
  memset(e->compared_way, 0, sizeof e->compared_way);
  memset(e->compared_gap, 0, sizeof e->compared_gap);
}

static void keep_pose(tvm_estimator *e, const tvm_track *track) {
  const tv_odometry_state *s = track->state;
  const double *C = s->cam_from_world_covariance, *t = s->world_from_cam_t;
  e->last_place_sq = 3 * drift_of(e, s->segment) * drift_of(e, s->segment) +
                     s->scale_sigma * s->scale_sigma * length_sq(t) +
                     (s->has_covariance ? C[21] + C[28] + C[35] : LEAST_JUMP_M * LEAST_JUMP_M);
  e->last_turn_sq = 3 * turn_of(e, s->segment) * turn_of(e, s->segment) +
                    (s->has_covariance ? C[0] + C[7] + C[14] : LEAST_JUMP_RAD * LEAST_JUMP_RAD);
  memcpy(e->last_R, s->world_from_cam_R, sizeof e->last_R);
  memcpy(e->last_t, s->world_from_cam_t, sizeof e->last_t);
  memcpy(e->last_covariance, s->cam_from_world_covariance, sizeof e->last_covariance);
  e->has_last_covariance = s->has_covariance;
  e->has_last = 1;
}

/* How often the filter counts `common`, the covariance of what stays. Between two messages it adds
   the velocity's variance times the squared step to its position's, and it averages positions until
   that sum is what it believes of the average; the position is then known to no more than what
   stays if the average is of as many messages as the sum needs to reach that. */
static double messages_averaged(const tvm_estimator *e, const tvm_track *track,
                                const double *common, const double *velocity) {
  const double dt = (double)(track->host_ns - e->last_ns) * 1e-9;
  const double place = fmax(fmax(common[0], common[7]), common[14]);
  const double speed = fmax((velocity[0] + velocity[7] + velocity[14]) / 3,
                            LEAST_VELOCITY_NOISE * LEAST_VELOCITY_NOISE);
  const double times = messages_in_memory(e, track);
  if (e->options.filter_memory_s == 0 || !(e->options.messages & TVM_SEND_ODOMETRY)) return times;
  return fmax(times, place / (speed * dt * dt));
}

/* The estimate of a frame with a pose in metres, upright. */
static void estimate_of(tvm_estimator *e, const tvm_track *track, tvm_estimate *out) {
  const tv_odometry_state *s = track->state;
  const int is_weak = s->status == TV_ODOMETRY_WEAK;
  double R[9], p[3], last_R[9], last_p[3], now[36] = {0}, last[36] = {0};
  double common[36] = {0}, single[36], place_times, turn_times;
  int k, quality;
  body_pose(e, s->world_from_cam_R, s->world_from_cam_t, R, p);
  body_pose(e, has_previous(track) ? track->previous_R : e->last_R,
            has_previous(track) ? track->previous_t : e->last_t, last_R, last_p);
  out->has_covariance = s->has_covariance && e->has_last_covariance;
  if (out->has_covariance) {
    body_covariance(e, s->world_from_cam_R, R, s->cam_from_world_covariance, now);
    body_covariance(e, e->last_R, last_R, e->last_covariance, last);
  }
  add_velocity(e, track, R, p, now, last_R, last_p, last, out);
  add_common(e, s, p, common);
  turn_times = messages_in_memory(e, track);
  place_times = messages_averaged(e, track, common, out->velocity_covariance);
  for (k = 0; k < 36; ++k) {
    const double row = k < 18 ? place_times : turn_times;
    const double column = k % 6 < 3 ? place_times : turn_times;
    single[k] = now[k] + common[k];
    now[k] += sqrt(row * column) * common[k];
  }
  quality = quality_of(single, is_weak);
  if (e->options.world == TVM_WORLD_NED) {
    const double c = cos(track->heading_rad), n = sin(track->heading_rad);
    const double about_z[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
    double J[36] = {0}, turned[36], before[9];
    put_block(J, 0, 0, about_z, 1);
    put_block(J, 3, 3, about_z, 1);
    propagate(J, now, turned);
    memcpy(now, turned, sizeof now);
    memcpy(before, R, sizeof before);
    multiply(about_z, before, R);
    turn_to_north(c, n, p);
  }
  if (out->has_covariance) out->has_covariance = to_euler(R, now, out->pose_covariance);
  if (is_weak) {
    for (k = 0; k < 36; ++k) {
      out->pose_covariance[k] *= e->options.weak_factor * e->options.weak_factor;
      out->velocity_covariance[k] *= e->options.weak_factor * e->options.weak_factor;
    }
  }
  memcpy(out->position_m, p, sizeof p);
  quaternion_of(R, out->world_from_body);
  out->quality = out->has_covariance ? quality : 0;
  out->world = e->options.world;
  out->time_us = track->time_us;
}

/* Reads a track, and its state as far as that goes: it is of the odometry's library, which may be
   an older or a newer one. */
static tvs_status read_track(const tvm_track *given, tvm_track *track, tv_odometry_state *state) {
  size_t size;
  tvs_status status;
  memset(track, 0, sizeof *track);
  status = tvs_read_sized(given, TVS_SIZE_THROUGH(tvm_track, heading_rad), track, sizeof *track);
  if (status != TVS_OK) return status;
  if (!track->state) return TVS_ERR_NULL;
  if (!tvs_is_sized(track->state, TVS_SIZE_THROUGH(tv_odometry_state, reserved_end))) {
    return TVS_ERR_STRUCT_SIZE;
  }
  size = track->state->struct_size < sizeof *state ? track->state->struct_size : sizeof *state;
  memset(state, 0, sizeof *state);
  memcpy(state, track->state, size);
  track->state = state;
  return TVS_OK;
}

tvs_status tvm_estimator_update(tvm_estimator *e, const tvm_track *given, tvm_estimate *out) {
  tvm_silence silence;
  tvm_track own, *track = &own;
  tvm_estimate made, *estimate = &made;
  tv_odometry_state state;
  tvs_status status;
  if (!e || !given || !out) return TVS_ERR_NULL;
  status = read_track(given, track, &state);
  if (status != TVS_OK) return status;
  if (!tvs_is_sized(out, TVS_SIZE_THROUGH(tvm_estimate, velocity_covariance))) {
    return TVS_ERR_STRUCT_SIZE;
  }
  if (track->host_ns <= e->last_ns) return TVS_ERR_ARGUMENT;
  memset(estimate, 0, sizeof *estimate);
  count_doubt(e, track);
  if (track->state->has_pose) count_resets(e, track);
  silence = silence_of(e, track);
  if (silence == TVM_SILENCE_NONE || silence == TVM_SILENCE_WEAK) {
    if (e->has_last && track->host_ns - e->last_ns > MOST_STEP_NS) e->has_last = 0;
    if (!e->has_last) begin_stretch(e);
    if (e->has_last) {
      add_way(e, track);
      if (is_contradicted(e, track) && silence == TVM_SILENCE_NONE) silence = TVM_SILENCE_MOTION;
    } else if (silence == TVM_SILENCE_NONE) {
      silence = TVM_SILENCE_VELOCITY;
    }
    if (silence == TVM_SILENCE_NONE) estimate_of(e, track, estimate);
    keep_pose(e, track);
  } else {
    e->has_last = e->has_velocity = 0;
  }
  e->last_ns = track->host_ns;
  estimate->silence = silence;
  estimate->reset_counter = e->reset_counter;
  tvs_write_sized(estimate, sizeof *estimate, out, out->struct_size);
  return TVS_OK;
}
