/* The socket transport, connected to sockets of this test on the loopback. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <unity.h>

#include "encode.h"
#include "twoview_drivers/ardrone/sockets.h"

static ardrone_sockets sockets;
static ardrone_transport transport;

void setUp(void) {
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_sockets_init(&sockets, "127.0.0.1", &transport));
}

void tearDown(void) {
  int k;
  for (k = 0; k < ARDRONE_NUM_CHANNELS; ++k) transport.close(transport.user, (ardrone_channel)k);
}

/* A socket bound to a free port of a loopback address. */
static int bound(int type, const char *address, uint16_t *port) {
  struct sockaddr_in a;
  socklen_t length = sizeof a;
  const int fd = socket(AF_INET, type, 0);
  const struct timeval limit = {2, 0};
  memset(&a, 0, sizeof a);
  a.sin_family = AF_INET;
  TEST_ASSERT_EQUAL_INT(1, inet_pton(AF_INET, address, &a.sin_addr));
  TEST_ASSERT_EQUAL_INT(0, bind(fd, (struct sockaddr *)&a, sizeof a));
  TEST_ASSERT_EQUAL_INT(0, getsockname(fd, (struct sockaddr *)&a, &length));
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  *port = ntohs(a.sin_port);
  return fd;
}

static tvs_status receive_soon(ardrone_channel channel, void *bytes, size_t capacity,
                               size_t *size) {
  tvs_status status = TVS_NONE;
  int k;
  for (k = 0; k < 200 && status == TVS_NONE; ++k) {
    status = transport.receive(transport.user, channel, bytes, capacity, size);
    if (status == TVS_NONE) usleep(2000);
  }
  return status;
}

static void test_datagrams_go_out_and_only_the_host_is_heard(void) {
  struct sockaddr_in client;
  socklen_t length = sizeof client;
  char bytes[64];
  size_t size = 0;
  uint16_t port, stranger_port;
  const int host = bound(SOCK_DGRAM, "127.0.0.1", &port);
  const int stranger = bound(SOCK_DGRAM, "127.0.0.2", &stranger_port);
  sockets.port[ARDRONE_CHANNEL_NAVDATA] = port;
  TEST_ASSERT_EQUAL_INT(TVS_ERR_IO,
                        transport.send(transport.user, ARDRONE_CHANNEL_NAVDATA, "x", 1));
  TEST_ASSERT_EQUAL_INT(TVS_OK, transport.open(transport.user, ARDRONE_CHANNEL_NAVDATA, 0));
  TEST_ASSERT_EQUAL_INT(TVS_NONE, transport.receive(transport.user, ARDRONE_CHANNEL_NAVDATA, bytes,
                                                    sizeof bytes, &size));
  TEST_ASSERT_EQUAL_INT(TVS_OK, transport.send(transport.user, ARDRONE_CHANNEL_NAVDATA, "wake", 4));
  TEST_ASSERT_EQUAL_INT(
      4, recvfrom(host, bytes, sizeof bytes, 0, (struct sockaddr *)&client, &length));
  TEST_ASSERT_EQUAL_INT(5, sendto(stranger, "false", 5, 0, (struct sockaddr *)&client, length));
  TEST_ASSERT_EQUAL_INT(4, sendto(host, "true", 4, 0, (struct sockaddr *)&client, length));
  TEST_ASSERT_EQUAL_INT(TVS_OK, receive_soon(ARDRONE_CHANNEL_NAVDATA, bytes, sizeof bytes, &size));
  TEST_ASSERT_EQUAL_UINT64(4, size);
  TEST_ASSERT_EQUAL_MEMORY("true", bytes, 4);
  close(host);
  close(stranger);
}

static void test_a_stream_flows_ends_and_is_refused(void) {
  char bytes[64];
  size_t size = 0;
  uint16_t port;
  const int listener = bound(SOCK_STREAM, "127.0.0.1", &port);
  int client;
  sockets.port[ARDRONE_CHANNEL_VIDEO] = port;
  TEST_ASSERT_EQUAL_INT(0, listen(listener, 1));
  TEST_ASSERT_EQUAL_INT(TVS_OK, transport.open(transport.user, ARDRONE_CHANNEL_VIDEO, 0));
  client = accept(listener, NULL, NULL);
  TEST_ASSERT_TRUE(client >= 0);
  TEST_ASSERT_EQUAL_INT(TVS_NONE, transport.receive(transport.user, ARDRONE_CHANNEL_VIDEO, bytes,
                                                    sizeof bytes, &size));
  TEST_ASSERT_EQUAL_INT(3, send(client, "abc", 3, 0));
  TEST_ASSERT_EQUAL_INT(TVS_OK, receive_soon(ARDRONE_CHANNEL_VIDEO, bytes, sizeof bytes, &size));
  TEST_ASSERT_EQUAL_UINT64(3, size);
  close(client);
  TEST_ASSERT_EQUAL_INT(TVS_END, receive_soon(ARDRONE_CHANNEL_VIDEO, bytes, sizeof bytes, &size));
  close(listener);
  if (transport.open(transport.user, ARDRONE_CHANNEL_VIDEO, 0) == TVS_OK) {
    TEST_ASSERT_EQUAL_INT(TVS_ERR_IO,
                          receive_soon(ARDRONE_CHANNEL_VIDEO, bytes, sizeof bytes, &size));
  }
}

static int stop_at_once(void *user) {
  ++*(int *)user;
  return 0;
}

static void test_the_loop_ends_in_time(void) {
  ardrone_session_options options;
  ardrone_session *session;
  static uint64_t memory[(3 << 20) / 8];
  int64_t begin, took;
  int asked = 0;
  ardrone_session_options_init(&options);
  TEST_ASSERT_EQUAL_INT(
      TVS_OK, ardrone_session_init(&session, &options, &transport, memory, sizeof memory));
  begin = ardrone_now_ns();
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_run(session, begin + 200000000, NULL, NULL));
  took = (ardrone_now_ns() - begin) / 1000000;
  TEST_ASSERT_TRUE(took >= 200 && took < 1000);
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_run(session, INT64_MAX, stop_at_once, &asked));
  TEST_ASSERT_EQUAL_INT(1, asked);
  ardrone_session_close(session);
}

static void test_hosts_that_do_not_exist(void) {
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_sockets_init(&sockets, "256.1.1.1.", &transport));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_ARGUMENT, ardrone_sockets_init(&sockets, "", &transport));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, ardrone_sockets_init(&sockets, NULL, &transport));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_datagrams_go_out_and_only_the_host_is_heard);
  RUN_TEST(test_a_stream_flows_ends_and_is_refused);
  RUN_TEST(test_the_loop_ends_in_time);
  RUN_TEST(test_hosts_that_do_not_exist);
  return UNITY_END();
}
