#pragma once

#include <livemap/MapChange.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>

#include "protocol/map_change_report.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// Where vehicles tell the zone of map changes: `change/map_change` in, `change/receipt` out. The
/// callbacks' thread queues, the node's worker commits.
class MapChangeReceiver {
 public:
  struct Counters {
    std::uint64_t received = 0;
    std::uint64_t malformed = 0;   ///< Answered REFUSED: an unknown schema or direction.
    std::uint64_t not_queued = 0;  ///< Too many wait: their vehicles send them again.
    std::size_t waiting = 0;
  };

  /// `zone` outlives it. At most `batch` are committed at once.
  MapChangeReceiver(ros::NodeHandle node, zone::ZoneService& zone, std::size_t batch);
  /// Nothing is taken any more; what waits can still be committed.
  void Close() { subscriber_.shutdown(); }

  /// Commits the next batch of what waits and answers it; false when nothing waited. Throws
  /// StoreError: then the batch is not answered, and its vehicles send it again.
  bool CommitWaiting();
  Counters counters() const;

 private:
  void OnMapChange(const MapChange& message);

  zone::ZoneService& zone_;
  const std::size_t batch_;
  mutable std::mutex mutex_;  ///< Guards the next two.
  std::deque<protocol::MapChangeReport> waiting_;
  Counters counters_;
  ros::Publisher receipt_publisher_;
  ros::Subscriber subscriber_;
};

}  // namespace livemap::nodes
