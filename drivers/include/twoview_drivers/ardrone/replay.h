/* AR.Drone 2.0: plays a recording through a session, or reads its attitudes as a source. A
   recording is a folder (docs/formats.md):

   navdata.log   per packet: u64 host time in ns, u32 length, the bytes; little-endian
   video.pave    whole packets as they came
   frames.txt    per packet of video.pave a line: host time ns, device time ns, number, 1 for a key
   frame; where it is missing or ends, the packets' own stamps give the times

   A packet of video.pave is played at its host time. `twoview drone record` writes when the picture
   was taken (tvs_time.host_ns), which the playing keeps; but the packet came later, so that the
   attitudes around a picture may be played after it: on_frame then has none of it.

   A file that was cut at any byte is read up to its last whole packet. It uses stdio, which uses
   the heap. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_REPLAY_H
#define TWOVIEW_DRIVERS_ARDRONE_REPLAY_H

#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pave.h"
#include "twoview_drivers/ardrone/transport.h"
#include "twoview_drivers/clock.h"

TV_BEGIN_DECLS

/* A replay in the caller's memory. Its fields are private. */
typedef struct ardrone_replay {
  /* The open files, each a FILE pointer or null. */
  void *navdata, *video, *frames;
  /* now_ns is the caller's latest time; the recording's host time origin_ns is played at
     begin_ns. */
  int64_t now_ns, begin_ns, origin_ns;
  int has_datagram, has_packet;
  /* The recorded host times of the next datagram and the next packet. */
  int64_t datagram_ns, packet_ns;
  int64_t paced_ns;
  uint32_t paced_ms;
  size_t datagram_size, header_size, header_sent, payload_left;
  uint8_t datagram[ARDRONE_NAVDATA_MAX_BYTES], header[ARDRONE_PAVE_MAX_HEADER];
} ardrone_replay;

/* Opens a folder that holds at least one of navdata.log and video.pave, and fills the transport,
   for a session with listen_only 1 and skip_to_latest 0. What the session sends is dropped. Returns
   TVS_ERR_NULL, TVS_ERR_ARGUMENT (a path of 4000 bytes and more), TVS_ERR_IO (neither file). */
TV_API tvs_status ardrone_replay_open_sized(ardrone_replay *replay, const char *folder,
                                            ardrone_transport *transport, size_t transport_size);
/* ardrone_replay_open_sized with the size of the caller's struct. */
#define ardrone_replay_open(replay, folder, transport) \
  ardrone_replay_open_sized((replay), (folder), (transport), sizeof *(transport))

/* Closes the files of a replay, which may be null. */
TV_API void ardrone_replay_close(ardrone_replay *replay);

/* Hand over the time of the caller's clock before each step; the first call starts the playing. Any
   clock serves. To play as fast as possible, advance to ardrone_replay_next_ns each time. */
TV_API void ardrone_replay_advance(ardrone_replay *replay, int64_t now_ns);

/* When the next bytes are due, ns of the caller's clock; always later than the last advance. Bytes
   that were due and not received are due again after 10 ms. INT64_MAX when all has been played. */
TV_API int64_t ardrone_replay_next_ns(const ardrone_replay *replay);

/* Converts an instant of the caller's clock to the recorded host time that is played then. */
TV_API int64_t ardrone_replay_host_ns(const ardrone_replay *replay, int64_t now_ns);

/* Reads a navdata.log as an IMU source. The caller owns it. Private. */
typedef struct ardrone_log {
  /* The open file, a FILE pointer. */
  void *file;
  tvs_clock clock;
  ardrone_sequence sequence;
  int has_psi0;
  uint32_t psi0_clock_id;
  double psi0_rad;
} ardrone_log;

/* Opens the file at `path` and fills *source, for file_source.h. The samples' device times are the
   recording's host times; the drone's own stamps remove the network's jitter from them. Their
   clock_id is 1, and a larger one after each reboot or jump of the clock; a packet without
   ARDRONE_TAG_TIME gives 0. Returns TVS_ERR_NULL, TVS_ERR_IO (it does not open). */
TV_API tvs_status ardrone_log_open_sized(ardrone_log *log, const char *path, tvs_imu_source *source,
                                         size_t source_size);
/* ardrone_log_open_sized with the size of the caller's struct. */
#define ardrone_log_open(log, path, source) \
  ardrone_log_open_sized((log), (path), (source), sizeof *(source))
/* Closes the file of a log, which may be null. */
TV_API void ardrone_log_close(ardrone_log *log);

TV_END_DECLS

#endif
