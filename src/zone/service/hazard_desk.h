#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/uuid.h"
#include "zone/desk/desk_action.h"
#include "zone/desk/redirects.h"
#include "zone/model/decision.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// What officials do with hazards beside saying whether they are there: they comment, assign, name
/// another class, move and merge, and ask for a whole frame (which PollCoordinator sees to). Each
/// is a decision of the audit trail and can be taken back. Vehicles' later reports do not undo an
/// edit: see Redirect.
///
/// Not thread-safe. The caller holds the writer's lock; functions with a transaction are called
/// while that runs.
class HazardDesk {
 public:
  using Slot = HazardRegistry::Slot;

  /// What was done, for Keep.
  struct Done {
    std::uint64_t decision = 0;     ///< Id of its record.
    std::optional<Redirect> added;  ///< By it.
    std::uint64_t dropped = 0;      ///< The decision whose redirect fell; 0: none.
  };

  /// Both outlive it.
  HazardDesk(ZoneState& state, HazardSteps& steps);

  /// Whether the hazard is known. Throws Error for an action that is not acceptable (a text, the
  /// class), and DecisionConflict for one that does not fit what is there: the hazard or the other
  /// one is not on the map, is there already, or is too far away.
  bool Check(const Uuid& hazard, const DeskAction& action) const;
  /// Does what Check accepted.
  Done Apply(const Uuid& hazard, const std::string& official, const DeskAction& action,
             ZoneTransaction& transaction);

  /// The desk's decision about the hazard that an undo means: that with the id `meant`, or else the
  /// newest decision about it, unless that is a comment, an assignment or a request for a frame.
  /// None where the undo means no decision of the desk.
  std::optional<DecisionRecord> MeantBy(const Uuid& hazard,
                                        std::optional<std::uint64_t> meant) const;
  /// Whether it can be taken back now; else the sentence says why not. A comment, a merge and a
  /// request for a frame can be at any time, of the others only the newest of its kind.
  std::optional<std::string> WhyNotUndoable(const DecisionRecord& decision) const;
  Done Undo(const DecisionRecord& decision, const std::string& official, const std::string& why,
            ZoneTransaction& transaction);

  /// After the transaction is committed.
  void Keep(const Done& done);

 private:
  Slot SlotOnMap(const Uuid& hazard, const char* which) const;
  void CheckMerge(const Uuid& hazard, Slot slot, const DeskAction& action) const;
  Done Assign(DecisionRecord record, const Uuid& hazard, const DeskAction& action);
  Done Reclass(DecisionRecord record, Slot slot, const DeskAction& action,
               ZoneTransaction& transaction);
  Done Move(DecisionRecord record, Slot slot, const DeskAction& action,
            ZoneTransaction& transaction);
  Done Merge(DecisionRecord record, Slot slot, const DeskAction& action,
             ZoneTransaction& transaction);
  Done WriteEdit(const DecisionRecord& record, Redirect redirect);
  void Edit(Slot slot, const std::string& class_name, const HazardEstimate& estimate,
            const std::string& reason, ZoneTransaction& transaction);
  void TakeBack(const DecisionRecord& decision, const std::string& reason,
                ZoneTransaction& transaction);
  void TakeBackAssignment(const DecisionRecord& decision, const Uuid& hazard);
  void Split(const DecisionRecord& decision, Slot slot, const std::string& reason,
             ZoneTransaction& transaction);
  std::optional<Assignment> AssignmentOf(const Uuid& hazard) const;

  ZoneState& state_;
  HazardSteps& steps_;
};

}  // namespace livemap::zone
