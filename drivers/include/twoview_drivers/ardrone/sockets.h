/* AR.Drone 2.0: the transport over UDP and TCP, and a loop for those who have none. POSIX. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_SOCKETS_H
#define TWOVIEW_DRIVERS_ARDRONE_SOCKETS_H

#include "twoview_drivers/ardrone/session.h"

TV_BEGIN_DECLS

/* The drone's address in its own network. */
#define ARDRONE_DEFAULT_HOST "192.168.1.1"

/* The caller's struct. Private but for `port`. */
typedef struct ardrone_sockets {
  uint32_t address; /* IPv4, network order */
  uint16_t port[ARDRONE_NUM_CHANNELS];
  int descriptor[ARDRONE_NUM_CHANNELS];
} ardrone_sockets;

/* Looks the host up (an IPv4 address in digits does not block; a name may) and fills the transport; the
   ports are the drone's usual ones: change `port` before the first step. Opens nothing. `sockets` stays
   in place as long as the transport is used. Local ports are the system's choice, so several drones
   can be served at once; navdata is accepted from the host's address alone.
   Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (no such host). */
TV_API tvs_status ardrone_sockets_init(ardrone_sockets *sockets, const char *host,
                                       ardrone_transport *transport);

/* CLOCK_MONOTONIC. */
TV_API int64_t ardrone_now_ns(void);

/* Waits until something arrives or the next step is due, but not longer than until_ns; a signal ends the wait. */
TV_API void ardrone_session_wait(const ardrone_session *session, int64_t until_ns);

/* Steps until until_ns (INT64_MAX: no end), or until keep_going, asked after each step with `user`, says 0; a null
   keep_going always goes on. Returns as ardrone_session_step, for the last step. */
TV_API tvs_status ardrone_session_run(ardrone_session *session, int64_t until_ns,
                                      int (*keep_going)(void *user), void *user);

TV_END_DECLS

#endif
