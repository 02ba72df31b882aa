#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/uuid.h"
#include "web/http_answer.h"
#include "web/official_gate.h"
#include "web/options.h"
#include "web/query.h"
#include "zone/zone_service.h"

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

/// The reason in a decision's body: JSON `{"reason": TEXT}`, printable UTF-8 of at most 200 bytes.
/// A rejection needs it; a confirmation may have an empty body or an empty object. Throws
/// BadRequest saying what is accepted.
std::string ParseDecisionBody(Decision decision, const std::string& body);

/// Officials' decisions about hazards. Thread-safe; store failures come out as exceptions.
class OfficialApi {
 public:
  /// Keeps references. Reads the token file of the options; throws Error when it is not accepted.
  OfficialApi(const WebOptions& options, ZoneService& zone, const HazardCatalogue& catalogue);

  /// Whether anybody may decide at all.
  bool is_open() const { return gate_.is_open(); }
  /// Answers a POST to a decision's address.
  HttpAnswer Decide(const DecisionTarget& target, const HttpQuestion& question);

 private:
  std::optional<HttpAnswer> WhyNotAllowed(const HttpQuestion& question, std::string& official);

  const WebOptions& options_;
  ZoneService& zone_;
  const HazardCatalogue& catalogue_;
  OfficialGate gate_;
};

}  // namespace livemap
