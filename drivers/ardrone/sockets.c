#define _GNU_SOURCE
#include "twoview_drivers/ardrone/sockets.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "../source/sized.h"
#include "session_impl.h"

static const uint16_t PORTS[ARDRONE_NUM_CHANNELS] = {5556, 5554, 5555, 5559, 5553};

static int is_udp(ardrone_channel channel) {
  return channel == ARDRONE_CHANNEL_AT || channel == ARDRONE_CHANNEL_NAVDATA;
}

static struct sockaddr_in address_of(const ardrone_sockets *sockets, ardrone_channel channel) {
  struct sockaddr_in address;
  memset(&address, 0, sizeof address);
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = sockets->address;
  address.sin_port = htons(sockets->port[channel]);
  return address;
}

static void close_channel(void *user, ardrone_channel channel) {
  ardrone_sockets *sockets = user;
  if (sockets->descriptor[channel] < 0) return;
  close(sockets->descriptor[channel]);
  sockets->descriptor[channel] = -1;
}

static int set_flags(int fd) {
  const int flags = fcntl(fd, F_GETFL);
  return flags >= 0 && fcntl(fd, F_SETFL, flags | O_NONBLOCK) == 0 &&
         fcntl(fd, F_SETFD, FD_CLOEXEC) == 0;
}

static tvs_status open_channel(void *user, ardrone_channel channel, int64_t now_ns) {
  ardrone_sockets *sockets = user;
  const struct sockaddr_in address = address_of(sockets, channel);
  const int fd = socket(AF_INET, is_udp(channel) ? SOCK_DGRAM : SOCK_STREAM, 0);
  (void)now_ns;
  close_channel(user, channel);
  if (fd < 0) return TVS_ERR_IO;
  if (!set_flags(fd) ||
      (!is_udp(channel) && connect(fd, (const struct sockaddr *)&address, sizeof address) != 0 &&
       errno != EINPROGRESS)) {
    close(fd);
    return TVS_ERR_IO;
  }
  sockets->descriptor[channel] = fd;
  return TVS_OK;
}

static tvs_status send_bytes(void *user, ardrone_channel channel, const void *bytes, size_t size) {
  ardrone_sockets *sockets = user;
  const struct sockaddr_in address = address_of(sockets, channel);
  if (sockets->descriptor[channel] < 0 || !is_udp(channel)) return TVS_ERR_IO;
  if (sendto(sockets->descriptor[channel], bytes, size, MSG_NOSIGNAL,
             (const struct sockaddr *)&address, sizeof address) >= 0) {
    return TVS_OK;
  }
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS ? TVS_NONE
                                                                                       : TVS_ERR_IO;
}

static tvs_status why_nothing(void) {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == EINPROGRESS
             ? TVS_NONE
             : TVS_ERR_IO;
}

/* Datagrams from other addresses are dropped, at most 64 in one call. */
static tvs_status receive_datagram(ardrone_sockets *sockets, ardrone_channel channel, void *bytes,
                                   size_t capacity, size_t *size) {
  int k;
  for (k = 0; k < 64; ++k) {
    struct sockaddr_in from;
    socklen_t length = sizeof from;
    const ssize_t got = recvfrom(sockets->descriptor[channel], bytes, capacity, 0,
                                 (struct sockaddr *)&from, &length);
    if (got < 0) return why_nothing();
    if (length == sizeof from && from.sin_family == AF_INET &&
        from.sin_addr.s_addr == sockets->address) {
      *size = (size_t)got;
      return TVS_OK;
    }
  }
  return TVS_NONE;
}

static tvs_status receive_bytes(void *user, ardrone_channel channel, void *bytes, size_t capacity,
                                size_t *size) {
  ardrone_sockets *sockets = user;
  ssize_t got;
  if (sockets->descriptor[channel] < 0) return TVS_ERR_IO;
  if (is_udp(channel)) return receive_datagram(sockets, channel, bytes, capacity, size);
  got = recv(sockets->descriptor[channel], bytes, capacity, 0);
  if (got < 0) return why_nothing();
  if (got == 0) return TVS_END;
  *size = (size_t)got;
  return TVS_OK;
}

static int descriptor_of(void *user, ardrone_channel channel) {
  return ((ardrone_sockets *)user)->descriptor[channel];
}

tvs_status ardrone_sockets_init_sized(ardrone_sockets *sockets, const char *host,
                                      ardrone_transport *transport, size_t transport_size) {
  const ardrone_transport own = {
      0, sockets, open_channel, send_bytes, receive_bytes, close_channel, descriptor_of};
  struct addrinfo hints, *found = NULL;
  int channel;
  if (!sockets || !host || !transport) return TVS_ERR_NULL;
  memset(&hints, 0, sizeof hints);
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_DGRAM;
  if (getaddrinfo(host, NULL, &hints, &found) != 0 || !found) return TVS_ERR_ARGUMENT;
  sockets->address = ((const struct sockaddr_in *)(const void *)found->ai_addr)->sin_addr.s_addr;
  freeaddrinfo(found);
  for (channel = 0; channel < ARDRONE_NUM_CHANNELS; ++channel) {
    sockets->port[channel] = PORTS[channel];
    sockets->descriptor[channel] = -1;
  }
  tvs_write_sized(&own, sizeof own, transport, transport_size);
  return TVS_OK;
}

int64_t ardrone_now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

void ardrone_session_wait(const ardrone_session *session, int64_t until_ns) {
  struct pollfd fds[ARDRONE_NUM_CHANNELS];
  nfds_t num = 0;
  int64_t due_ns;
  int channel;
  if (!session) return;
  due_ns = ardrone_session_next_ns(session);
  if (until_ns < due_ns) due_ns = until_ns;
  due_ns -= ardrone_now_ns();
  if (due_ns <= 0) return;
  for (channel = 0; session->transport.descriptor && channel < ARDRONE_NUM_CHANNELS; ++channel) {
    const int fd = session->transport.descriptor(session->transport.user, (ardrone_channel)channel);
    if (fd < 0 || channel == ARDRONE_CHANNEL_AT) continue;
    fds[num].fd = fd;
    fds[num++].events = POLLIN;
  }
  poll(fds, num, (int)((due_ns + MS - 1) / MS));
}

tvs_status ardrone_session_run(ardrone_session *session, int64_t until_ns,
                               int (*keep_going)(void *user), void *user) {
  tvs_status status = TVS_OK;
  while (status == TVS_OK && ardrone_now_ns() < until_ns) {
    status = ardrone_session_step(session, ardrone_now_ns());
    if (keep_going && !keep_going(user)) break;
    ardrone_session_wait(session, until_ns);
  }
  return status;
}
