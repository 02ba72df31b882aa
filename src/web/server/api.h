#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "common/histogram.h"
#include "common/mutex.h"
#include "protocol/hazard_catalogue.h"
#include "web/access/access.h"
#include "web/api/feed_api.h"
#include "web/api/hazard_api.h"
#include "web/api/map_change_api.h"
#include "web/api/neighbour_api.h"
#include "web/api/query.h"
#include "web/api/street_api.h"
#include "web/api/vehicle_trails.h"
#include "web/http/http_message.h"
#include "web/http/site.h"
#include "web/http/static_files.h"
#include "web/http/web_config.h"
#include "web/metrics/zone_metrics.h"
#include "web/officials/account_api.h"
#include "web/officials/desk_api.h"
#include "web/officials/official_api.h"
#include "web/officials/order_api.h"
#include "web/ogc/ogc_api.h"
#include "web/tiles/tile_file.h"
#include "zone/pictures/picture_cache.h"
#include "zone/pictures/picture_queue.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Answers every HTTP request but the live stream's: pages, pictures, `/api/v1`
/// (docs/reference/http-api.md) and the feeds (docs/reference/feeds.md). Thread-safe; never throws.
class Api : public Site {
 public:
  /// Keeps references to all but `options`. `orders`: null where the zone has no work orders,
  /// `neighbours`: null where it does not follow other zones.
  /// Throws Error when the token file, the accounts or the file of tiles is not accepted.
  Api(const WebConfig& options, zone::ZoneService& zone, const protocol::HazardCatalogue& catalogue,
      const VehicleTrails& trails, orders::OrderDesk* orders = nullptr,
      const NeighbourReader* neighbours = nullptr);

  /// From now on metrics tell what this says of the server, whose answers nobody else counts.
  void TellServer(std::function<ServerMetrics()> server);
  /// Every request but a picture's, of which it knows none.
  HttpResponse Answer(const HttpRequest& question) override;
  /// Every request: a picture that is not made yet is answered later, from another thread.
  void Answer(const HttpRequest& question, const Done& done) override;
  /// Lets go of whoever waits for a picture, without a call: when it returns, none is being called.
  void Stop() { picture_queue_.Stop(); }
  /// Whether the request is an official's. Nothing is counted: Answer does that. Quick.
  bool IsByOfficial(const HttpRequest& question) const override;
  /// Nothing at all where the accounts cannot be read.
  Visibility VisibilityFor(const HttpRequest& question) const override;
  /// Whether the request asks for a picture, which may take long.
  bool AnswersLater(const HttpRequest& question) const override;

  /// How pictures fared since the start: how many were refused and why the last of them was, and
  /// how many asked in vain because too many waited.
  struct PictureCounters {
    std::uint64_t refused = 0;
    std::string last_refusal;
    std::uint64_t busy = 0;
  };
  PictureCounters picture_counters() const;

 private:
  HttpResponse AnswerNow(const HttpRequest& question);
  HttpResponse AnswerGet(const HttpRequest& question);
  HttpResponse AnswerPost(const HttpRequest& question);
  HttpResponse Route(const RequestTarget& target, const HttpRequest& question);
  HttpResponse RouteApi(const RequestTarget& target, const HttpRequest& question) const;
  HttpResponse Tile(const std::string& path, const HttpRequest& question) const;
  HttpResponse Metrics() const;
  HttpResponse Readiness() const;
  HttpResponse Vehicles() const;
  HttpResponse PageConfig() const;
  /// The picture's hash and file; none when the request asks for another thing.
  std::optional<std::pair<std::string, std::string>> FindPicture(const HttpRequest& question) const;
  HttpResponse Picture(const std::string& sha256, const zone::PictureCache::File& picture,
                       const HttpRequest& question) const;
  /// With the headers that every answer has.
  HttpResponse Finish(HttpResponse answer) const;

  const WebConfig options_;
  zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
  const VehicleTrails& trails_;
  Access access_;
  AccountApi accounts_;
  OfficialApi officials_;
  const HazardApi hazards_;
  const MapChangeApi map_changes_;
  const DeskApi desk_;
  const StreetApi streets_;
  const FeedApi feeds_;
  const OgcApi ogc_;
  const orders::OrderDesk* const order_desk_;  ///< Null where the zone has no work orders.
  const NeighbourReader* const neighbours_;    ///< Null where it does not follow other zones.
  OrderApi orders_;
  std::optional<TileFile> tiles_;
  DurationHistogram answer_times_;
  mutable Mutex server_mutex_;
  std::function<ServerMetrics()> server_ GUARDED_BY(server_mutex_);
  zone::PictureCache pictures_;
  const StaticFiles page_;
  const StaticFiles leaflet_;
  const std::string page_policy_;     ///< Content-Security-Policy of the page.
  zone::PictureQueue picture_queue_;  ///< Last: its thread uses what stands above.
};

}  // namespace livemap::web
