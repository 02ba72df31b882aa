#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "zone/model/decision.h"
#include "zone/model/map_change.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// What officials decide about hazards, map changes and vehicles, and how they take it back. Every
/// decision is stored with what was before.
///
/// Not thread-safe. CheckedReason needs no lock; for the others the caller holds the writer's lock,
/// and functions with a transaction are called while that runs.
class OfficialActions {
 public:
  using Slot = HazardRegistry::Slot;

  /// A decision about a hazard.
  struct HazardDecision {
    Slot slot = 0;
    PresenceRecord life;  ///< As it is afterwards.
    LifecycleUpdate step;
    /// To be stored; none for what no official decides.
    std::optional<DecisionRecord> record;
    std::optional<DecisionRecord> undone;  ///< The decision that it takes back.
    std::uint64_t repeats = 0;  ///< Id of the decision that said so already: nothing follows.
  };
  /// What came of an undo.
  enum class Undone {
    kDone,
    kBefore,   ///< The newest decision was taken back already: nothing follows.
    kNothing,  ///< No decision is known.
    kOther,    ///< The newest decision is another one than was meant: nothing follows.
    kGone,     ///< The hazard is gone, the map change is undone.
    kUnknown,  ///< There is no such hazard or map change.
  };

  /// All outlive it.
  OfficialActions(const ZoneConfig& config, ZoneState& state, HazardSteps& steps);

  /// The official's reason, cut to an event's length. Throws Error when it or the official's name
  /// is no acceptable text; an empty reason is acceptable, one of blanks is not.
  std::string CheckedReason(const std::string& official, const std::string& reason) const;

  /// What it means to confirm or to reject the hazard now; none when there is no such hazard, or
  /// nothing to decide about it. `why`: a checked reason. Throws StoreError, and DecisionConflict
  /// when the hazard is not what it was when it was `seen`.
  std::optional<HazardDecision> Confirm(const Uuid& hazard, const std::string& official,
                                        const std::string& why,
                                        const std::optional<SeenHazard>& seen,
                                        std::int64_t now_ns) const;
  std::optional<HazardDecision> Reject(const Uuid& hazard, const std::string& official,
                                       const std::string& why,
                                       const std::optional<SeenHazard>& seen,
                                       std::int64_t now_ns) const;
  /// The same of one that was there and is repaired (HazardLifecycle::Close).
  std::optional<HazardDecision> Close(const Uuid& hazard, const std::string& official,
                                      const std::string& why, const std::optional<SeenHazard>& seen,
                                      std::int64_t now_ns) const;
  /// What it means to take the newest of these decisions back, if it is the one that is meant
  /// (`meant`: its id; none for whichever it is); none unless `undone` is kDone.
  std::optional<HazardDecision> Undo(const Uuid& hazard, const std::string& official,
                                     const std::string& why, std::optional<std::uint64_t> meant,
                                     std::int64_t now_ns, Undone& undone) const;
  /// What it means to verify the hazard (HazardLifecycle::Doubt), for the reason `why`; none where
  /// drivers are not told of it.
  std::optional<HazardDecision> Verify(const Uuid& hazard, const std::string& why,
                                       std::int64_t now_ns) const;
  /// What it means to take the hazard off the map for good.
  std::optional<HazardDecision> Remove(const Uuid& hazard, const std::string& reason,
                                       std::int64_t now_ns) const;
  /// Returns the id of the decision's record; 0 where none is stored.
  std::uint64_t Apply(const HazardDecision& decision, ZoneTransaction& transaction);

  /// The id of the newest decision about the map change, if it is this very one and holds.
  std::optional<std::uint64_t> RepeatOf(const Uuid& feature, MapChangeState to,
                                        const std::string& official, const std::string& why) const;
  /// Confirms or dismisses a map change (MapChangeRegistry::Decide); no event follows when there is
  /// none to decide about. Returns the id of the decision's record; 0 when no event follows.
  std::uint64_t DecideMapChange(const Uuid& feature, MapChangeState to, const std::string& official,
                                const std::string& why, ZoneTransaction& transaction);
  /// The newest decision about the map change, if it can be taken back and is the one that is
  /// meant, as of Undo.
  std::optional<DecisionRecord> UndoableOf(const Uuid& feature, std::optional<std::uint64_t> meant,
                                           Undone& undone) const;
  void UndoMapChange(const DecisionRecord& decision, const std::string& official,
                     const std::string& why, ZoneTransaction& transaction);

  /// Whether a distrust of the vehicle stands.
  bool IsDistrusted(const std::string& vehicle_id) const;
  /// What a piece of a decision about a vehicle did.
  struct VehiclePiece {
    std::uint64_t decision = 0;  ///< Id of its record; 0: nothing was recorded.
    std::size_t hazards = 0;     ///< Changed by this piece.
    bool is_last = false;
  };
  /// Distrusts a vehicle and withdraws what it said of `slots`; `decision` is the record of the
  /// pieces before, 0 for the first one. Throws DecisionConflict when that was taken back since:
  /// what is withdrawn under it would never be given back.
  VehiclePiece Distrust(const std::string& vehicle_id, const std::vector<Slot>& slots,
                        const std::string& official, const std::string& why, std::uint64_t decision,
                        ZoneTransaction& transaction);
  /// Takes the next piece of the newest distrust back that stands.
  VehiclePiece Trust(const std::string& vehicle_id, std::size_t max_hazards,
                     const std::string& official, const std::string& why, std::uint64_t decision,
                     ZoneTransaction& transaction);
  /// Adds what distrust would do to `slots` to the preview.
  void Preview(std::uint64_t vehicle, const std::vector<Slot>& slots, std::int64_t now_ns,
               DistrustPreview& preview) const;
  /// The newest decisions about a vehicle, a hazard or a map change.
  std::vector<DecisionRecord> Decisions(const std::string& subject, std::size_t limit) const;

 private:
  using LifecycleRule = decltype(&HazardLifecycle::Confirm);

  std::optional<HazardDecision> Decide(const Uuid& hazard, const std::string& official,
                                       const std::string& why,
                                       const std::optional<SeenHazard>& seen, std::int64_t now_ns,
                                       DecisionKind kind) const;
  void RequireAsSeen(Slot slot, const SeenHazard& seen) const;
  std::set<std::uint64_t> WithdrawnSince(const PresenceRecord& before, const PresenceRecord& life,
                                         std::uint64_t trusted, std::int64_t now_ns) const;
  bool Restore(const Withdrawal& withdrawal, std::uint64_t vehicle, const std::string& why,
               ZoneTransaction& transaction);
  std::function<double(std::uint64_t)> MaliciousOf(std::int64_t now_ns) const;

  const ZoneConfig& config_;
  ZoneState& state_;
  HazardSteps& steps_;
};

}  // namespace livemap::zone
