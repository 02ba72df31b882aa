#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "web/api/query.h"

namespace livemap::web {

/// What an official may do with a hazard, with a vehicle (kDistrust) or with a map change, whose
/// decision stands in the body (kMapChange).
enum class Decision { kConfirm, kReject, kDistrust, kMapChange };

/// The address of a decision: "/api/v1/hazards/UUID/reject" or ".../confirm",
/// "/api/v1/vehicles/NAME/distrust", "/api/v1/changes/UUID/decision"; none for any other. The id is
/// not yet read.
struct DecisionTarget {
  Decision decision = Decision::kConfirm;
  std::string id;  ///< Of the hazard or the map change, or the vehicle's name.
};
std::optional<DecisionTarget> ParseDecisionTarget(std::string_view path);

/// With the official's name it still fits into an event's 200 bytes.
constexpr std::size_t kMaxDecisionReasonBytes = 120;

/// The reason in a decision's body: JSON `{"reason": TEXT}`, printable UTF-8 of at most
/// kMaxDecisionReasonBytes. A confirmation may have an empty body or an empty object, the others
/// need a reason. Throws BadRequest saying what is accepted.
std::string ParseDecisionBody(Decision decision, const std::string& body);

/// What an official decided about a map change.
struct MapChangeDecision {
  bool confirms = false;  ///< Else it is dismissed.
  std::string reason;     ///< May be empty where it confirms.
};
/// Reads `{"decision": "confirm" | "dismiss", "reason": TEXT}`, the reason as above. Throws
/// BadRequest saying what is accepted.
MapChangeDecision ParseMapChangeDecision(const std::string& body);

}  // namespace livemap::web
