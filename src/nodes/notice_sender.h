#pragma once

#include <ros/publisher.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <thread>

#include "zone/zone_service.h"

namespace livemap {

/// Tells every vehicle what the zone announces: from a thread of its own, since a small picture of
/// a new hazard takes milliseconds, in the order of the announcements.
class NoticeSender {
 public:
  /// `picture_bytes` of a notice's picture at most; 0: none.
  NoticeSender(const ZoneService& zone, const ros::Publisher& publisher, std::size_t picture_bytes);
  /// Sends what waits and stops.
  ~NoticeSender();
  NoticeSender(const NoticeSender&) = delete;
  NoticeSender& operator=(const NoticeSender&) = delete;

  void Push(const HazardEvent& event);

  std::uint64_t sent() const { return sent_; }
  std::uint64_t pictures() const { return pictures_; }
  std::uint64_t pictures_failed() const { return pictures_failed_; }

 private:
  void Work();
  void Send(const HazardEvent& event, bool with_picture);

  const ZoneService& zone_;
  const ros::Publisher publisher_;
  const std::size_t picture_bytes_;
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::uint64_t> pictures_{0};
  std::atomic<std::uint64_t> pictures_failed_{0};
  std::mutex mutex_;  ///< Guards the next two.
  std::deque<HazardEvent> events_;
  bool closing_ = false;
  std::condition_variable changed_;
  std::thread thread_;
};

}  // namespace livemap
