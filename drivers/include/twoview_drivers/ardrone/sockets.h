/* AR.Drone 2.0: the transport over UDP and TCP, and a loop that steps a session. POSIX. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_SOCKETS_H
#define TWOVIEW_DRIVERS_ARDRONE_SOCKETS_H

#include "twoview_drivers/ardrone/session.h"

TV_BEGIN_DECLS

/* The drone's address in the network that it opens. */
#define ARDRONE_DEFAULT_HOST "192.168.1.1"

/* A transport by sockets in the caller's memory. Its fields are private except for `port`. */
typedef struct ardrone_sockets {
  /* The drone's IPv4 address in network byte order. */
  uint32_t address;
  uint16_t port[ARDRONE_NUM_CHANNELS];
  int descriptor[ARDRONE_NUM_CHANNELS];
} ardrone_sockets;

/* Looks the host up and fills the transport; it opens nothing. An IPv4 address in digits does not
   block, a name may. The ports are the drone's usual ones; to change them, write `port` before the
   first step. `sockets` stays in place as long as the transport is used. The system chooses the
   local ports, so one computer can serve several drones. Navdata is accepted from the host's
   address only. Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (no such host). */
TV_API tvs_status ardrone_sockets_init_sized(ardrone_sockets *sockets, const char *host,
                                             ardrone_transport *transport, size_t transport_size);
/* ardrone_sockets_init_sized with the size of the caller's struct. */
#define ardrone_sockets_init(sockets, host, transport) \
  ardrone_sockets_init_sized((sockets), (host), (transport), sizeof *(transport))

/* Returns the present time of CLOCK_MONOTONIC, ns. */
TV_API int64_t ardrone_now_ns(void);

/* Waits until bytes arrive, the next step is due, or until_ns (a time of ardrone_now_ns) has come.
   A signal ends the wait. */
TV_API void ardrone_session_wait(const ardrone_session *session, int64_t until_ns);

/* Steps the session until until_ns (INT64_MAX: without end), or until keep_going(user), which is
   called after each step, returns 0. A null keep_going never ends it. Returns as
   ardrone_session_step for the last step. */
TV_API tvs_status ardrone_session_run(ardrone_session *session, int64_t until_ns,
                                      int (*keep_going)(void *user), void *user);

TV_END_DECLS

#endif
