#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hazard/catalogue.h"
#include "web/options.h"
#include "web/query.h"
#include "web/static_files.h"
#include "web/vehicle_trails.h"
#include "zone/zone_service.h"

namespace livemap {

/// What the router needs to know of an HTTP request.
struct HttpQuestion {
  std::string method;
  std::string target;         ///< As it stands in the request line.
  std::string if_none_match;  ///< Header value, empty where absent.
};

/// An HTTP answer before it goes onto the wire. The content of an answer to HEAD is dropped there.
struct HttpAnswer {
  int status = 200;
  std::string content_type;
  std::string content;
  std::vector<std::pair<std::string, std::string>> headers;
};

/// Answers every HTTP request but the live stream's: pages, pictures and `/api/v1` (docs/web.md).
/// Thread-safe; never throws.
class Api {
 public:
  /// Keeps references to all but `options`.
  Api(const WebOptions& options, ZoneService& zone, const HazardCatalogue& catalogue,
      const VehicleTrails& trails);

  HttpAnswer Answer(const HttpQuestion& question) const;

  /// A JSON answer `{"error": sentence}` with the server's security headers.
  HttpAnswer ErrorAnswer(int status, const std::string& sentence) const;

 private:
  HttpAnswer Route(const RequestTarget& target, const HttpQuestion& question) const;
  HttpAnswer RouteApi(const RequestTarget& target) const;
  HttpAnswer Hazards(const HazardQuery& query) const;
  HttpAnswer OneHazard(const std::string& id) const;
  HttpAnswer Vehicles() const;
  HttpAnswer PageConfig() const;
  HttpAnswer Picture(const std::string& sha256, const HttpQuestion& question) const;
  HttpAnswer File(const StaticFiles& files, std::string_view name,
                  const HttpQuestion& question) const;

  const WebOptions options_;
  ZoneService& zone_;
  const HazardCatalogue& catalogue_;
  const VehicleTrails& trails_;
  const StaticFiles page_;
  const StaticFiles leaflet_;
  const std::string page_policy_;  ///< Content-Security-Policy of the page.
};

}  // namespace livemap
