#pragma once

#include <optional>
#include <string>

#include "web/api/official_authenticator.h"
#include "web/api/official_decision.h"
#include "web/http/http_message.h"
#include "web/http/web_config.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Officials' decisions about hazards, vehicles and map changes. Thread-safe; store failures come
/// out as exceptions.
class OfficialApi {
 public:
  /// Keeps references. Reads the token file of the options; throws Error when it is not accepted.
  OfficialApi(const WebConfig& options, zone::ZoneService& zone,
              const protocol::HazardCatalogue& catalogue);

  /// Whether anybody may decide at all.
  bool is_open() const { return gate_.is_open(); }
  /// Answers a POST to a decision's address.
  HttpResponse Decide(const DecisionTarget& target, const HttpRequest& question);

 private:
  HttpResponse DecideHazard(const DecisionTarget& target, const std::string& official,
                            const std::string& reason);
  HttpResponse DecideMapChange(const DecisionTarget& target, const std::string& official,
                               const std::string& body);
  HttpResponse Distrust(const std::string& vehicle, const std::string& official,
                        const std::string& reason);
  std::optional<HttpResponse> WhyNotAllowed(const HttpRequest& question, std::string& official);

  const WebConfig& options_;
  zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
  OfficialAuthenticator gate_;
};

}  // namespace livemap::web
