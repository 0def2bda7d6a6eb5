// The few socket calls that the simulator needs; errors are exceptions that name the port.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <string>
#include <utility>

namespace simulator {

// A file descriptor that closes itself.
class Socket {
 public:
  explicit Socket(int fd = -1) : fd_(fd) {}
  ~Socket() { close(); }
  Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    if (this != &other) {
      close();
      fd_ = std::exchange(other.fd_, -1);
    }
    return *this;
  }
  int fd() const { return fd_; }
  bool is_open() const { return fd_ >= 0; }
  void close();
  // So that the other side sees a reset, not an end.
  void reset();

 private:
  int fd_;
};

// Bound without blocking to an address like 127.0.0.1; port 0 takes a free one. Throw
// std::runtime_error: "port 5556: Address already in use".
Socket bind_udp(const std::string& host, uint16_t port);
Socket listen_tcp(const std::string& host, uint16_t port);
uint16_t bound_port(const Socket& socket);

// The next client, or a closed socket when there is none.
Socket accept_client(const Socket& listener);

}  // namespace simulator
