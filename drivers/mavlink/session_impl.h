/* What the parts of a session share. session.c: life, step, queries, frames. packets.c: bytes to
   messages, sequence numbers, what is sent. samples.c: messages to samples, and the vehicle's
   clock. send_track.c: estimates of visual odometry as packets. */
#ifndef TVM_SESSION_IMPL_H
#define TVM_SESSION_IMPL_H

#include <mavlink.h>

#include "twoview_drivers/attitude.h"
#include "twoview_drivers/clock.h"
#include "twoview_drivers/mavlink/session.h"

#define MS INT64_C(1000000)
#define SECOND INT64_C(1000000000)

enum { QUEUE_IMU = 64, QUEUE_PENDING = 32, QUEUE_FRAMES = 8, NUM_WANTED = 4, NUM_SENT_TIMES = 4 };

/* The two latest values of a quantity at times of the vehicle's clock. */
typedef struct track {
  int num;
  int64_t device_ns[2], received_ns;
  double value[2][3];
} track;

/* Where heights come from, the better ones first. A run of the clock keeps to one of them, since
   two of them differ by a constant that nobody measured. */
typedef enum height_kind {
  HEIGHT_RANGE,     /* DISTANCE_SENSOR that looks down */
  HEIGHT_CLEARANCE, /* ALTITUDE.bottom_clearance */
  HEIGHT_LOCAL,     /* LOCAL_POSITION_NED.z, above the origin */
  HEIGHT_RELATIVE,  /* ALTITUDE.altitude_relative, above home */
  NUM_HEIGHTS
} height_kind;

/* A message whose rate is requested. */
typedef struct wanted {
  uint32_t id;
  double hz;
  int is_needed, num_tries, num_seen;
} wanted;

struct tvm_session {
  tvm_session_options options;
  tvm_transport transport;
  int64_t now_ns;
  tvm_counters counters;
  uint64_t num_invalid; /* readings */

  /* packets */
  mavlink_message_t parsed;
  mavlink_status_t parser, sender;
  uint8_t next_sequence[256], num_late[256], has_sequence[256]; /* by component */
  int vehicle, component;                                       /* 0: no autopilot was heard yet */
  tvm_autopilot autopilot;
  tvm_link link;
  int64_t heard_ns, attitude_heard_ns;

  /* what is sent */
  wanted requests[NUM_WANTED];
  int64_t heartbeat_due_ns, timesync_due_ns, requests_due_ns;
  int64_t sent_ns[NUM_SENT_TIMES];
  int idx_sent;
  int sends_estimates; /* the autopilot's TIMESYNC is answered */

  /* the vehicle's clock */
  tvs_clock clock;
  uint32_t clock_id; /* of the run that the fields below belong to; 0: none */
  int64_t newest_device_ns;
  int num_suspects;
  int64_t suspect_stamp_ns, suspect_received_ns;
  int has_lower;
  int64_t lower_ns, lower_received_ns; /* host minus device is at least lower_ns, by TIMESYNC */

  /* attitudes and samples */
  tvs_attitudes attitudes;
  double yaw0_rad;
  int64_t first_device_ns;
  track velocity, heights[NUM_HEIGHTS];
  int height;   /* the height_kind that this run uses; NUM_HEIGHTS: not chosen yet */
  int range_id; /* of the DISTANCE_SENSOR that this run uses; -1: none was heard yet */
  struct pending {
    tvs_imu sample;
    double ned_from_body[4];
  } pending[QUEUE_PENDING];
  int first_pending, num_pending;
  int64_t emitted_device_ns; /* of the latest sample that was handed over in this run */
  tvs_imu imu[QUEUE_IMU];
  int first_imu, num_imu;

  /* frames */
  tvs_frame_source camera;
  tvs_frame held[QUEUE_FRAMES];
  int first_held, num_held;
};

/* packets.c */
void tvm_receive(tvm_session *session, const uint8_t *bytes, size_t size);
/* The system id to send with. */
uint8_t tvm_own_system(const tvm_session *session);
/* Sends a message; returns 1 if the transport took it. */
int tvm_send_message(tvm_session *session, const mavlink_message_t *message);
void tvm_send_due(tvm_session *session);

/* samples.c */
void tvm_take_message(tvm_session *session, const mavlink_message_t *message);
void tvm_take_timesync(tvm_session *session, int64_t vehicle_ns, int64_t sent_ns);
void tvm_drain(tvm_session *session);
/* Whether the run of the clock is that of the attitudes. After a restart an ATTITUDE begins it. */
int tvm_has_clock(const tvm_session *session);
/* Host time minus device time, and the largest error of that. Needs a run of the clock. */
int64_t tvm_shift(const tvm_session *session, int64_t *uncertainty_ns);

#endif
