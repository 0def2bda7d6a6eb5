/* AR.Drone 2.0: a session: everything between a transport and the pictures, attitudes and commands.

   The caller owns the memory and the clock: ask for the size, hand the memory over, then call
   ardrone_session_step often (when a descriptor is readable, and at least every 10 ms), with nanoseconds of one
   monotonic clock. No thread, no heap, no blocking. sockets.h has a loop for those who want none of
   their own.

   The session wakes the drone, ends its bootstrap, sets what the options ask for, reconnects each
   channel by itself, and keeps the link alive. It sends no flight command that was not asked for
   (ardrone/pilot.h). When steps stop, so do commands, and the drone's watchdog lands it. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_SESSION_H
#define TWOVIEW_DRIVERS_ARDRONE_SESSION_H

#include "twoview_drivers/ardrone/config.h"
#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pave.h"
#include "twoview_drivers/ardrone/pilot.h"
#include "twoview_drivers/ardrone/transport.h"
#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* In the caller's memory: ardrone_session_size, ardrone_session_init. */
typedef struct ardrone_session ardrone_session;

/* What happens, told by on_event. */
typedef enum ardrone_event {
  ARDRONE_EVENT_LINK_UP,      /* navdata flows, and the drone is set up */
  ARDRONE_EVENT_LINK_LOST,    /* 2 s without navdata, or a reboot; of a link that was not up yet, too */
  ARDRONE_EVENT_REBOOT,       /* the drone counts anew: times and attitudes begin anew, too */
  ARDRONE_EVENT_VIDEO_OPEN,   /* the first bytes of a connection */
  ARDRONE_EVENT_VIDEO_CLOSED, /* closed, broken or silent; it is being opened again */
  ARDRONE_EVENT_SET_DONE,     /* a key was set: `key` says which */
  ARDRONE_EVENT_SET_FAILED,   /* no acknowledgement in time */
  ARDRONE_EVENT_CONFIG,       /* ardrone_session_text holds the configuration */
  ARDRONE_EVENT_IDS,          /* ardrone_session_text holds the id list */
  ARDRONE_EVENT_READ_FAILED   /* neither came in time */
} ardrone_event;

/* What a session does. Filled by ardrone_session_options_init. */
typedef struct ardrone_session_options {
  uint32_t struct_size; /* set by ardrone_session_options_init */
  uint32_t navdata_options; /* bits 1 << ardrone_tag; default: DEMO, TIME, PHYS_MEASURES, ALTITUDE, PRESSURE, VISION_DETECT.
                               0: the drone's own choice */
  int full_navdata;    /* 1 (default): 200 Hz; 0: 15 Hz */
  int video;           /* 1 (default): open the live stream */
  int recording;       /* 1: open the recording stream too; default 0 */
  int video_codec;     /* an ardrone_video_codec; 0 (default): leave as it is */
  int skip_to_latest;  /* 1 (default): the rule against latency; 0 for a recorder, which wants every packet */
  int use_ids;         /* 1: multi-configuration under the name below; implied by video_codec */
  int listen_only;     /* 1: send nothing but the wake-up: for a replay. Default 0 */
  int queue_frames;    /* pictures that wait for the frame source, 0 to 4 (default); then the oldest goes */
  const char *name;    /* up to 64 bytes, ids are made of it; default "twoview". Outlives the session */
  const tvs_decoder *decoder; /* null (default): packets only, no pictures. Outlives the session */
  int64_t max_gap_ns;  /* between an attitude's neighbours (attitude.h), default 150 ms */
  /* What comes, as it comes; each may be null. Pointers are valid during the call, from within a
     step. No function of the session but the queries may be called from here. */
  void *user; /* their first argument */
  void (*on_event)(void *user, ardrone_event event, const char *key); /* key: of a SET_ event, else null */
  void (*on_navdata)(void *user, const uint8_t *bytes, size_t size, const ardrone_navdata *navdata,
                     const tvs_imu *imu); /* accepted packets; imu->valid may be 0 */
  void (*on_packet)(void *user, const ardrone_pave_packet *packet, const tvs_time *time,
                    int gate); /* every live packet, ARDRONE_PAVE_ bits of the gate */
  void (*on_recording)(void *user, const ardrone_pave_packet *packet,
                       int64_t received_ns); /* every packet of the recording stream */
  void (*on_frame)(void *user, const tvs_frame *frame); /* every picture, before the queue */
} ardrone_session_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void ardrone_session_options_init(ardrone_session_options *options);

/* Writes to *size_bytes what a session with these options needs: about 1.4 MB, of which 1 MB is one whole
   video packet; 1 MB more with `recording`. Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE, TVS_ERR_ARGUMENT. */
TV_API tvs_status ardrone_session_size(const ardrone_session_options *options, size_t *size_bytes);

/* Makes a session in `memory`, the caller's, aligned as malloc's and at least ardrone_session_size bytes. The
   transport is the caller's and outlives the session. Nothing is sent before the first step.
   Returns also TVS_ERR_CAPACITY; *session is written on TVS_OK only. */
TV_API tvs_status ardrone_session_init(ardrone_session **session,
                                       const ardrone_session_options *options,
                                       const ardrone_transport *transport, void *memory,
                                       size_t size_bytes);

/* Closes all channels and gives frames in the queue back; frames the caller holds are released first. Lands
   nobody: a flying drone lands by its watchdog, or by ardrone_session_land some steps before. */
TV_API void ardrone_session_close(ardrone_session *session);

/* Receives, decodes, sends. Bounded: at most 64 datagrams and 4 MB of video at once. now_ns never falls.
   Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (now_ns fell); what fails on the link is an event. */
TV_API tvs_status ardrone_session_step(ardrone_session *session, int64_t now_ns);

/* When the next step is due by the clock, whatever arrives. */
TV_API int64_t ardrone_session_next_ns(const ardrone_session *session);

/* 1 while the link is up: ARDRONE_EVENT_LINK_UP, and no LINK_LOST since. */
TV_API int ardrone_session_is_up(const ardrone_session *session);
/* The latest packet, at most 500 ms old by the last step's clock; else null. Until the next step. */
TV_API const ardrone_navdata *ardrone_session_navdata(const ardrone_session *session);
/* The text of the last ARDRONE_EVENT_CONFIG or _IDS: *size bytes at *text, the session's, until the next step.
   TVS_NONE: none yet. */
TV_API tvs_status ardrone_session_text(const ardrone_session *session, const char **text,
                                       size_t *size);
/* The attitude at a frame's time, once both neighbours are known; TVS_NONE: unknown (yet). The frame
   carries it already when it was known on arrival. */
TV_API tvs_status ardrone_session_attitude_at(const ardrone_session *session,
                                              const tvs_time *time, tvs_attitude *attitude);

/* What came, went and was lost since ardrone_session_init. */
typedef struct ardrone_counters {
  uint64_t navdata_received, navdata_rejected; /* malformed, wrong checksum */
  uint64_t navdata_late, navdata_missing;      /* doubled or overtaken; by the sequence numbers */
  uint64_t packets, packets_skipped;           /* live video; left out by the gate or the latency rule */
  uint64_t frames_decoded, frames_failed, frames_dropped; /* dropped: the queue was full */
  uint64_t gaps, bytes_skipped;  /* of the live video: places where packets are missing; bytes of no packet */
  uint64_t commands_sent, links, reboots, video_connections; /* datagrams; how often each came about */
} ardrone_counters;

/* Copies the counters. */
TV_API void ardrone_session_counters(const ardrone_session *session, ardrone_counters *counters);

/* Fills a frame source of source.h, fed by the steps. Frames that were taken may be held as long as the decoder
   allows. Returns TVS_ERR_NULL; TVS_ERR_STATE: the options have no decoder. */
TV_API tvs_status ardrone_session_frames(ardrone_session *session, tvs_frame_source *source);
/* Fills an IMU source of source.h, fed by the steps; it queues 64 samples and drops the oldest.
   Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_session_imu(ardrone_session *session, tvs_imu_source *source);

/* Wishes go to the pilot, at the last step's time. Statuses as ardrone_pilot_take_off; TVS_ERR_STATE without a
   link, too. */
TV_API tvs_status ardrone_session_take_off(ardrone_session *session);
/* Statuses as ardrone_pilot_land. */
TV_API tvs_status ardrone_session_land(ardrone_session *session);
/* Statuses as ardrone_pilot_hover. */
TV_API tvs_status ardrone_session_hover(ardrone_session *session);
/* Statuses as ardrone_pilot_move. */
TV_API tvs_status ardrone_session_move(ardrone_session *session, const ardrone_move *move);
/* The drone falls. Statuses as ardrone_pilot_cut_motors. */
TV_API tvs_status ardrone_session_cut_motors(ardrone_session *session);
/* Statuses as ardrone_pilot_rearm. */
TV_API tvs_status ardrone_session_rearm(ardrone_session *session);
/* Statuses as ardrone_pilot_flat_trim. */
TV_API tvs_status ardrone_session_flat_trim(ardrone_session *session);

/* Queues (up to 16) an exchange of ardrone/config.h that sets key to value, copied: the answer is an event. Under
   ids when the session has them. TVS_ERR_NULL; TVS_ERR_ARGUMENT: ardrone_config_check says no, or the key needs
   ids; TVS_ERR_CAPACITY: the queue is full. */
TV_API tvs_status ardrone_session_set(ardrone_session *session, const char *key, const char *value);
/* Queues reading the configuration: ARDRONE_EVENT_CONFIG. TVS_ERR_NULL, TVS_ERR_CAPACITY. */
TV_API tvs_status ardrone_session_read_config(ardrone_session *session);
/* Queues reading the lists of ids: ARDRONE_EVENT_IDS. TVS_ERR_NULL, TVS_ERR_CAPACITY. */
TV_API tvs_status ardrone_session_read_ids(ardrone_session *session);
/* Queues gps:latitude, longitude, altitude: where the controller is; degrees and metres. All three or none.
   Statuses as ardrone_session_set. */
TV_API tvs_status ardrone_session_set_gps(ardrone_session *session, double latitude_deg,
                                          double longitude_deg, double altitude_m);

TV_END_DECLS

#endif
