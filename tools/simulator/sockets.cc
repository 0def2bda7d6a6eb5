#include "simulator/sockets.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace simulator {
namespace {

Socket bind_socket(const std::string& host, uint16_t port, int kind) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1) {
    throw std::runtime_error("\"" + host + "\" is not an IPv4 address");
  }
  Socket socket(::socket(AF_INET, kind | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const int yes = 1;
  if (socket.is_open() && kind == SOCK_STREAM) {
    setsockopt(socket.fd(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  }
  if (!socket.is_open() ||
      bind(socket.fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      (kind == SOCK_STREAM && listen(socket.fd(), 4) != 0)) {
    throw std::runtime_error("port " + std::to_string(port) + ": " + std::strerror(errno));
  }
  return socket;
}

}  // namespace

void Socket::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

void Socket::reset() {
  const linger at_once{1, 0};
  if (fd_ >= 0) setsockopt(fd_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  close();
}

Socket bind_udp(const std::string& host, uint16_t port) {
  return bind_socket(host, port, SOCK_DGRAM);
}

Socket listen_tcp(const std::string& host, uint16_t port) {
  return bind_socket(host, port, SOCK_STREAM);
}

uint16_t bound_port(const Socket& socket) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  getsockname(socket.fd(), reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

Socket accept_client(const Socket& listener) {
  return Socket(accept4(listener.fd(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
}

}  // namespace simulator
