#include "transport/tcp_probe.h"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <memory>
#include <system_error>

namespace livemap::transport {
namespace {

std::string TcpErrorMessage(int error) { return std::generic_category().message(error); }

/// A connected socket's errno-style outcome: 0, or why the connection failed.
int ConnectTcpWithin(const addrinfo& address, double timeout_s, int cancel_fd) {
  const int fd = socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC,
                        address.ai_protocol);
  if (fd < 0) return errno;
  int error = connect(fd, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
  if (error == EINPROGRESS) {
    std::array<pollfd, 2> waited = {pollfd{fd, POLLOUT, 0}, pollfd{cancel_fd, POLLIN, 0}};
    const int ready =
        poll(waited.data(), waited.size(), static_cast<int>(std::ceil(timeout_s * 1000)));
    if (ready < 0) {
      error = errno;
    } else if (waited[1].revents != 0) {
      error = ECANCELED;
    } else if (ready == 0) {
      error = ETIMEDOUT;
    } else {
      socklen_t size = sizeof(error);
      if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) != 0) error = errno;
    }
  }
  close(fd);
  return error;
}

std::string NumericTcpAddress(const addrinfo& address) {
  std::array<char, NI_MAXHOST> host{};
  const int failed = getnameinfo(address.ai_addr, address.ai_addrlen, host.data(), host.size(),
                                 nullptr, 0, NI_NUMERICHOST);
  return failed != 0 ? "" : host.data();
}

}  // namespace

TcpProbeResult ProbeTcp(const std::string& host, int port, double timeout_s, int cancel_fd) {
  const std::string place = host + ":" + std::to_string(port);
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int failed = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (failed != 0) return {"", "cannot resolve broker " + place + ": " + gai_strerror(failed)};
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, &freeaddrinfo);

  int last_error = EADDRNOTAVAIL;
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    last_error = ConnectTcpWithin(*address, timeout_s, cancel_fd);
    if (last_error == 0) return {NumericTcpAddress(*address), ""};
    if (last_error == ECANCELED) break;
  }
  return {"", "cannot reach broker " + place + ": " + TcpErrorMessage(last_error)};
}

}  // namespace livemap::transport
