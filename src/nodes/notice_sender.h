#pragma once

#include <ros/publisher.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <thread>

#include "common/mutex.h"
#include "nodes/notice_pictures.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// Tells every vehicle what the zone announces: from a thread of its own, since a small picture of
/// a new hazard takes milliseconds, in the order of the announcements.
class NoticeSender {
 public:
  /// `pictures` outlives it.
  NoticeSender(NoticePictures& pictures, const ros::Publisher& publisher);
  /// Sends what waits and stops.
  ~NoticeSender();
  NoticeSender(const NoticeSender&) = delete;
  NoticeSender& operator=(const NoticeSender&) = delete;

  void Push(const zone::HazardEvent& event);

  std::uint64_t sent() const { return sent_; }
  std::uint64_t pictures() const { return pictures_; }

 private:
  void Work();
  void Send(const zone::HazardEvent& event, bool with_picture);

  NoticePictures& all_pictures_;
  const ros::Publisher publisher_;
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::uint64_t> pictures_{0};
  Mutex mutex_;
  std::deque<zone::HazardEvent> events_ GUARDED_BY(mutex_);
  bool closing_ GUARDED_BY(mutex_) = false;
  ConditionVariable changed_;
  std::thread thread_;
};

}  // namespace livemap::nodes
