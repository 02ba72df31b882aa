#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "web/api/query.h"
#include "zone/model/decision.h"

namespace livemap::web {

/// What an official may do with a hazard, with a vehicle (kDistrust, kTrust) or with a map change,
/// whose decision stands in the body (kMapChange).
enum class Decision {
  kConfirm,
  kReject,
  kUndo,
  kDistrust,
  kTrust,
  kMapChange,
  kClose,
  kComment,
  kAssign,
  kClass,
  kMove,
  kMerge,
  kFrame
};

/// Whether the decision leaves alone whether the hazard is there (zone::HazardDesk).
constexpr bool IsDeskDecision(Decision decision) {
  return decision == Decision::kComment || decision == Decision::kAssign ||
         decision == Decision::kClass || decision == Decision::kMove ||
         decision == Decision::kMerge || decision == Decision::kFrame;
}

/// Whether a GET of the decision's address says what the decision would do.
constexpr bool HasPreview(Decision decision) { return decision == Decision::kDistrust; }

/// Whether there is anything to GET at the decision's address.
constexpr bool CanBeRead(Decision decision) {
  return HasPreview(decision) || decision == Decision::kFrame;
}

/// The address of a decision: "/api/v1/hazards/UUID/" with confirm, reject, undo, close, comment,
/// assign, class, move, merge or frame, "/api/v1/vehicles/NAME/distrust" or ".../trust",
/// "/api/v1/changes/UUID/decision"; none for any other. The id is not yet read.
struct DecisionTarget {
  Decision decision = Decision::kConfirm;
  std::string id;  ///< Of the hazard or the map change, or the vehicle's name.
};
std::optional<DecisionTarget> ParseDecisionTarget(std::string_view path);

/// With the official's name it still fits into an event's 200 bytes.
constexpr std::size_t kMaxDecisionReasonBytes = 120;

/// What a decision's body says.
struct DecisionBody {
  std::string reason;                        ///< May be empty unless one is needed.
  std::optional<std::uint64_t> decision_id;  ///< Of an undo: the decision that is meant.
  /// Of a confirmation or a rejection: what the official saw of the hazard.
  std::optional<zone::SeenHazard> seen;
};
/// Of those that are no desk's. Reads JSON `{"reason": TEXT}`, of an undo also `{"reason": TEXT,
/// "decision_id": NUMBER}`, of a confirmation, a rejection or a repair also `{"reason": TEXT,
/// "sequence": NUMBER, "position": [LONGITUDE, LATITUDE]}`, the position only with the sequence.
/// The reason is printable UTF-8 of at most kMaxDecisionReasonBytes that is not all blanks. A
/// rejection and a distrust need a reason; the others may have an empty body or leave the reason
/// out. Throws BadRequest saying what is accepted.
DecisionBody ParseDecisionBody(Decision decision, const std::string& body);

/// What an official decided about a map change.
struct MapChangeDecision {
  bool confirms = false;                     ///< Else, unless it undoes, it is dismissed.
  bool undoes = false;                       ///< The newest decision is taken back.
  std::string reason;                        ///< May be empty unless it is dismissed.
  std::optional<std::uint64_t> decision_id;  ///< Of an undo: the decision that is meant.
};
/// Reads `{"decision": "confirm" | "dismiss" | "undo", "reason": TEXT}`, the reason as above; of an
/// undo also "decision_id". Throws BadRequest saying what is accepted.
MapChangeDecision ParseMapChangeDecision(const std::string& body);

}  // namespace livemap::web
