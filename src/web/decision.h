#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "web/query.h"

namespace livemap {

/// What an official may do with a hazard.
enum class Decision { kConfirm, kReject };

/// The address of a decision, "/api/v1/hazards/UUID/reject" or ".../confirm"; none for any other.
/// The id is not yet read.
struct DecisionTarget {
  Decision decision = Decision::kConfirm;
  std::string id;
};
std::optional<DecisionTarget> ParseDecisionTarget(std::string_view path);

/// With the official's name it still fits into an event's 200 bytes.
constexpr std::size_t kMaxDecisionReasonBytes = 120;

/// The reason in a decision's body: JSON `{"reason": TEXT}`, printable UTF-8 of at most
/// kMaxDecisionReasonBytes. A rejection needs it; a confirmation may have an empty body or an empty
/// object. Throws BadRequest saying what is accepted.
std::string ParseDecisionBody(Decision decision, const std::string& body);

}  // namespace livemap
