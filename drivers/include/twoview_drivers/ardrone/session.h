/* AR.Drone 2.0: a session. It turns what a transport receives into pictures, attitudes and events,
   and sends the commands.

   The caller owns the memory and the clock: get the size, hand the memory over, then call
   ardrone_session_step whenever a descriptor is readable and at least every 10 ms, with nanoseconds
   of one monotonic clock. A session starts no thread, uses no heap and does not block. sockets.h
   has a loop that does these calls.

   The session wakes the drone, ends its bootstrap, sets what the options require, reconnects each
   channel by itself, and keeps the link alive. It sends a flight command only when the caller
   requests one (ardrone/pilot.h). When the steps stop, the commands stop, and the drone's watchdog
   lands it. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_SESSION_H
#define TWOVIEW_DRIVERS_ARDRONE_SESSION_H

#include "twoview_drivers/ardrone/config.h"
#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pave.h"
#include "twoview_drivers/ardrone/pilot.h"
#include "twoview_drivers/ardrone/transport.h"
#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* A session lies in the caller's memory: ardrone_session_size, ardrone_session_init. Private. */
typedef struct ardrone_session ardrone_session;

/* The events that on_event reports. */
typedef enum ardrone_event {
  /* Navdata comes, and the drone is set up. */
  ARDRONE_EVENT_LINK_UP,
  /* No navdata came for 2 s, or the drone started again. It is also reported for a link that was
     not yet up. */
  ARDRONE_EVENT_LINK_LOST,
  /* The drone started again: its sequence numbers, times, attitudes and world frame begin again. */
  ARDRONE_EVENT_REBOOT,
  /* The first bytes of a video connection have come. */
  ARDRONE_EVENT_VIDEO_OPEN,
  /* The video connection closed, broke or was silent; it is being opened again. */
  ARDRONE_EVENT_VIDEO_CLOSED,
  /* The drone acknowledged the setting of `key`. */
  ARDRONE_EVENT_SET_DONE,
  /* The drone did not acknowledge the setting of `key` in time. */
  ARDRONE_EVENT_SET_FAILED,
  /* ardrone_session_text holds the configuration. */
  ARDRONE_EVENT_CONFIG,
  /* ardrone_session_text holds the id list. */
  ARDRONE_EVENT_IDS,
  /* The configuration, or the id list, did not come in time. */
  ARDRONE_EVENT_READ_FAILED
} ardrone_event;

/* The options of a session. ardrone_session_options_init fills them. */
typedef struct ardrone_session_options {
  /* The size of this struct, which ardrone_session_options_init sets. */
  uint32_t struct_size;
  /* Which options navdata is to hold: bits 1 << ardrone_tag. Default: DEMO, TIME, PHYS_MEASURES,
     ALTITUDE, PRESSURE, VISION_DETECT. 0: the drone's own choice. */
  uint32_t navdata_options;
  /* 1 (default): navdata at 200 Hz; 0: at 15 Hz. */
  int full_navdata;
  /* 1 (default): the session opens the live stream. */
  int video;
  /* 1: the session opens the recording stream, too; default 0. */
  int recording;
  /* The ardrone_video_codec that is set; 0 (default): the drone keeps its codec. */
  int video_codec;
  /* 1 (default): where several whole packets wait, begin with the last one that can be decoded by
     itself (ardrone_pave_skip_to_latest), which keeps the latency low. 0: take every packet, as a
     recorder does. */
  int skip_to_latest;
  /* 1: set each key for session, profile and application ids that are made from `name` (the drone's
     multi-configuration). A video_codec implies it. */
  int use_ids;
  /* 1: send nothing but the wake-up, as a replay needs. Default 0. */
  int listen_only;
  /* How many pictures may wait for the frame source, 0 to 4 (default). When there are more, the
     oldest is dropped. */
  int queue_frames;
  /* The name that ids are made from, up to 64 bytes; default "twoview". The text outlives the
     session. */
  const char *name;
  /* Decodes the pictures. Null (default): the session reports packets and makes no pictures. It
     outlives the session. */
  const tvs_decoder *decoder;
  /* The largest time between the two neighbours that an attitude is interpolated from (attitude.h),
     ns; default 150 ms. */
  int64_t max_gap_ns;
  /* The first argument of the functions below. Each of them may be null. They are called from
     within ardrone_session_step; what they point to is valid during the call. Of the session's
     functions they may call only those that take a const ardrone_session. */
  void *user;
  /* Reports an event; key is that of a SET_ event, else null. */
  void (*on_event)(void *user, ardrone_event event, const char *key);
  /* Reports every accepted navdata packet; imu->valid may be 0. */
  void (*on_navdata)(void *user, const uint8_t *bytes, size_t size, const ardrone_navdata *navdata,
                     const tvs_imu *imu);
  /* Reports every packet of the live stream that skip_to_latest did not drop; gate has
     ARDRONE_PAVE_ bits (ardrone_pave_gate_check). */
  void (*on_packet)(void *user, const ardrone_pave_packet *packet, const tvs_time *time, int gate);
  /* Reports every packet of the recording stream and the host time at which it came. */
  void (*on_recording)(void *user, const ardrone_pave_packet *packet, int64_t received_ns);
  /* Reports every picture before it enters the queue. */
  void (*on_frame)(void *user, const tvs_frame *frame);
} ardrone_session_options;

/* Writes the defaults into a struct of struct_size bytes; null is allowed. */
TV_API void ardrone_session_options_init_sized(ardrone_session_options *options,
                                               size_t struct_size);
/* Writes the defaults; null is allowed. */
#define ardrone_session_options_init(options) \
  ardrone_session_options_init_sized((options), sizeof *(options))

/* Writes to *size_bytes what a session with these options needs: about 1.2 MB, of which 1 MB is one
   whole video packet (none of it without `video`); 1 MB more with `recording`. Returns
   TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE, TVS_ERR_ARGUMENT. */
TV_API tvs_status ardrone_session_size(const ardrone_session_options *options, size_t *size_bytes);

/* Makes a session in `memory`, the caller's, aligned as malloc's and at least ardrone_session_size
   bytes. The transport is the caller's and outlives the session. Nothing is sent before the first
   step. Statuses as ardrone_session_size; also TVS_ERR_CAPACITY: size_bytes is too small. *session
   is written on TVS_OK only. */
TV_API tvs_status ardrone_session_init(ardrone_session **session,
                                       const ardrone_session_options *options,
                                       const ardrone_transport *transport, void *memory,
                                       size_t size_bytes);

/* Closes all channels and releases the frames in the queue. Release the frames that you hold
   before. It does not land the drone: call ardrone_session_land and go on stepping until the drone
   has landed; else its watchdog lands it. */
TV_API void ardrone_session_close(ardrone_session *session);

/* Receives, decodes and sends; one call takes at most 64 datagrams of navdata and stops receiving a
   video stream after 4 MB. now_ns is at least that of the call before. Returns TVS_ERR_NULL,
   TVS_ERR_ARGUMENT (now_ns is smaller than before). A failure of the link is an event, not a
   status. */
TV_API tvs_status ardrone_session_step(ardrone_session *session, int64_t now_ns);

/* When the next step is due even if nothing arrives, ns of the caller's clock: at most 10 ms after
   the last step. */
TV_API int64_t ardrone_session_next_ns(const ardrone_session *session);

/* 1 from ARDRONE_EVENT_LINK_UP until ARDRONE_EVENT_LINK_LOST, else 0. */
TV_API int ardrone_session_is_up(const ardrone_session *session);

/* The latest navdata packet, valid until the next step; null when there is no link or the packet is
   more than 500 ms older than the last step. */
TV_API const ardrone_navdata *ardrone_session_navdata(const ardrone_session *session);

/* The text of the last ARDRONE_EVENT_CONFIG or ARDRONE_EVENT_IDS: *size bytes at *text, which
   belong to the session and are valid until the next step. TVS_NONE: there is none yet, or another
   read has begun since. */
TV_API tvs_status ardrone_session_text(const ardrone_session *session, const char **text,
                                       size_t *size);

/* The attitude at a frame's time, interpolated between two measured ones. TVS_NONE: they are not,
   or not yet, known. A frame whose attitude was known on arrival carries it already. */
TV_API tvs_status ardrone_session_attitude_at(const ardrone_session *session, const tvs_time *time,
                                              tvs_attitude *attitude);

/* Counts of what was received, sent and lost since ardrone_session_init. */
typedef struct ardrone_counters {
  /* Navdata packets that came, and how many of them are malformed or have a wrong checksum. */
  uint64_t navdata_received, navdata_rejected;
  /* Navdata packets that came twice or were overtaken, and those missing by the sequence
     numbers. */
  uint64_t navdata_late, navdata_missing;
  /* Packets of the live video, and how many of them were left out, by ardrone_pave_gate_check or by
     skip_to_latest. */
  uint64_t packets, packets_skipped;
  /* Pictures that were decoded, that did not decode, and that were dropped since the queue was
     full. */
  uint64_t frames_decoded, frames_failed, frames_dropped;
  /* Places in the live video where packets are missing, and bytes that belonged to no packet. */
  uint64_t gaps, bytes_skipped;
  /* Datagrams sent; how often a link, a reboot and a video connection came about. */
  uint64_t commands_sent, links, reboots, video_connections;
} ardrone_counters;

/* Copies the session's counters to *counters. */
TV_API void ardrone_session_counters(const ardrone_session *session, ardrone_counters *counters);

/* Fills a frame source of source.h, which the steps supply. The caller may hold as many frames as
   the decoder allows. Returns TVS_ERR_NULL; TVS_ERR_STATE: the options have no decoder. */
TV_API tvs_status ardrone_session_frames_sized(ardrone_session *session, tvs_frame_source *source,
                                               size_t source_size);
/* ardrone_session_frames_sized with the size of the caller's struct. */
#define ardrone_session_frames(session, source) \
  ardrone_session_frames_sized((session), (source), sizeof *(source))

/* Fills an IMU source of source.h, which the steps supply. It queues 64 samples; when there are
   more, the oldest is dropped. Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_session_imu_sized(ardrone_session *session, tvs_imu_source *source,
                                            size_t source_size);
/* ardrone_session_imu_sized with the size of the caller's struct. */
#define ardrone_session_imu(session, source) \
  ardrone_session_imu_sized((session), (source), sizeof *(source))

/* This function and the next six call the pilot's function of the same name with the last step's
   time. Statuses as ardrone_pilot_take_off; also TVS_ERR_STATE when the link is not up
   (ardrone_session_is_up) or its latest navdata is more than 500 ms old. */
TV_API tvs_status ardrone_session_take_off(ardrone_session *session);
/* Calls ardrone_pilot_land. Statuses as ardrone_pilot_land. */
TV_API tvs_status ardrone_session_land(ardrone_session *session);
/* Calls ardrone_pilot_hover. Statuses as ardrone_pilot_hover. */
TV_API tvs_status ardrone_session_hover(ardrone_session *session);
/* Calls ardrone_pilot_move with the last step's time. Statuses as ardrone_pilot_move. */
TV_API tvs_status ardrone_session_move(ardrone_session *session, const ardrone_move *move);
/* Calls ardrone_pilot_cut_motors: the drone falls. Statuses as ardrone_pilot_cut_motors. */
TV_API tvs_status ardrone_session_cut_motors(ardrone_session *session);
/* Calls ardrone_pilot_rearm with the last step's time. Statuses as ardrone_pilot_rearm. */
TV_API tvs_status ardrone_session_rearm(ardrone_session *session);
/* Calls ardrone_pilot_flat_trim. Statuses as ardrone_pilot_flat_trim. */
TV_API tvs_status ardrone_session_flat_trim(ardrone_session *session);

/* Queues an exchange of ardrone/config.h that sets key to value; both are copied. The answer is
   ARDRONE_EVENT_SET_DONE or ARDRONE_EVENT_SET_FAILED. With the option use_ids the key is set under
   the session's ids. At most 16 exchanges wait. Returns TVS_ERR_NULL; TVS_ERR_ARGUMENT:
   ardrone_config_check refuses the value, or the key needs ids and use_ids is 0; TVS_ERR_CAPACITY:
   the queue is full. */
TV_API tvs_status ardrone_session_set(ardrone_session *session, const char *key, const char *value);
/* Queues an exchange that reads the configuration; ARDRONE_EVENT_CONFIG reports the text. Returns
   TVS_ERR_NULL; TVS_ERR_CAPACITY: the queue is full. */
TV_API tvs_status ardrone_session_read_config(ardrone_session *session);
/* Queues an exchange that reads the lists of ids; ARDRONE_EVENT_IDS reports the text. Returns
   TVS_ERR_NULL; TVS_ERR_CAPACITY: the queue is full. */
TV_API tvs_status ardrone_session_read_ids(ardrone_session *session);

/* Queues gps:latitude, gps:longitude and gps:altitude, the controller's place in degrees and
   metres; all three are queued or none. Statuses as ardrone_session_set. */
TV_API tvs_status ardrone_session_set_gps(ardrone_session *session, double latitude_deg,
                                          double longitude_deg, double altitude_m);

TV_END_DECLS

#endif
