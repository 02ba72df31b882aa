#pragma once

#include <optional>
#include <string>

#include "web/api/official_authenticator.h"
#include "web/api/official_decision.h"
#include "web/http/http_message.h"
#include "web/http/options.h"
#include "zone/service/zone_service.h"

namespace livemap {

/// Officials' decisions about hazards, vehicles and map changes. Thread-safe; store failures come
/// out as exceptions.
class OfficialApi {
 public:
  /// Keeps references. Reads the token file of the options; throws Error when it is not accepted.
  OfficialApi(const WebOptions& options, ZoneService& zone, const HazardCatalogue& catalogue);

  /// Whether anybody may decide at all.
  bool is_open() const { return gate_.is_open(); }
  /// Answers a POST to a decision's address.
  HttpAnswer Decide(const DecisionTarget& target, const HttpQuestion& question);

 private:
  HttpAnswer DecideHazard(const DecisionTarget& target, const std::string& official,
                          const std::string& reason);
  HttpAnswer DecideMapChange(const DecisionTarget& target, const std::string& official,
                             const std::string& body);
  HttpAnswer Distrust(const std::string& vehicle, const std::string& official,
                      const std::string& reason);
  std::optional<HttpAnswer> WhyNotAllowed(const HttpQuestion& question, std::string& official);

  const WebOptions& options_;
  ZoneService& zone_;
  const HazardCatalogue& catalogue_;
  OfficialGate gate_;
};

}  // namespace livemap
