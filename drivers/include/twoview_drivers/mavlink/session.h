/* twoview drivers: a vehicle that speaks MAVLink, such as one with PX4 or ArduPilot.

   The session reads ATTITUDE, LOCAL_POSITION_NED, ALTITUDE and DISTANCE_SENSOR and gives them as
   samples of source.h; with a camera of your own it gives frames with their attitudes. It sends
   HEARTBEAT as an onboard computer, TIMESYNC, and requests for the rates of these messages; with
   mavlink/estimate.h also what visual odometry knows of the pose. It has no function that arms,
   steers or moves the vehicle, and never sends a message that does.

   Frames and signs: docs/mavlink.md derives them. MAVLink's library packs and parses the packets;
   this header does not include it. */
#ifndef TWOVIEW_DRIVERS_MAVLINK_SESSION_H
#define TWOVIEW_DRIVERS_MAVLINK_SESSION_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* How bytes come and go. udp.h fills it for UDP; a test or a recording fills it in its own way. */
typedef struct tvm_transport {
  /* sizeof(tvm_transport), which whoever fills the struct sets. */
  uint32_t struct_size;
  /* The first argument of the functions below. */
  void *user;
  /* Sends one packet. TVS_NONE: it cannot be sent now, for example while no address of the vehicle
     is known. The session sends it again when it is due again. */
  tvs_status (*send)(void *user, const void *bytes, size_t size);
  /* Gets the next datagram or piece of a stream, and never waits. TVS_OK: *size bytes of at most
     `capacity`; TVS_NONE: nothing has come; TVS_END: nothing will come any more. */
  tvs_status (*receive)(void *user, void *bytes, size_t capacity, size_t *size);
  /* Tells that the latest datagram came from the vehicle, so that `send` goes to its sender. May be
     null. */
  void (*keep_sender)(void *user);
  /* A file descriptor that is readable when bytes have come, or -1. May be null. */
  int (*descriptor)(void *user);
} tvm_transport;

/* The kinds of autopilot, which HEARTBEAT names. */
typedef enum tvm_autopilot {
  /* No autopilot was heard yet. */
  TVM_AUTOPILOT_UNKNOWN = 0,
  /* ArduPilot. */
  TVM_AUTOPILOT_ARDUPILOT = 1,
  /* PX4. */
  TVM_AUTOPILOT_PX4 = 2,
  /* Another autopilot. */
  TVM_AUTOPILOT_OTHER = 3
} tvm_autopilot;

/* What is known of the link. */
typedef enum tvm_link {
  /* No HEARTBEAT of an autopilot has come since the session began. */
  TVM_LINK_WAITING = 0,
  /* The autopilot is heard, and no ATTITUDE came within the last second. */
  TVM_LINK_NO_ATTITUDE = 1,
  /* Attitudes come. */
  TVM_LINK_UP = 2,
  /* The autopilot was heard before; nothing came from it within the last 3 s. */
  TVM_LINK_SILENT = 3
} tvm_link;

/* What on_event reports. */
typedef enum tvm_event {
  /* The state of tvm_session_link changed. */
  TVM_EVENT_LINK = 0,
  /* The vehicle's clock began again: times, attitudes and the world frame start again. */
  TVM_EVENT_REBOOT = 1
} tvm_event;

/* What a session counts since its beginning. */
typedef struct tvm_counters {
  /* Packets of the vehicle with a correct checksum. */
  uint64_t received;
  /* Packets of the vehicle that never came, by the gaps in its sequence numbers. */
  uint64_t lost;
  /* Packets that came twice in succession; the second one is dropped. */
  uint64_t repeated;
  /* Packets that came after a later one, and stamps that lie outside the run of the vehicle's
     clock. */
  uint64_t late;
  /* Packets whose checksum is wrong. */
  uint64_t corrupted;
  /* Packets of a message that this build's MAVLink library does not know. */
  uint64_t unknown;
  /* Packets of other systems. */
  uint64_t others;
  /* Attitudes that were used. */
  uint64_t attitudes;
  /* Answers to TIMESYNC that were used. */
  uint64_t timesyncs;
  /* Times that the vehicle fell silent. */
  uint64_t silences;
  /* Times that the vehicle's clock began again. */
  uint64_t reboots;
} tvm_counters;

/* Filled by tvm_session_options_init. Times are in ns of the clock that the caller steps with. */
typedef struct tvm_session_options {
  /* sizeof(tvm_session_options), set by tvm_session_options_init. */
  uint32_t struct_size;
  /* 1: sends nothing, for a recording. Default 0. */
  int32_t listen_only;
  /* The system id of the vehicle, 1 to 255; 0 (default): that of the first autopilot heard. */
  int32_t vehicle_system;
  /* The system id to send with; 0 (default): the vehicle's, as MAVLink requires of an onboard
     computer. */
  int32_t own_system;
  /* The component id to send with. Default 191, MAV_COMP_ID_ONBOARD_COMPUTER. */
  int32_t own_component;
  /* A reserved field that is 0. */
  int32_t reserved;
  /* Requested rates in Hz, in (0, 1000]. Defaults: ATTITUDE 50, LOCAL_POSITION_NED 30, ALTITUDE and
     DISTANCE_SENSOR 10. */
  double attitude_hz, position_hz, height_hz;
  /* Standard deviations that the samples state, since these messages have none. Defaults: 0.0175
     rad (1 degree) of the attitude, 0.15 m/s of each component of the velocity. */
  double attitude_sigma_rad, velocity_sigma_m_s;
  /* The largest time between two attitudes that are interpolated. Default 250 ms. */
  int64_t max_gap_ns;
  /* How long a frame waits for the sample that follows it. Default 200 ms. */
  int64_t hold_frame_ns;
  /* Added to the camera's host times, to bring them to the session's clock: the difference of the
     clocks minus the camera's delay from exposure to receipt, where that is known. Default 0. */
  int64_t camera_offset_ns;
  /* The first argument of the functions below. */
  void *user;
  /* Called with every packet of the vehicle's system, and with those that the session sends, as
     they are on the wire. Valid during the call. May be null. */
  void (*on_packet)(void *user, int64_t now_ns, const uint8_t *bytes, size_t size);
  /* Called with every sample, which tvm_session_imu's source then gives, too. May be null. */
  void (*on_imu)(void *user, const tvs_imu *sample);
  /* Called at each event. May be null. */
  void (*on_event)(void *user, tvm_event event);
} tvm_session_options;

/* Writes the defaults into a struct of struct_size bytes; null is allowed. */
TV_API void tvm_session_options_init_sized(tvm_session_options *options, size_t struct_size);
/* Writes the defaults; null is allowed. */
#define tvm_session_options_init(options) \
  tvm_session_options_init_sized((options), sizeof *(options))

/* A session in the caller's memory. Private. */
typedef struct tvm_session tvm_session;

/* The bytes of a session, about 90 kB, whose memory is to be aligned as malloc aligns it. */
TV_API size_t tvm_session_size(void);

/* Makes a session in `memory`, which the caller owns and keeps until it no longer uses the session;
   there is nothing to free. options and transport are copied. Nothing is sent or received before
   tvm_session_step. Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE, TVS_ERR_ARGUMENT (a value out of its
   range), TVS_ERR_CAPACITY (too few bytes). */
TV_API tvs_status tvm_session_init(tvm_session **session, const tvm_session_options *options,
                                   const tvm_transport *transport, void *memory, size_t size_bytes);

/* Receives all that has come, and sends what is due. Call it at least every 20 ms. now_ns is of a
   monotonic clock of the caller, and within 73 years of its zero. TVS_END: the transport has ended.
   Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (now_ns before that of the last call), TVS_ERR_IO. */
TV_API tvs_status tvm_session_step(tvm_session *session, int64_t now_ns);

/* What is known of the link at the last step; TVM_LINK_WAITING of null. */
TV_API tvm_link tvm_session_link(const tvm_session *session);

/* The kind of the autopilot, and its system id in *system (0: none was heard yet), which may be
   null. */
TV_API tvm_autopilot tvm_session_autopilot(const tvm_session *session, int *system);

/* Writes the counters. Either may be null. */
TV_API void tvm_session_counters(const tvm_session *session, tvm_counters *counters);

/* How many readings were left out because they are no measurements: a DISTANCE_SENSOR that says
   that its signal is invalid (signal_quality 1) or is at or beyond the ends of its range, and a
   height, a velocity or an attitude that is not finite or that no such vehicle has (above 3000 m,
   150 m/s). Null: 0. */
TV_API uint64_t tvm_session_num_invalid(const tvm_session *session);

/* Fills *source with the vehicle's samples: the attitude and the angular rate at each ATTITUDE,
   with velocity and height interpolated to its time where their neighbours are near enough. A
   sample comes when these neighbours are known, at most 150 ms late. The last 64 samples are kept.
   Returns TVS_ERR_NULL. */
TV_API tvs_status tvm_session_imu_sized(tvm_session *session, tvs_imu_source *source,
                                        size_t source_size);
/* tvm_session_imu_sized with the size of the caller's struct. */
#define tvm_session_imu(session, source) \
  tvm_session_imu_sized((session), (source), sizeof *(source))

/* Fills *source with the frames of `camera`, each with the vehicle's attitude at its host time plus
   camera_offset_ns. `next` gives TVS_NONE while the sample that follows a frame has not come, at
   most hold_frame_ns. Times of the frames are then in the session's clock. `camera` is copied, must
   be valid as long as the session, and lends up to 8 frames more than the caller holds. Returns
   TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE. */
TV_API tvs_status tvm_session_frames_sized(tvm_session *session, const tvs_frame_source *camera,
                                           tvs_frame_source *source, size_t source_size);
/* tvm_session_frames_sized with the size of the caller's struct. */
#define tvm_session_frames(session, camera, source) \
  tvm_session_frames_sized((session), (camera), (source), sizeof *(source))

/* The attitude at host_ns of the session's clock, interpolated between two measured neighbours.
   sigma_rad includes by how much the vehicle turned within the uncertainty of the time. *time is
   filled with the device's time of that instant; it may be null. TVS_NONE: not known (yet). Returns
   TVS_ERR_NULL. */
TV_API tvs_status tvm_session_attitude_at(const tvm_session *session, int64_t host_ns,
                                          tvs_time *time, tvs_attitude *attitude);

TV_END_DECLS

#endif
