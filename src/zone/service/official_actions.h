#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "zone/model/map_change.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// What officials decide about hazards, map changes and vehicles.
///
/// Not thread-safe. CheckedReason needs no lock; for the others the caller holds the writer's lock,
/// and functions with a transaction are called while that runs.
class OfficialActions {
 public:
  using Slot = HazardRegistry::Slot;

  /// A decision that leads to a transition of the hazard.
  struct HazardDecision {
    Slot slot = 0;
    PresenceRecord life;  ///< As it is afterwards.
    LifecycleUpdate step;
  };

  /// All outlive it.
  OfficialActions(const ZoneConfig& config, ZoneState& state, HazardSteps& steps);

  /// The official's reason, cut to an event's length. Throws Error when it or the official's name
  /// is no acceptable text; an empty reason is acceptable.
  std::string CheckedReason(const std::string& official, const std::string& reason) const;

  /// What it means to confirm or to reject the hazard now; none when there is no such hazard, or
  /// nothing to decide about it. `why`: a checked reason.
  std::optional<HazardDecision> Confirm(const Uuid& hazard, const std::string& official,
                                        const std::string& why, std::int64_t now_ns) const;
  std::optional<HazardDecision> Reject(const Uuid& hazard, const std::string& official,
                                       const std::string& why, std::int64_t now_ns) const;
  /// What it means to take the hazard off the map for good.
  std::optional<HazardDecision> Remove(const Uuid& hazard, const std::string& reason,
                                       std::int64_t now_ns) const;
  void Apply(const HazardDecision& decision, ZoneTransaction& transaction);

  /// Confirms or dismisses a map change (MapChangeRegistry::Decide); no event follows when there is
  /// none to decide about.
  void DecideMapChange(const Uuid& feature, MapChangeState to, const std::string& official,
                       const std::string& why, ZoneTransaction& transaction);

  /// Distrusts a vehicle and withdraws what it said of `slots`. `why`: the events' reason.
  void Distrust(std::uint64_t vehicle, const std::vector<Slot>& slots, const std::string& why,
                ZoneTransaction& transaction);

 private:
  const ZoneConfig& config_;
  ZoneState& state_;
  HazardSteps& steps_;
};

}  // namespace livemap::zone
