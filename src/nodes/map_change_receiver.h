#pragma once

#include <livemap/MapChange.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>

#include <cstdint>
#include <vector>

#include "common/mutex.h"
#include "protocol/map_change_report.h"
#include "zone/inbox/zone_inbox.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// Where vehicles tell the zone of map changes: `change/map_change` in, `change/receipt` out. The
/// callbacks' thread puts them into the inbox, the node's worker commits them.
class MapChangeReceiver {
 public:
  struct Counters {
    std::uint64_t received = 0;
    std::uint64_t malformed = 0;   ///< Answered REFUSED: an unknown schema or direction.
    std::uint64_t not_queued = 0;  ///< Too many wait: their vehicles send them again.
  };

  /// `zone` and `inbox` outlive it.
  MapChangeReceiver(ros::NodeHandle node, zone::ZoneService& zone, zone::ZoneInbox& inbox);
  /// Nothing is taken any more; what waits can still be committed.
  void Close() { subscriber_.shutdown(); }

  /// Commits a batch and answers it. Throws StoreError: then the batch is not answered, and its
  /// vehicles send it again.
  void Commit(const std::vector<protocol::MapChangeReport>& reports);
  Counters counters() const;

 private:
  void OnMapChange(const MapChange& message);

  zone::ZoneService& zone_;
  zone::ZoneInbox& inbox_;
  mutable Mutex mutex_;
  Counters counters_ GUARDED_BY(mutex_);
  ros::Publisher receipt_publisher_;
  ros::Subscriber subscriber_;
};

}  // namespace livemap::nodes
