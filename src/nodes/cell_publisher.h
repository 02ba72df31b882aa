#pragma once

#include <ros/publisher.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <unordered_map>

#include "protocol/cell_news.h"
#include "zone/registry/cell_log.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// Answers what vehicles ask about cells, in portions, so that notices of new hazards are not held
/// up. Not thread-safe.
class CellPublisher {
 public:
  /// `zone` and `log` outlive it.
  CellPublisher(const zone::ZoneService& zone, const zone::CellLog& log,
                const ros::Publisher& publisher);

  /// What a vehicle asks while it waits for an answer is answered together.
  void Add(protocol::CellRequest request);
  /// The vehicle, of which the zone knows nothing, is to ask. From any thread.
  void Invite(const std::string& vehicle_id) const;
  bool busy() const { return !waiting_.empty(); }
  /// Publishes the next portion of answers.
  void PublishBatch();

  /// Cells that vehicles were told of, and hazards in them.
  std::uint64_t cells() const { return cells_; }
  std::uint64_t hazards() const { return hazards_; }

 private:
  protocol::CellNews::Cell Read(const protocol::CellRequest::Cell& asked) const;
  std::size_t Answer(const protocol::CellRequest& request);

  const zone::ZoneService& zone_;
  const zone::CellLog& log_;
  const ros::Publisher publisher_;
  std::deque<std::string> waiting_;  ///< Vehicles, in the order of their requests.
  std::unordered_map<std::string, protocol::CellRequest> requests_;  ///< By vehicle.
  std::uint64_t cells_ = 0;
  std::uint64_t hazards_ = 0;
};

}  // namespace livemap::nodes
