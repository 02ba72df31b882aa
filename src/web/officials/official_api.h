#pragma once

#include <string>

#include "web/access/access.h"
#include "web/api/query.h"
#include "web/http/http_message.h"
#include "web/officials/official_decision.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Officials' decisions about hazards, vehicles and map changes. Thread-safe; store failures come
/// out as exceptions.
class OfficialApi {
 public:
  /// Keeps references.
  OfficialApi(Access& access, zone::ZoneService& zone, const protocol::HazardCatalogue& catalogue)
      : access_(access), zone_(zone), catalogue_(catalogue) {}

  /// Answers a POST to a decision's address.
  HttpResponse Decide(const DecisionTarget& target, const HttpRequest& question);
  /// Answers a GET of it: what the decision would do (HasPreview), for officials only.
  HttpResponse Preview(const DecisionTarget& target, const HttpRequest& question);

  /// Answers `GET /api/v1/decisions`: who decided what.
  HttpResponse Decisions(const DecisionsQuery& query) const;

 private:
  HttpResponse DecideAs(const std::string& official, const DecisionTarget& target,
                        const HttpRequest& question);
  HttpResponse DecideNow(const std::string& official, const DecisionTarget& target,
                         const HttpRequest& question);
  HttpResponse DecideHazard(const DecisionTarget& target, const std::string& official,
                            const DecisionBody& body);
  HttpResponse ActAtDesk(const DecisionTarget& target, const std::string& official,
                         const std::string& body);
  HttpResponse UndoHazard(const std::string& id, const std::string& official,
                          const DecisionBody& body);
  HttpResponse DecideMapChange(const DecisionTarget& target, const std::string& official,
                               const std::string& body);
  HttpResponse DecideVehicle(const DecisionTarget& target, const std::string& official,
                             const std::string& reason);
  const char* KindOfSubject(const zone::DecisionRecord& decision) const;
  HttpResponse PreviewDistrust(const std::string& vehicle) const;

  Access& access_;
  zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
};

}  // namespace livemap::web
