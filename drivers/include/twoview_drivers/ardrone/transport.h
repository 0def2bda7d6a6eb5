/* AR.Drone 2.0: what a session sends and receives through: sockets (sockets.h), a recording
   (replay.h), or whatever a test makes up.

   No function blocks; none is called from two threads. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_TRANSPORT_H
#define TWOVIEW_DRIVERS_ARDRONE_TRANSPORT_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* The five ways between a session and its drone. */
typedef enum ardrone_channel {
  ARDRONE_CHANNEL_AT,        /* UDP 5556, to the drone */
  ARDRONE_CHANNEL_NAVDATA,   /* UDP 5554, both ways */
  ARDRONE_CHANNEL_VIDEO,     /* TCP 5555, from the drone */
  ARDRONE_CHANNEL_CONTROL,   /* TCP 5559, from the drone */
  ARDRONE_CHANNEL_RECORDING, /* TCP 5553, from the drone */
  ARDRONE_NUM_CHANNELS       /* how many there are */
} ardrone_channel;

/* Filled by whoever transports; the session calls. */
typedef struct ardrone_transport {
  uint32_t struct_size; /* sizeof(ardrone_transport) */
  void *user;           /* first argument of the functions */
  /* Begins to open. TVS_OK: under way or done; TVS_ERR_IO: cannot. An open channel is closed first. */
  tvs_status (*open)(void *user, ardrone_channel channel, int64_t now_ns);
  /* One datagram, whole. TVS_OK; TVS_NONE: not now (a full buffer); TVS_ERR_IO. */
  tvs_status (*send)(void *user, ardrone_channel channel, const void *bytes, size_t size);
  /* UDP: one datagram from the drone's address (and from nobody else), cut at capacity. TCP: what has
     come. TVS_OK: *size bytes, at least 1 of a stream; TVS_NONE: nothing has come, or a connection is still being
     made; TVS_END: closed by the drone; TVS_ERR_IO: broken or refused. */
  tvs_status (*receive)(void *user, ardrone_channel channel, void *bytes, size_t capacity,
                        size_t *size);
  void (*close)(void *user, ardrone_channel channel); /* also of a channel that is not open */
  /* For poll(2): the descriptor of an open channel, else -1. May be null. */
  int (*descriptor)(void *user, ardrone_channel channel);
} ardrone_transport;

TV_END_DECLS

#endif
