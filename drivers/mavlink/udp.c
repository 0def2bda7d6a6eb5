#define _GNU_SOURCE
#include "twoview_drivers/mavlink/udp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "../source/sized.h"

static struct sockaddr_in address_of(uint32_t address, uint16_t port) {
  struct sockaddr_in result;
  memset(&result, 0, sizeof result);
  result.sin_family = AF_INET;
  result.sin_addr.s_addr = address;
  result.sin_port = port;
  return result;
}

static int is_passing(int error) {
  return error == EAGAIN || error == EWOULDBLOCK || error == EINTR || error == ECONNREFUSED ||
         error == ENOBUFS || error == ENETUNREACH || error == EHOSTUNREACH || error == ENETDOWN;
}

static tvs_status send_bytes(void *user, const void *bytes, size_t size) {
  tvm_udp *udp = user;
  const struct sockaddr_in to = address_of(udp->peer_address, udp->peer_port);
  if (udp->descriptor < 0) return TVS_ERR_IO;
  if (udp->peer_port == 0) return TVS_NONE;
  if (sendto(udp->descriptor, bytes, size, MSG_NOSIGNAL, (const struct sockaddr *)&to, sizeof to) >=
      0) {
    return TVS_OK;
  }
  return is_passing(errno) ? TVS_NONE : TVS_ERR_IO;
}

static tvs_status receive_bytes(void *user, void *bytes, size_t capacity, size_t *size) {
  tvm_udp *udp = user;
  struct sockaddr_in from;
  socklen_t length = sizeof from;
  ssize_t got;
  if (udp->descriptor < 0) return TVS_ERR_IO;
  got = recvfrom(udp->descriptor, bytes, capacity, 0, (struct sockaddr *)&from, &length);
  if (got < 0) return is_passing(errno) ? TVS_NONE : TVS_ERR_IO;
  udp->sender_address = from.sin_addr.s_addr;
  udp->sender_port = from.sin_port;
  *size = (size_t)got;
  return TVS_OK;
}

static void keep_sender(void *user) {
  tvm_udp *udp = user;
  if (udp->has_fixed_peer) return;
  udp->peer_address = udp->sender_address;
  udp->peer_port = udp->sender_port;
}

static int descriptor_of(void *user) { return ((tvm_udp *)user)->descriptor; }

/* Splits "udp://HOST:PORT". */
static int parse(const char *text, char host[256], int *port, int *is_out) {
  const char *rest, *colon;
  char *end;
  long number;
  size_t length;
  *is_out = strncmp(text, "udpout://", 9) == 0;
  if (*is_out || strncmp(text, "udpin://", 8) == 0) {
    rest = strstr(text, "://") + 3;
  } else if (strncmp(text, "udp://", 6) == 0) {
    rest = text + 6;
  } else {
    return 0;
  }
  colon = strrchr(rest, ':');
  if (!colon || colon[1] < '0' || colon[1] > '9') return 0;
  number = strtol(colon + 1, &end, 10);
  length = (size_t)(colon - rest);
  if (*end != '\0' || number < *is_out || number > 65535 || length >= 256) return 0;
  if (length == 0 && *is_out) return 0;
  memcpy(host, rest, length);
  host[length] = '\0';
  if (length == 0) strcpy(host, "0.0.0.0");
  *port = (int)number;
  return 1;
}

static int set_flags(int fd) {
  const int flags = fcntl(fd, F_GETFL);
  return flags >= 0 && fcntl(fd, F_SETFL, flags | O_NONBLOCK) == 0 &&
         fcntl(fd, F_SETFD, FD_CLOEXEC) == 0;
}

tvs_status tvm_udp_open_sized(tvm_udp *udp, const char *address, tvm_transport *transport,
                              size_t transport_size) {
  const tvm_transport own = {0, udp, send_bytes, receive_bytes, keep_sender, descriptor_of};
  char host[256];
  struct addrinfo hints, *found = NULL;
  struct sockaddr_in to;
  int port, is_out, fd;
  if (!udp || !address || !transport) return TVS_ERR_NULL;
  if (!parse(address, host, &port, &is_out)) return TVS_ERR_ARGUMENT;
  memset(&hints, 0, sizeof hints);
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_DGRAM;
  if (getaddrinfo(host, NULL, &hints, &found) != 0 || !found) return TVS_ERR_ARGUMENT;
  to = address_of(((const struct sockaddr_in *)(const void *)found->ai_addr)->sin_addr.s_addr,
                  htons((uint16_t)port));
  freeaddrinfo(found);
  fd = socket(AF_INET, SOCK_DGRAM, 0);
  if (fd < 0) return TVS_ERR_IO;
  if (!set_flags(fd) || (!is_out && bind(fd, (const struct sockaddr *)&to, sizeof to) != 0)) {
    const tvs_status status = errno == EADDRINUSE ? TVS_ERR_STATE : TVS_ERR_IO;
    close(fd);
    return status;
  }
  memset(udp, 0, sizeof *udp);
  udp->descriptor = fd;
  udp->has_fixed_peer = is_out;
  if (is_out) {
    udp->peer_address = to.sin_addr.s_addr;
    udp->peer_port = to.sin_port;
  }
  tvs_write_sized(&own, sizeof own, transport, transport_size);
  return TVS_OK;
}

void tvm_udp_close(tvm_udp *udp) {
  if (!udp || udp->descriptor < 0) return;
  close(udp->descriptor);
  udp->descriptor = -1;
}

int tvm_udp_port(const tvm_udp *udp) {
  struct sockaddr_in own;
  socklen_t length = sizeof own;
  if (!udp || udp->descriptor < 0 ||
      getsockname(udp->descriptor, (struct sockaddr *)&own, &length) != 0) {
    return 0;
  }
  return ntohs(own.sin_port);
}

void tvm_udp_wait(const tvm_udp *udp, int64_t max_ns) {
  struct pollfd fd;
  if (!udp || max_ns <= 0) return;
  fd.fd = udp->descriptor;
  fd.events = POLLIN;
  poll(&fd, 1, (int)((max_ns + 999999) / 1000000));
}
