#pragma once

#include <livemap/HazardNotice.h>
#include <ros/publisher.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <thread>
#include <vector>

#include "common/mutex.h"
#include "nodes/notice_pictures.h"
#include "zone/registry/cell_log.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// Tells vehicles what the zone announces, those of the hazard's cell and, where that is wanted,
/// every vehicle: from a thread of its own, since a small picture of a new hazard takes
/// milliseconds, in the order of the announcements.
class NoticeSender {
 public:
  struct Publishers {
    ros::Publisher all;    ///< To every vehicle; none: they are not told.
    ros::Publisher cells;  ///< To the vehicles of a cell.
  };

  /// `pictures` outlives it.
  NoticeSender(NoticePictures& pictures, const Publishers& publishers);
  /// Sends what waits and stops.
  ~NoticeSender();
  NoticeSender(const NoticeSender&) = delete;
  NoticeSender& operator=(const NoticeSender&) = delete;

  /// `steps` are what the event is to the vehicles of its cells.
  void Push(const zone::HazardEvent& event, std::vector<zone::CellLog::Step> steps);

  std::uint64_t sent() const { return sent_; }
  std::uint64_t pictures() const { return pictures_; }

 private:
  struct News {
    zone::HazardEvent event;
    std::vector<zone::CellLog::Step> steps;
  };

  void Work();
  void Send(const News& news, bool with_picture);
  void SendToCell(HazardNotice notice, const zone::CellLog::Step& step) const;

  NoticePictures& all_pictures_;
  const Publishers publishers_;
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::uint64_t> pictures_{0};
  Mutex mutex_;
  std::deque<News> events_ GUARDED_BY(mutex_);
  bool closing_ GUARDED_BY(mutex_) = false;
  ConditionVariable changed_;
  std::thread thread_;
};

}  // namespace livemap::nodes
