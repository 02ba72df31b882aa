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
  bool is_open() const { return authenticator_.is_open(); }
  /// Whether the request has a token that Decide would accept; a wrong one is not counted.
  bool HasRightToken(const HttpRequest& question) const;
  /// Whether the request has a valid token; a wrong one is counted.
  bool IsOfficial(const HttpRequest& question);
  /// Answers a POST to a decision's address.
  HttpResponse Decide(const DecisionTarget& target, const HttpRequest& question);
  /// Answers a GET of it: what the decision would do (HasPreview), for officials only.
  HttpResponse Preview(const DecisionTarget& target, const HttpRequest& question);

 private:
  HttpResponse DecideAs(const std::string& official, const DecisionTarget& target,
                        const HttpRequest& question);
  HttpResponse DecideNow(const std::string& official, const DecisionTarget& target,
                         const HttpRequest& question);
  HttpResponse DecideHazard(const DecisionTarget& target, const std::string& official,
                            const DecisionBody& body);
  HttpResponse UndoHazard(const std::string& id, const std::string& official,
                          const DecisionBody& body);
  HttpResponse DecideMapChange(const DecisionTarget& target, const std::string& official,
                               const std::string& body);
  HttpResponse DecideVehicle(const DecisionTarget& target, const std::string& official,
                             const std::string& reason);
  HttpResponse PreviewDistrust(const std::string& vehicle) const;
  std::optional<HttpResponse> WhyNotAllowed(const HttpRequest& question, std::string& official);

  const WebConfig& options_;
  zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
  OfficialAuthenticator authenticator_;
};

}  // namespace livemap::web
