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
constexpr std::string_view kRegionSession = "/api/v1/session";
constexpr std::string_view kRegionConfirmation = "/api/v1/session/confirm";

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

/// To pages, which ask for them where candidates may be seen.
HttpResponse NoMapChanges(const RegionMap& map) {
  return JsonAnswer({{"type", "FeatureCollection"},
                     {"log", map.LogId().ToString()},
                     {"sequence", map.Sequence()},
                     {"truncated", false},
                     {"features", web::Json::array()}},
                    "application/geo+json");
}

/// What is answered by the desk alone, to those who have logged in.
bool IsForPeople(const std::string& path) {
  const std::size_t hazard = std::string_view(web::kHazardAddress).size() + 1;
  const bool is_hazard_itself =
      IsBelow(path, web::kHazardAddress) && path.find('/', hazard) == std::string::npos;
  return RegionDesk::IsAddress(path) && !is_hazard_itself;
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
  if (options_.accounts_file.empty()) return;
  access_ = std::make_unique<web::Access>(options_);
  accounts_ = std::make_unique<web::AccountApi>(*access_);
  desk_ = std::make_unique<RegionDesk>(*access_, region, catalogue);
}

bool RegionSite::AnswersLater(const HttpRequest& question) const {
  if (!desk_) return false;
  try {
    const std::string path = web::ParseTarget(question.target).path;
    const bool is_read = question.method == "GET" || question.method == "HEAD";
    if (question.method == "POST") return web::ParseDecisionTarget(path).has_value();
    // Whoever has no session is told what everybody is.
    return is_read && RegionDesk::IsAddress(path) && access_->PersonOf(question);
  } catch (const std::exception&) {
    return false;
  }
}

HttpResponse RegionSite::LateAnswer() const {
  return web::MakeBusyAnswer("the zone has not answered in time: look before you try again");
}

bool RegionSite::IsByOfficial(const HttpRequest& question) const {
  try {
    return access_ && access_->IsByOfficial(question);
  } catch (const std::exception&) {
    return false;
  }
}

web::Visibility RegionSite::VisibilityFor(const HttpRequest& question) const {
  web::Visibility sees{true, false, false};
  try {
    sees.candidates = access_ && access_->PersonOf(question).has_value();
  } catch (const std::exception&) {  // Where the accounts cannot be read nobody has logged in.
  }
  return sees;
}

void RegionSite::Stop() {
  if (desk_) desk_->Stop();
}

void RegionSite::Answer(const HttpRequest& question, const Done& done) {
  if (!AnswersLater(question)) return done(Answer(question));
  const Done finished = [this, done](HttpResponse answer) { done(Finish(std::move(answer))); };
  try {
    desk_->Answer(web::ParseTarget(question.target), question, finished);
  } catch (const web::BadRequest& mistake) {
    finished(MakeErrorAnswer(400, mistake.what()));
  } catch (const std::exception&) {
    finished(web::MakeBusyAnswer("the region does not answer"));
  }
}

HttpResponse RegionSite::Answer(const HttpRequest& question) {
  HttpResponse answer;
  try {
    answer = AnswerNow(question);
  } catch (const web::BadRequest& mistake) {
    answer = MakeErrorAnswer(400, mistake.what());
  } catch (const std::exception&) {
    answer = web::MakeBusyAnswer("the region does not answer");
  }
  return Finish(std::move(answer));
}

HttpResponse RegionSite::Finish(HttpResponse answer) const {
  web::AddSecurityHeaders(page_policy_, answer);
  return answer;
}

HttpResponse RegionSite::AnswerNow(const HttpRequest& question) {
  const bool is_read = question.method == "GET" || question.method == "HEAD";
  HttpResponse answer = is_read ? Route(question) : AnswerChange(question);
  if (IsByOfficial(question)) answer.by_official = true;
  return answer;
}

/// Any method but GET and HEAD.
HttpResponse RegionSite::AnswerChange(const HttpRequest& question) {
  const web::RequestTarget target = web::ParseTarget(question.target);
  if (access_ && web::AccountApi::IsAddress(target.path)) {
    return accounts_->Answer(target, question);
  }
  const bool is_session = target.path == kRegionSession;
  const bool is_confirmation = target.path == kRegionConfirmation;
  if (access_ && (is_session || is_confirmation)) {
    web::RefuseQueryParameters(target);
    if (is_confirmation && question.method == "POST") return access_->Confirm(question);
    if (is_session && question.method == "POST") return access_->LogIn(question);
    if (is_session && question.method == "DELETE") return access_->LogOut(question);
  }
  const std::string accepted = access_ && is_session        ? "GET, HEAD, POST, DELETE"
                               : access_ && is_confirmation ? "POST"
                                                            : "GET, HEAD";
  HttpResponse answer =
      MakeErrorAnswer(405, "the method is not allowed, accepted is " + accepted +
                               (access_ ? "" : ": a region without accounts can only be read"));
  answer.headers.emplace_back("Allow", accepted);
  return answer;
}

HttpResponse RegionSite::Route(const HttpRequest& question) {
  const web::RequestTarget target = web::ParseTarget(question.target);
  const std::string& path = target.path;
  const web::Visibility sees = VisibilityFor(question);
  if (access_ && web::AccountApi::IsAddress(path)) return accounts_->Answer(target, question);
  if (sees.candidates && path == "/api/v1/changes") return NoMapChanges(region_.map());
  if (desk_ && !sees.candidates && IsForPeople(path)) return web::LogInFirst();
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
  if (path == kRegionSession) return Session(question);
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

HttpResponse RegionSite::Session(const HttpRequest& question) const {
  const web::Visibility sees = VisibilityFor(question);
  const web::Json seen{{"told", sees.told}, {"candidates", sees.candidates}, {"vehicles", false}};
  if (!access_) return JsonAnswer({{"name", nullptr}, {"has_accounts", false}, {"sees", seen}});
  HttpResponse answer = access_->Session(question);
  web::Json told = web::Json::parse(answer.content);
  told["sees"] = seen;
  return JsonAnswer(told);
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
  config["officials"] = access_ && access_->is_open();
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
