/* AR.Drone 2.0: how a session sends and receives: through sockets (sockets.h), from a recording
   (replay.h), or through a test's own functions.

   The functions do not block. The session calls them from one thread. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_TRANSPORT_H
#define TWOVIEW_DRIVERS_ARDRONE_TRANSPORT_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* The five channels between a session and its drone. */
typedef enum ardrone_channel {
  /* Commands to the drone, UDP 5556. */
  ARDRONE_CHANNEL_AT,
  /* Navdata from the drone and the session's wake-up to it, UDP 5554. */
  ARDRONE_CHANNEL_NAVDATA,
  /* The live video stream from the drone, TCP 5555. */
  ARDRONE_CHANNEL_VIDEO,
  /* The configuration and the lists of ids from the drone, TCP 5559. */
  ARDRONE_CHANNEL_CONTROL,
  /* The recording stream from the drone, TCP 5553. */
  ARDRONE_CHANNEL_RECORDING,
  /* The number of channels. */
  ARDRONE_NUM_CHANNELS
} ardrone_channel;

/* The functions of a transport. The transport fills it, and the session calls it. */
typedef struct ardrone_transport {
  /* sizeof(ardrone_transport), which the transport sets. */
  uint32_t struct_size;
  /* The first argument of each function below. */
  void *user;
  /* Begins to open a channel; one that is open is closed first. TVS_OK: opening is under way or
     done. TVS_ERR_IO: the channel cannot be opened. */
  tvs_status (*open)(void *user, ardrone_channel channel, int64_t now_ns);
  /* Sends one whole datagram. TVS_OK. TVS_NONE: the system's buffer is full, and nothing was sent.
     TVS_ERR_IO: the channel failed. */
  tvs_status (*send)(void *user, ardrone_channel channel, const void *bytes, size_t size);
  /* Receives. UDP: one datagram that came from the drone's address, cut at `capacity`; datagrams
     from other addresses are dropped. TCP: the bytes that have come. TVS_OK: *size bytes, at least
     1 on TCP. TVS_NONE: nothing has come, or the connection is still being made. TVS_END: the drone
     closed the connection. TVS_ERR_IO: the connection broke or was refused. */
  tvs_status (*receive)(void *user, ardrone_channel channel, void *bytes, size_t capacity,
                        size_t *size);
  /* Closes a channel; one that is not open is left as it is. */
  void (*close)(void *user, ardrone_channel channel);
  /* The descriptor of an open channel for poll(2), else -1. The pointer may be null. */
  int (*descriptor)(void *user, ardrone_channel channel);
} ardrone_transport;

TV_END_DECLS

#endif
