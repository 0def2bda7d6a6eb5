// The socket calls that the simulator needs. Errors are exceptions that name the port.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <string>
#include <utility>

namespace simulator {

// A file descriptor that the destructor closes.
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
  // Closes the connection so that the other side receives a reset instead of a normal end.
  void reset();

 private:
  int fd_;
};

// Binds a non-blocking socket to an address such as 127.0.0.1; port 0 selects a free port. Both
// functions throw std::runtime_error: "port 5556: Address already in use".
Socket bind_udp(const std::string& host, uint16_t port);
Socket listen_tcp(const std::string& host, uint16_t port);
uint16_t bound_port(const Socket& socket);

// Accepts the next waiting client; returns a closed socket if none waits.
Socket accept_client(const Socket& listener);

}  // namespace simulator
