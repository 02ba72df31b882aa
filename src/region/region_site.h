#pragma once

#include <memory>
#include <optional>
#include <string>

#include "protocol/hazard_catalogue.h"
#include "region/region.h"
#include "region/region_desk.h"
#include "web/access/access.h"
#include "web/api/feed_api.h"
#include "web/api/hazard_api.h"
#include "web/http/http_message.h"
#include "web/http/request_target.h"
#include "web/http/site.h"
#include "web/http/static_files.h"
#include "web/http/web_config.h"
#include "web/officials/account_api.h"
#include "web/ogc/ogc_api.h"
#include "web/tiles/tile_file.h"

namespace livemap::region {

/// Answers every HTTP request to a region but the live stream's. Without accounts it can only be
/// read. With them, those who have logged in see candidates, too, and officials decide by way of
/// the zones (RegionDesk). Thread-safe; never throws.
class RegionSite : public web::Site {
 public:
  /// Keeps references to all but `options`. Throws Error when the accounts or the file of tiles are
  /// not accepted.
  RegionSite(const web::WebConfig& options, Region& region,
             const protocol::HazardCatalogue& catalogue);

  web::HttpResponse Answer(const web::HttpRequest& question) override;
  void Answer(const web::HttpRequest& question, const Done& done) override;
  /// Whether a zone may have to be asked.
  bool AnswersLater(const web::HttpRequest& question) const override;
  web::HttpResponse LateAnswer() const override;
  bool IsByOfficial(const web::HttpRequest& question) const override;
  /// What drivers are told of for everybody, candidates for those who have logged in.
  web::Visibility VisibilityFor(const web::HttpRequest& question) const override;
  /// Lets go of whoever waits for a zone, without a call: when it returns, none is being called.
  void Stop();

 private:
  web::HttpResponse AnswerNow(const web::HttpRequest& question);
  web::HttpResponse AnswerChange(const web::HttpRequest& question);
  web::HttpResponse Session(const web::HttpRequest& question) const;
  web::HttpResponse Finish(web::HttpResponse answer) const;
  web::HttpResponse Route(const web::HttpRequest& question);
  web::HttpResponse RouteFixed(const web::RequestTarget& target, const web::HttpRequest& question);
  web::HttpResponse Config() const;
  web::HttpResponse Zones() const;
  web::HttpResponse Readiness() const;
  web::HttpResponse Metrics() const;
  web::HttpResponse Tile(const std::string& path, const web::HttpRequest& question) const;

  const web::WebConfig options_;
  Region& region_;
  const protocol::HazardCatalogue& catalogue_;
  const web::HazardApi hazards_;
  const web::FeedApi feeds_;
  const web::OgcApi ogc_;
  std::optional<web::TileFile> tiles_;
  const web::StaticFiles page_;
  const web::StaticFiles leaflet_;
  const std::string page_policy_;  ///< Content-Security-Policy of the page.
  /// None where the region has no accounts, as all below.
  std::unique_ptr<web::Access> access_;
  std::unique_ptr<web::AccountApi> accounts_;
  std::unique_ptr<RegionDesk> desk_;  ///< Last: its threads use what stands above.
};

/// How the zones are as a GeoJSON FeatureCollection. A zone's geometry are its outlines, or null
/// where its area is not known. Why a zone is down is not told: it names machines.
web::Json ZonesJson(const Region& region);

/// The metrics of the region (docs/reference/metrics.md), in the text format of Prometheus.
std::string RegionMetricsText(const Region& region);

}  // namespace livemap::region
