#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "protocol/trail.h"
#include "zone/registry/vehicle_table.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// Keeps how the first vehicles that reported a hazard passed it. What they drove until then is
/// known with the report. Half a minute later they have passed, and the rest is added. No vehicle
/// is kept with its trail.
///
/// Not thread-safe. The caller holds the writer's lock; Note and Complete run in a transaction.
class TrailCollector {
 public:
  using Slot = HazardRegistry::Slot;

  /// A vehicle that reported a hazard and may be passing it still.
  struct Pass {
    Slot slot = 0;
    Uuid hazard;
    std::string vehicle_id;
    std::int64_t seen_ns = 0;  ///< Zone clock.
    std::int64_t due_ns = 0;   ///< The same: when it has passed.
    protocol::Trail begun;     ///< What is kept of it so far; empty: nothing.
  };

  /// All outlive it.
  TrailCollector(const ZoneConfig& config, ZoneState& state, const VehicleTable& vehicles)
      : config_(config), state_(state), vehicles_(vehicles) {}

  /// A vehicle has reported the hazard for the first time. `seen_ns` as HazardSteps::SeenNs has it.
  void Note(Slot slot, const std::string& vehicle_id, std::int64_t seen_ns,
            ZoneTransaction& transaction);
  /// Takes those that have passed by now. Where their transaction fails, what is kept of them stays
  /// as it is.
  std::vector<Pass> TakeDue(std::int64_t now_ns);
  void Complete(const std::vector<Pass>& passes, ZoneTransaction& transaction);

 private:
  void Keep(const Pass& pass, protocol::Trail trail, ZoneTransaction& transaction);

  const ZoneConfig& config_;
  ZoneState& state_;
  const VehicleTable& vehicles_;
  std::deque<Pass> passing_;  ///< In the order of their due times, about.
};

}  // namespace livemap::zone
