#pragma once

namespace livemap::transport {

/// A flag that wakes a poll(): readable from Signal() until Clear(). Thread-safe.
class EventFd {
 public:
  /// Throws Error when the system has no descriptor left.
  EventFd();
  ~EventFd();
  EventFd(const EventFd&) = delete;
  EventFd& operator=(const EventFd&) = delete;

  void Signal();
  void Clear();
  int fd() const { return fd_; }

 private:
  int fd_;
};

}  // namespace livemap::transport
