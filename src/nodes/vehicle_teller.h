#pragma once

#include <ros/publisher.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "zone/catch_up.h"
#include "zone/zone_service.h"

namespace livemap {

/// Tells single vehicles what they missed or have around them, in portions, so that notices of new
/// hazards are not held up and nobody's queue overflows. Not thread-safe.
class VehicleTeller {
 public:
  VehicleTeller(const ZoneService& zone, const ros::Publisher& publisher, double radius_m,
                std::size_t max_hazards);

  void Add(CatchUpOrder order) { orders_.push_back(std::move(order)); }
  bool busy() const { return current_.has_value() || !orders_.empty(); }
  /// Publishes the next portion. Returns the vehicle that has been told everything, if one has.
  std::optional<std::string> TellPortion(std::int64_t now_ns);
  std::uint64_t notices() const { return notices_; }

 private:
  struct Telling {
    CatchUpOrder order;
    std::uint64_t up_to = 0;
    double radius_m = 0;
    std::vector<Hazard> hazards;
    std::size_t told = 0;
  };

  void Begin();
  void CollectAll(Telling& telling) const;

  const ZoneService& zone_;
  const ros::Publisher publisher_;
  const double radius_m_;
  const std::size_t max_hazards_;
  std::deque<CatchUpOrder> orders_;
  std::optional<Telling> current_;
  std::uint64_t notices_ = 0;
};

}  // namespace livemap
