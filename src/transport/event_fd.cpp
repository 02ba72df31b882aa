#include "transport/event_fd.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "common/error.h"

namespace livemap::transport {

EventFd::EventFd() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (fd_ < 0) {
    throw Error("cannot create an event descriptor: " + std::generic_category().message(errno));
  }
}

EventFd::~EventFd() { close(fd_); }

void EventFd::Signal() {
  // Fails only when the counter is full, which is as signalled as can be.
  (void)eventfd_write(fd_, 1);
}

void EventFd::Clear() {
  eventfd_t count = 0;
  (void)eventfd_read(fd_, &count);  // Fails only when nothing was signalled.
}

}  // namespace livemap::transport
