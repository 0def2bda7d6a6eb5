/* What the parts of a session share. session.c: life, step, queries; it calls session_link.c:
   navdata, link, commands, which calls session_exchange.c: set-up and the queue of exchanges, and
   session_video.c: streams, pictures. All report through session_event.c. */
#ifndef ARDRONE_SESSION_IMPL_H
#define ARDRONE_SESSION_IMPL_H

#include "twoview_drivers/ardrone/session.h"
#include "twoview_drivers/attitude.h"
#include "twoview_drivers/clock.h"

#define MS INT64_C(1000000)

enum {
  QUEUE_FRAMES = 4,
  QUEUE_IMU = 64,
  QUEUE_REQUESTS = 16,
  MAX_SETUP = 8,
  MAX_NAME_BYTES = 64,
  TEXT_BYTES = 65536
};

typedef struct request {
  ardrone_exchange_kind kind;
  char key[ARDRONE_KEY_BYTES], value[ARDRONE_VALUE_BYTES];
} request;

/* One TCP stream of PaVE packets. When a stream closes or is silent, it alone is opened again. */
typedef struct stream {
  ardrone_channel channel;
  int is_open, has_bytes, num_connections;
  int64_t retry_ns, heard_ns;
  ardrone_pave_parser parser;
} stream;

struct ardrone_session {
  ardrone_session_options options;
  ardrone_transport transport;
  tvs_decoder decoder;
  int64_t now_ns;
  ardrone_counters counters;
  char ids[3][ARDRONE_ID_BYTES]; /* ids of session, user and application */

  /* link to the drone */
  int is_open, has_link, is_up;
  int64_t open_retry_ns, wake_ns, heard_ns;
  ardrone_sequence sequence;
  uint32_t last_number; /* of navdata; kept through a silence, so that a reboot is recognised */
  int was_heard;
  ardrone_navdata navdata;
  ardrone_pilot pilot;

  /* exchanges: first those of the set-up, then those that the caller requested */
  ardrone_exchange exchange;
  request setup[MAX_SETUP];
  int num_setup, idx_setup;
  request requests[QUEUE_REQUESTS];
  int first_request, num_requests;
  int runs_setup, runs_request;
  char text[TEXT_BYTES];
  size_t text_size;
  int has_text;

  /* clocks, attitudes and IMU samples */
  tvs_clock navdata_clock, video_clock; /* navdata has odd clock ids, video even ones */
  tvs_attitudes attitudes;
  int has_psi0;
  uint32_t psi0_clock_id;
  double psi0_rad;
  tvs_imu imu[QUEUE_IMU];
  int first_imu, num_imu;

  /* video streams and decoded pictures */
  stream video, recording;
  ardrone_pave_gate gate;
  int gap, new_stream; /* whether the next picture gets TVS_FRAME_GAP and TVS_FRAME_NEW_STREAM */
  tvs_frame frames[QUEUE_FRAMES];
  int first_frame, num_frames;
};

void ardrone_link_open(ardrone_session *session);
void ardrone_link_receive(ardrone_session *session);
void ardrone_link_supervise(ardrone_session *session);
void ardrone_link_send(ardrone_session *session);

void ardrone_exchanges_new_link(ardrone_session *session);
void ardrone_exchanges_receive(ardrone_session *session);
void ardrone_exchanges_advance(ardrone_session *session);

void ardrone_video_step(ardrone_session *session);
void ardrone_video_reboot(ardrone_session *session);
void ardrone_video_close(ardrone_session *session);

void ardrone_tell(ardrone_session *session, ardrone_event event, const char *key);

#endif
