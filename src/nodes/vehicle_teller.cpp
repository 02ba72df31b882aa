#include "nodes/vehicle_teller.h"

#include <algorithm>
#include <utility>

#include "ros/hazard_conversions.h"

namespace livemap {
namespace {

constexpr std::size_t kPortion = 200;

}  // namespace

VehicleTeller::VehicleTeller(const ZoneService& zone, const ros::Publisher& publisher,
                             double radius_m, std::size_t max_hazards)
    : zone_(zone), publisher_(publisher), radius_m_(radius_m), max_hazards_(max_hazards) {}

/// All that drivers are told of around the place: the nearest, and the radius that those fill.
void VehicleTeller::CollectAll(Telling& telling) const {
  CatchUpOrder& order = telling.order;
  order.since = 0;
  telling.hazards = zone_.QueryNear(order.centre, radius_m_, max_hazards_);
  if (telling.hazards.size() < max_hazards_) return;
  telling.radius_m =
      telling.hazards.empty()
          ? 0
          : GeodesicDistanceM(order.centre, telling.hazards.back().position) * (1 - 1e-6);
}

void VehicleTeller::Begin() {
  Telling telling;
  telling.order = std::move(orders_.front());
  orders_.pop_front();
  telling.radius_m = radius_m_;
  // Before the hazards: what is announced in between is told twice rather than not at all.
  telling.up_to = zone_.AnnouncedSequence();
  const CatchUpOrder& order = telling.order;
  if (order.since > 0) {
    telling.hazards = zone_.ChangedAround(order.centre, radius_m_, order.since, max_hazards_ + 1);
  }
  if (order.since == 0 || telling.hazards.size() > max_hazards_) CollectAll(telling);
  current_ = std::move(telling);
}

std::optional<std::string> VehicleTeller::TellPortion(std::int64_t now_ns) {
  if (!current_) {
    if (orders_.empty()) return std::nullopt;
    Begin();
  }
  Telling& telling = *current_;
  const CatchUpOrder& order = telling.order;
  const std::size_t end = std::min(telling.told + kPortion, telling.hazards.size());
  for (; telling.told < end; ++telling.told) {
    const Hazard& hazard = telling.hazards[telling.told];
    const HazardAction there = order.since == 0 ? HazardAction::kAdded : HazardAction::kUpdated;
    const HazardAction action = IsTold(hazard.state) ? there : HazardAction::kRemoved;
    publisher_.publish(ToVehicleMessage(hazard, action, order.vehicle_id));
    ++notices_;
  }
  if (telling.told < telling.hazards.size()) return std::nullopt;
  Notice done;
  done.action = Notice::Action::kCaughtUp;
  done.vehicle_id = order.vehicle_id;
  done.sequence = telling.up_to;
  done.previous_sequence = order.known > telling.up_to ? order.known : order.since;
  done.position = order.centre;
  done.radius_m = telling.radius_m;
  done.told = static_cast<std::uint32_t>(telling.hazards.size());
  done.stamp_ns = now_ns;
  publisher_.publish(ToMessage(done));
  ++notices_;
  std::string vehicle = order.vehicle_id;
  current_.reset();
  return vehicle;
}

}  // namespace livemap
