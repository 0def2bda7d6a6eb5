/* twoview drivers: MAVLink over UDP (IPv4), as a transport of mavlink/session.h. */
#ifndef TWOVIEW_DRIVERS_MAVLINK_UDP_H
#define TWOVIEW_DRIVERS_MAVLINK_UDP_H

#include "twoview_drivers/mavlink/session.h"

TV_BEGIN_DECLS

/* An open socket in the caller's memory. Its fields are private. */
typedef struct tvm_udp {
  int descriptor;
  /* Network byte order; the port is 0 while the peer is not known. */
  uint32_t peer_address, sender_address;
  uint16_t peer_port, sender_port;
  /* 1: sends to a fixed peer (udpout). */
  int32_t has_fixed_peer;
} tvm_udp;

/* Opens an address and fills *transport, which is valid until tvm_udp_close:
     udp://HOST:PORT or udpin://HOST:PORT   listens on this port of this computer's address HOST
                                            (empty or 0.0.0.0: every one) and sends to where the
                                            vehicle's packets come from;
     udpout://HOST:PORT                     sends to this address, and receives its answers.
   HOST is a name or an IPv4 address. Returns TVS_ERR_NULL; TVS_ERR_ARGUMENT: the text is not such
   an address, or there is no such host; TVS_ERR_STATE: another program has the port; TVS_ERR_IO. */
TV_API tvs_status tvm_udp_open_sized(tvm_udp *udp, const char *address, tvm_transport *transport,
                                     size_t transport_size);
/* tvm_udp_open_sized with the size of the caller's struct. */
#define tvm_udp_open(udp, address, transport) \
  tvm_udp_open_sized((udp), (address), (transport), sizeof *(transport))

/* Closes the socket. Null and a closed one are no error. */
TV_API void tvm_udp_close(tvm_udp *udp);

/* The port of this computer that the socket has, or 0. */
TV_API int tvm_udp_port(const tvm_udp *udp);

/* Waits until bytes have come, at most max_ns. */
TV_API void tvm_udp_wait(const tvm_udp *udp, int64_t max_ns);

TV_END_DECLS

#endif
