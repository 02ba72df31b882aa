#include "region/region_site.h"

#include <algorithm>
#include <limits>
#include <string_view>
#include <utility>

#include "common/sha256.h"
#include "common/time.h"
#include "common/utc_text.h"
#include "web/http/page_answer.h"
#include "web/json/json.h"
#include "web/metrics/metrics_text.h"

namespace livemap::region {
namespace {

using web::HttpRequest;
using web::HttpResponse;
using web::JsonAnswer;
using web::MakeErrorAnswer;

constexpr std::string_view kRegionLeafletPrefix = "/vendor/leaflet/";
constexpr std::string_view kRegionTilePrefix = "/tiles/";

bool BeginsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

/// The address itself, or one that goes on with '/'.
bool IsBelow(std::string_view path, std::string_view address) {
  return BeginsWith(path, address) &&
         (path.size() == address.size() || path[address.size()] == '/');
}

/// Each ring as a closed line.
web::Json Outlines(const directory::ZoneArea& area) {
  web::Json lines = web::Json::array();
  for (const auto& ring : area.rings()) {
    web::Json line = web::Json::array();
    for (const geo::GeoPoint& corner : ring) {
      line.push_back({web::Rounded(corner.longitude_deg, 7), web::Rounded(corner.latitude_deg, 7)});
    }
    line.push_back(line.front());
    lines.push_back(std::move(line));
  }
  return {{"type", "MultiLineString"}, {"coordinates", std::move(lines)}};
}

template <typename Value>
void AddByZone(web::MetricsText& text, const Region& region, const char* name, const char* type,
               const char* help, const Value& value) {
  text.Begin(name, type, help);
  for (std::size_t i = 0; i < region.zones(); ++i) {
    text.Add("zone", region.zone(i).id, value(region.status(i)));
  }
}

}  // namespace

web::Json ZonesJson(const Region& region) {
  web::Json features = web::Json::array();
  for (std::size_t i = 0; i < region.zones(); ++i) {
    const RegionZone& zone = region.zone(i);
    const ZoneStatus status = region.status(i);
    web::Json feature;
    feature["type"] = "Feature";
    feature["id"] = zone.id;
    feature["geometry"] = zone.area ? Outlines(*zone.area) : web::Json(nullptr);
    web::Json& properties = feature["properties"];
    properties["zone"] = zone.id;
    properties["name"] = zone.name.empty() ? zone.id : zone.name;
    properties["state"] = status.is_up ? "up" : "down";
    properties["last_heard"] =
        status.heard_ns == 0 ? web::Json(nullptr) : web::Json(Rfc3339Seconds(status.heard_ns));
    properties["hazards"] = status.hazards;
    features.push_back(std::move(feature));
  }
  return {{"type", "FeatureCollection"}, {"features", std::move(features)}};
}

std::string RegionMetricsText(const Region& region) {
  constexpr const char* kGauge = "gauge";
  constexpr const char* kCounter = "counter";
  web::MetricsText text;
  AddByZone(text, region, "livemap_region_zone_up", kGauge,
            "1 where the zone has answered the newest question, else 0.",
            [](const ZoneStatus& status) { return status.is_up ? 1.0 : 0.0; });
  AddByZone(text, region, "livemap_region_zone_age_seconds", kGauge,
            "Time since the zone answered last; +Inf where it never did.",
            [&region](const ZoneStatus& status) {
              if (status.heard_ns == 0) return std::numeric_limits<double>::infinity();
              return std::max(0.0, Seconds(region.NowNs() - status.heard_ns));
            });
  AddByZone(text, region, "livemap_region_zone_hazards", kGauge,
            "Hazards of which the zone tells drivers, as it said last.",
            [](const ZoneStatus& status) { return static_cast<double>(status.hazards); });
  AddByZone(text, region, "livemap_region_zone_failures_total", kCounter,
            "Questions to the zone without an acceptable answer.",
            [](const ZoneStatus& status) { return static_cast<double>(status.failures); });
  AddByZone(text, region, "livemap_region_zone_refused_hazards_total", kCounter,
            "Hazards that the zone told and that were left out.",
            [](const ZoneStatus& status) { return static_cast<double>(status.refused); });
  AddByZone(text, region, "livemap_region_zone_begun_anew_total", kCounter,
            "How often the zone's log was another one than before.",
            [](const ZoneStatus& status) { return static_cast<double>(status.begun_anew); });
  text.Begin("livemap_region_duplicates", kGauge,
             "Hazards at borders that are not shown, because another zone has them, too.");
  text.Add(static_cast<double>(region.map().hidden()));
  text.Begin("livemap_region_store_ok", kGauge,
             "1 where the store kept the newest answer, else 0.");
  text.Add(region.IsStoreWell() ? 1 : 0);
  return text.text();
}

RegionSite::RegionSite(const web::WebConfig& options, Region& region,
                       const protocol::HazardCatalogue& catalogue)
    : options_(options),
      region_(region),
      catalogue_(catalogue),
      hazards_(region.map(), catalogue),
      feeds_({options_, region.map(), catalogue}),
      ogc_({options_, region.map(), catalogue}),
      page_(options.web_root),
      leaflet_(options.leaflet_root + "/leaflet"),
      page_policy_(web::PagePolicy(web::TileSource(options.tile_url))) {
  if (!options_.tile_file.empty()) tiles_.emplace(options_.tile_file);
}

void RegionSite::Answer(const HttpRequest& question, const Done& done) { done(Answer(question)); }

HttpResponse RegionSite::Answer(const HttpRequest& question) {
  HttpResponse answer;
  try {
    if (question.method == "GET" || question.method == "HEAD") {
      answer = Route(question);
    } else {
      answer = MakeErrorAnswer(
          405, "the method is not allowed, accepted is GET, HEAD: a region can only be read");
      answer.headers.emplace_back("Allow", "GET, HEAD");
    }
  } catch (const web::BadRequest& mistake) {
    answer = MakeErrorAnswer(400, mistake.what());
  } catch (const std::exception&) {
    answer = web::MakeBusyAnswer("the region does not answer");
  }
  web::AddSecurityHeaders(page_policy_, answer);
  return answer;
}

HttpResponse RegionSite::Route(const HttpRequest& question) {
  const web::RequestTarget target = web::ParseTarget(question.target);
  const std::string& path = target.path;
  const web::Visibility sees = VisibilityFor(question);
  if (IsBelow(path, web::kHazardAddress)) return hazards_.Answer(target, sees.candidates);
  if (IsBelow(path, web::kFeedAddress)) return feeds_.Answer(target, question, sees);
  if (IsBelow(path, web::kOgcAddress)) return ogc_.Answer(target, question, sees);
  if (path == "/ws") {
    HttpResponse answer = MakeErrorAnswer(426, "this address speaks WebSocket only");
    answer.headers.emplace_back("Upgrade", "websocket");
    return answer;
  }
  if (BeginsWith(path, kRegionLeafletPrefix)) {
    return web::FileAnswer(leaflet_, std::string_view(path).substr(kRegionLeafletPrefix.size()),
                           question);
  }
  return RouteFixed(target, question);
}

/// What takes no parameters.
HttpResponse RegionSite::RouteFixed(const web::RequestTarget& target, const HttpRequest& question) {
  const std::string& path = target.path;
  if (BeginsWith(path, "/api/")) web::RefuseQueryParameters(target);
  if (path == "/api/v1/classes") return JsonAnswer(web::ClassesJson(catalogue_));
  if (path == "/api/v1/config") return Config();
  if (path == "/api/v1/zones") return JsonAnswer(ZonesJson(region_), "application/geo+json");
  if (path == "/api/v1/session") {
    return JsonAnswer({{"name", nullptr},
                       {"has_accounts", false},
                       {"sees", {{"told", true}, {"candidates", false}, {"vehicles", false}}}});
  }
  if (BeginsWith(path, "/api/")) return MakeErrorAnswer(404, "there is nothing at this address");
  if (path == "/healthz") {
    return JsonAnswer({{"status", "ok"}, {"sequence", region_.map().Sequence()}});
  }
  if (path == "/readyz") return Readiness();
  if (path == "/metrics") return Metrics();
  if (BeginsWith(path, kRegionTilePrefix)) {
    web::RefuseQueryParameters(target);
    return Tile(path, question);
  }
  return web::FileAnswer(page_, path == "/" ? "index.html" : std::string_view(path).substr(1),
                         question);
}

/// A region with zones that are down is ready: it shows their last state.
HttpResponse RegionSite::Readiness() const {
  if (!region_.HasAskedAll()) return web::MakeBusyAnswer("not all zones have been asked yet");
  if (!region_.IsStoreWell()) {
    return web::MakeBusyAnswer("the store does not keep what zones tell");
  }
  return JsonAnswer({{"status", "ready"}});
}

HttpResponse RegionSite::Metrics() const {
  HttpResponse answer;
  answer.content_type = web::kMetricsType;
  answer.content = RegionMetricsText(region_);
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

HttpResponse RegionSite::Config() const {
  web::Json config;
  config["title"] = options_.title;
  config["tile_url"] =
      options_.tile_url.empty() ? web::Json(nullptr) : web::Json(options_.tile_url);
  const bool says_itself = tiles_ && options_.tile_attribution.empty();
  config["tile_attribution"] = says_itself ? tiles_->attribution() : options_.tile_attribution;
  config["tiles"] = nullptr;
  if (tiles_) {
    config["tiles"] = {{"min_zoom", tiles_->min_zoom()}, {"max_zoom", tiles_->max_zoom()}};
  }
  config["centre"] = {options_.centre.longitude_deg, options_.centre.latitude_deg};
  config["officials"] = false;
  config["orders"] = false;
  config["streets"] = false;
  config["region"] = true;
  config["view"] = nullptr;
  if (const auto view = region_.map().View()) {
    config["view"] = {{"south", view->south_west.latitude_deg},
                      {"west", view->south_west.longitude_deg},
                      {"north", view->north_east.latitude_deg},
                      {"east", view->north_east.longitude_deg}};
  }
  return JsonAnswer(config);
}

HttpResponse RegionSite::Tile(const std::string& path, const HttpRequest& question) const {
  const auto place = web::ParseTilePath(path);
  const auto tile = place && tiles_ ? tiles_->Find(place->zoom, place->x, place->y) : std::nullopt;
  if (!tile) return MakeErrorAnswer(404, "there is no tile at this address");
  const std::string etag =
      '"' + Sha256Hex(tile->content->data(), tile->content->size()).substr(0, 32) + '"';
  HttpResponse answer =
      web::CacheableAnswer(tile->content, tile->media_type, etag, "public, max-age=3600", question);
  answer.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
  return answer;
}

}  // namespace livemap::region
