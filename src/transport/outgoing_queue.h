#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"

namespace livemap::transport {

/// One message on its way to the broker.
struct OutgoingMessage {
  std::string topic;
  std::vector<std::uint8_t> payload;
  int qos = 1;
  std::uint64_t tag = 0;
  std::size_t bytes() const { return topic.size() + payload.size(); }
};

/// First in, first out, bounded in messages and bytes. Thread-safe.
class OutgoingQueue {
 public:
  OutgoingQueue(std::size_t max_messages, std::size_t max_bytes)
      : max_messages_(max_messages), max_bytes_(max_bytes) {}

  /// False, and nothing changed, when the message does not fit any more.
  bool Push(OutgoingMessage message) {
    const MutexLock lock(mutex_);
    if (messages_.size() >= max_messages_ || message.bytes() > max_bytes_ - bytes_) return false;
    bytes_ += message.bytes();
    messages_.push_back(std::move(message));
    return true;
  }

  std::optional<OutgoingMessage> Pop() {
    const MutexLock lock(mutex_);
    if (messages_.empty()) return std::nullopt;
    OutgoingMessage message = std::move(messages_.front());
    messages_.pop_front();
    bytes_ -= message.bytes();
    return message;
  }

  std::size_t size() const {
    const MutexLock lock(mutex_);
    return messages_.size();
  }

 private:
  const std::size_t max_messages_;
  const std::size_t max_bytes_;
  mutable Mutex mutex_;
  std::deque<OutgoingMessage> messages_ GUARDED_BY(mutex_);
  std::size_t bytes_ GUARDED_BY(mutex_) = 0;
};

}  // namespace livemap::transport
