#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "web/api/query.h"
#include "web/officials/official_decision.h"
#include "zone/desk/desk_action.h"

namespace livemap::web {

/// Reads the body of a desk's decision (IsDeskDecision), a JSON object:
///   comment  {"text": TEXT} of 1 to zone::kMaxDecisionTextBytes bytes of printable UTF-8;
///   assign   {"team": TEXT or null, "due": "YYYY-MM-DD" or null}, "due" only with a team;
///   class    {"class": TEXT};
///   move     {"position": [LONGITUDE, LATITUDE]} in degrees;
///   merge    {"other": UUID}: the hazard that is gone afterwards;
///   frame    {}, or no body at all.
/// All but the comment may have a "reason" of at most kMaxDecisionReasonBytes. Throws BadRequest
/// saying what is accepted.
zone::DeskAction ParseDeskAction(Decision decision, const std::string& body);

/// What `GET /api/v1/statistics` asks for.
struct StatisticsQuery {
  std::size_t weeks = 12;  ///< 1 to 520: so many weeks back, the present one included.
};

/// Reads `weeks`; refuses every other parameter.
StatisticsQuery ParseStatisticsQuery(const RequestTarget& target);

/// Nanoseconds since 1970 of the begin of a day "YYYY-MM-DD" from 1970 to 2105, UTC; none for
/// anything else.
std::optional<std::int64_t> ParseDay(const std::string& text);

}  // namespace livemap::web
