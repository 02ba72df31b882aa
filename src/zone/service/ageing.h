#pragma once

#include <cstdint>
#include <vector>

#include "zone/polling/due_queue.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// Lets time pass for hazards that nobody speaks of: it knows when each of them changes next, and
/// makes that change.
///
/// Not thread-safe. The caller holds the writer's lock; Apply runs in a transaction.
class Ageing {
 public:
  using Slot = HazardRegistry::Slot;

  /// Both outlive it.
  Ageing(ZoneState& state, HazardSteps& steps);

  /// When the hazard changes next: to be called after each change to it.
  void Schedule(Slot slot);

  /// Hazards that are due, at most a few thousand; PutBack or Reschedule takes them back.
  std::vector<Slot> TakeDue(std::int64_t now_ns);
  /// What time has made due to them.
  void Apply(const std::vector<Slot>& due, ZoneTransaction& transaction);
  /// The transaction failed: they are due still.
  void PutBack(const std::vector<Slot>& due, std::int64_t now_ns);
  /// The transaction is committed.
  void Reschedule(const std::vector<Slot>& due, std::int64_t now_ns);

 private:
  std::int64_t NextChangeNs(Slot slot) const;

  ZoneState& state_;
  HazardSteps& steps_;
  DueQueue due_;
};

}  // namespace livemap::zone
