#pragma once

#include <string>
#include <string_view>

#include "protocol/hazard_catalogue.h"
#include "web/api/map_change_api.h"
#include "web/api/official_api.h"
#include "web/api/query.h"
#include "web/api/vehicle_trails.h"
#include "web/http/http_message.h"
#include "web/http/options.h"
#include "web/http/static_files.h"
#include "zone/pictures/served_pictures.h"
#include "zone/service/zone_service.h"

namespace livemap {

/// Answers every HTTP request but the live stream's: pages, pictures and `/api/v1` (docs/web.md).
/// Thread-safe; never throws.
class Api {
 public:
  /// Keeps references to all but `options`. Throws Error when the token file is not accepted.
  Api(const WebOptions& options, ZoneService& zone, const HazardCatalogue& catalogue,
      const VehicleTrails& trails);

  HttpAnswer Answer(const HttpQuestion& question);

  /// A JSON answer `{"error": sentence}` with the server's security headers.
  HttpAnswer ErrorAnswer(int status, const std::string& sentence) const;

 private:
  HttpAnswer AnswerPost(const HttpQuestion& question);
  HttpAnswer Route(const RequestTarget& target, const HttpQuestion& question);
  HttpAnswer RouteApi(const RequestTarget& target) const;
  HttpAnswer Hazards(const HazardQuery& query) const;
  HttpAnswer OneHazard(const std::string& id) const;
  HttpAnswer Events(const std::string& id, std::size_t limit) const;
  HttpAnswer Vehicles() const;
  HttpAnswer PageConfig() const;
  HttpAnswer Picture(const std::string& sha256, const HttpQuestion& question);
  HttpAnswer File(const StaticFiles& files, std::string_view name,
                  const HttpQuestion& question) const;

  const WebOptions options_;
  ZoneService& zone_;
  const HazardCatalogue& catalogue_;
  const VehicleTrails& trails_;
  OfficialApi officials_;
  const MapChangeApi map_changes_;
  ServedPictures pictures_;
  const StaticFiles page_;
  const StaticFiles leaflet_;
  const std::string page_policy_;  ///< Content-Security-Policy of the page.
};

}  // namespace livemap
