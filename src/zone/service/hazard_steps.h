#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "protocol/report.h"
#include "zone/belief/hazard_lifecycle.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// Applies the lifecycle's rules to the zone's hazards, one step at a time: ReportIntake,
/// PollCoordinator, OfficialActions and Ageing all change hazards through it. It holds no state of
/// its own.
///
/// Not thread-safe. The caller holds the writer's lock; functions with a transaction are called
/// while that runs.
class HazardSteps {
 public:
  using Slot = HazardRegistry::Slot;

  /// Both outlive it. Throws Error for an impossible setting of the lifecycle.
  HazardSteps(const ZoneConfig& config, ZoneState& state);

  const HazardLifecycle& lifecycle() const { return lifecycle_; }
  /// What is known of the hazard's class.
  ClassModel ClassOf(Slot slot) const;
  /// When something was seen, by an image's stamp; see ZoneConfig::replay.
  std::int64_t SeenNs(std::int64_t stamp_ns, std::int64_t now_ns) const {
    return config_.replay ? now_ns : stamp_ns;
  }
  /// What a vehicle says of a hazard, with how far it is believed.
  Evidence EvidenceOf(EvidenceKind kind, const std::string& vehicle_id, std::int64_t stamp_ns,
                      std::int64_t now_ns) const;

  /// The map's hazard that the report is a sighting of, after time has done what is due to it.
  /// Where the zone knows its streets, a hazard on the other carriageway of the street is another
  /// one (streets::LieOnOppositeCarriageways). `course_rad` is of the pass; NaN: not known.
  std::optional<Slot> MatchNow(const protocol::Report& report, double course_rad,
                               ZoneTransaction& transaction);
  /// Does what time has made due; false when that was nothing.
  bool PassTime(Slot slot, ZoneTransaction& transaction);
  /// `life` is what `step` made of the hazard's life: it is kept and taught, without an event.
  void Keep(Slot slot, const PresenceRecord& life, const LifecycleUpdate& step,
            ZoneTransaction& transaction);
  /// As Keep, as an event of its own sequence.
  void KeepAsEvent(Slot slot, const PresenceRecord& life, const LifecycleUpdate& step,
                   const std::string& reason, const ZoneTransaction::Before& before,
                   ZoneTransaction& transaction);

 private:
  std::optional<Slot> FindMatch(const protocol::Report& report, double course_rad) const;
  std::optional<Slot> FindRedirected(const std::string& class_name, const geo::GeoPoint& position,
                                     const std::function<bool(Slot)>& may_match) const;

  const ZoneConfig& config_;
  ZoneState& state_;
  const HazardLifecycle lifecycle_;
};

}  // namespace livemap::zone
