#pragma once

#include <string>
#include <string_view>

#include "protocol/hazard_catalogue.h"
#include "web/api/map_change_api.h"
#include "web/api/official_api.h"
#include "web/api/query.h"
#include "web/api/vehicle_trails.h"
#include "web/http/http_message.h"
#include "web/http/static_files.h"
#include "web/http/web_config.h"
#include "zone/pictures/picture_cache.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Answers every HTTP request but the live stream's: pages, pictures and `/api/v1`
/// (docs/reference/http-api.md). Thread-safe; never throws.
class Api {
 public:
  /// Keeps references to all but `options`. Throws Error when the token file is not accepted.
  Api(const WebConfig& options, zone::ZoneService& zone, const protocol::HazardCatalogue& catalogue,
      const VehicleTrails& trails);

  HttpResponse Answer(const HttpRequest& question);

  /// A JSON answer `{"error": sentence}` with the server's security headers.
  HttpResponse ErrorAnswer(int status, const std::string& sentence) const;

 private:
  HttpResponse AnswerPost(const HttpRequest& question);
  HttpResponse Route(const RequestTarget& target, const HttpRequest& question);
  HttpResponse RouteApi(const RequestTarget& target) const;
  HttpResponse Hazards(const HazardQuery& query) const;
  HttpResponse OneHazard(const std::string& id) const;
  HttpResponse Events(const std::string& id, std::size_t limit) const;
  HttpResponse Vehicles() const;
  HttpResponse PageConfig() const;
  HttpResponse Picture(const std::string& sha256, const HttpRequest& question);
  HttpResponse File(const StaticFiles& files, std::string_view name,
                    const HttpRequest& question) const;

  const WebConfig options_;
  zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
  const VehicleTrails& trails_;
  OfficialApi officials_;
  const MapChangeApi map_changes_;
  zone::PictureCache pictures_;
  const StaticFiles page_;
  const StaticFiles leaflet_;
  const std::string page_policy_;  ///< Content-Security-Policy of the page.
};

}  // namespace livemap::web
