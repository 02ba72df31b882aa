#include "web/api/api.h"

#include <algorithm>

#include "common/error.h"
#include "web/api/collections.h"
#include "web/json/json.h"
#include "zone/pictures/picture_recoder.h"

namespace livemap::web {
namespace {

constexpr std::string_view kImagePrefix = "/images/";
constexpr std::string_view kHazardPrefix = "/api/v1/hazards/";
constexpr std::string_view kEventsEnding = "/events";
constexpr std::string_view kLeafletPrefix = "/vendor/leaflet/";

/// Only this server's own files run or load; tiles are the one exception, and only as images.
std::string PagePolicy(const std::string& tile_source) {
  return "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:" +
         (tile_source.empty() ? "" : " " + tile_source) +
         "; connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
         "frame-ancestors 'none'";
}

bool StartsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

HttpResponse PostOnly() {
  HttpResponse answer = MakeErrorAnswer(405, "the method is not allowed, accepted is POST");
  answer.headers.emplace_back("Allow", "POST");
  return answer;
}

zone::PictureLimits LimitsOf(const WebConfig& options) {
  zone::PictureLimits limits;
  limits.longest_side_px = options.picture_side_px;
  return limits;
}

/// What a client should do that shows the states that the query asks for.
zone::HazardAction ActionFor(const zone::Hazard& hazard, const HazardQuery& query) {
  return query.Selects(hazard.state) ? ReplayAction(hazard) : zone::HazardAction::kRemoved;
}

/// 304 where the client already has this very content.
HttpResponse CacheableAnswer(StaticFile file, const char* cache_control,
                             const HttpRequest& question) {
  HttpResponse answer;
  answer.headers.emplace_back("ETag", file.etag);
  answer.headers.emplace_back("Cache-Control", cache_control);
  answer.content_type = std::move(file.content_type);
  if (question.if_none_match.find(file.etag) != std::string::npos) {
    answer.status = 304;
  } else {
    answer.content = std::move(file.content);
  }
  return answer;
}

}  // namespace

Api::Api(const WebConfig& options, zone::ZoneService& zone,
         const protocol::HazardCatalogue& catalogue, const VehicleTrails& trails)
    : options_(options),
      zone_(zone),
      catalogue_(catalogue),
      trails_(trails),
      officials_(options_, zone, catalogue),
      map_changes_(zone),
      pictures_([limits = LimitsOf(options)](
                    const auto& file) { return zone::RecodePicture(file, limits); },
                {LimitsOf(options).max_bytes, options.picture_cache_bytes}),
      page_(options.web_root),
      leaflet_(options.leaflet_root + "/leaflet"),
      page_policy_(PagePolicy(TileSource(options.tile_url))) {}

HttpResponse Api::Answer(const HttpRequest& question) {
  HttpResponse answer;
  try {
    const bool is_read = question.method == "GET" || question.method == "HEAD";
    answer = is_read ? Route(ParseTarget(question.target), question) : AnswerPost(question);
  } catch (const BadRequest& mistake) {
    answer = ErrorAnswer(400, mistake.what());
  } catch (const std::exception&) {
    // The zone's log names the cause; a stranger gets no paths or SQL.
    answer = ErrorAnswer(503, "the zone's store does not answer");
  }
  const bool has_policy =
      std::any_of(answer.headers.begin(), answer.headers.end(),
                  [](const auto& header) { return header.first == "Content-Security-Policy"; });
  if (!has_policy) answer.headers.emplace_back("Content-Security-Policy", page_policy_);
  answer.headers.emplace_back("X-Content-Type-Options", "nosniff");
  answer.headers.emplace_back("X-Frame-Options", "DENY");
  answer.headers.emplace_back("Referrer-Policy", "strict-origin-when-cross-origin");
  answer.headers.emplace_back("Cross-Origin-Resource-Policy", "same-origin");
  answer.headers.emplace_back("Cross-Origin-Opener-Policy", "same-origin");
  return answer;
}

HttpResponse Api::ErrorAnswer(int status, const std::string& sentence) const {
  return MakeErrorAnswer(status, sentence);
}

/// Any method but GET and HEAD.
HttpResponse Api::AnswerPost(const HttpRequest& question) {
  const RequestTarget target = ParseTarget(question.target);
  const auto decision = ParseDecisionTarget(target.path);
  if (decision && question.method == "POST") {
    RefuseQueryParameters(target);
    return officials_.Decide(*decision, question);
  }
  const char* accepted = decision ? "POST" : "GET, HEAD";
  HttpResponse answer =
      ErrorAnswer(405, std::string("the method is not allowed, accepted is ") + accepted);
  answer.headers.emplace_back("Allow", accepted);
  return answer;
}

HttpResponse Api::Route(const RequestTarget& target, const HttpRequest& question) {
  const std::string& path = target.path;
  if (StartsWith(path, "/api/")) return RouteApi(target);
  if (StartsWith(path, kImagePrefix)) return Picture(path.substr(kImagePrefix.size()), question);
  if (path == "/healthz") {
    return JsonAnswer({{"status", "ok"}, {"sequence", zone_.Sequence()}});
  }
  if (path == "/ws") {
    HttpResponse answer = ErrorAnswer(426, "this address speaks WebSocket only");
    answer.headers.emplace_back("Upgrade", "websocket");
    return answer;
  }
  if (StartsWith(path, kLeafletPrefix)) {
    return File(leaflet_, std::string_view(path).substr(kLeafletPrefix.size()), question);
  }
  if (path == "/") return File(page_, "index.html", question);
  return File(page_, std::string_view(path).substr(1), question);
}

HttpResponse Api::RouteApi(const RequestTarget& target) const {
  const std::string& path = target.path;
  if (path == "/api/v1/hazards") return Hazards(ParseHazardQuery(target));
  if (StartsWith(path, kHazardPrefix) && EndsWith(path, kEventsEnding)) {
    const std::size_t id_bytes = path.size() - kHazardPrefix.size() - kEventsEnding.size();
    return Events(path.substr(kHazardPrefix.size(), id_bytes), ParseEventsQuery(target));
  }
  const bool is_decision = ParseDecisionTarget(path).has_value();
  if (!is_decision && StartsWith(path, kMapChangeAddress)) return map_changes_.Answer(target);
  RefuseQueryParameters(target);
  if (is_decision) return PostOnly();
  if (StartsWith(path, kHazardPrefix)) return OneHazard(path.substr(kHazardPrefix.size()));
  if (path == "/api/v1/classes") return JsonAnswer(ClassesJson(catalogue_));
  if (path == "/api/v1/vehicles") return Vehicles();
  if (path == "/api/v1/config") return PageConfig();
  return ErrorAnswer(404, "there is nothing at this address");
}

HttpResponse Api::Hazards(const HazardQuery& query) const {
  const std::uint64_t sequence = zone_.Sequence();  // Before the list.
  // Since a sequence all that changed is looked at: what left the selection is told too.
  const std::vector<zone::Hazard> hazards =
      zone_.Query(query.box, query.since.value_or(0), query.limit,
                  query.since ? zone::HazardStates() : query.states);
  return ListAnswer(sequence, query.limit, hazards, [&](const zone::Hazard& hazard) {
    Json feature = HazardFeature(hazard, catalogue_);
    if (query.since) feature["properties"]["action"] = ActionName(ActionFor(hazard, query));
    return feature;
  });
}

HttpResponse Api::OneHazard(const std::string& id) const {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  const auto hazard = zone_.Find(*uuid);
  if (!hazard) return ErrorAnswer(404, "the zone knows no hazard with this id");
  Json feature = HazardFeature(*hazard, catalogue_);
  feature["properties"]["active"] = zone::IsOnMap(hazard->state);
  return JsonAnswer(feature, "application/geo+json");
}

HttpResponse Api::Events(const std::string& id, std::size_t limit) const {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  if (!zone_.Find(*uuid)) return ErrorAnswer(404, "the zone knows no hazard with this id");
  return EventsAnswer(*uuid, zone_.Events(*uuid, limit), EventJson);
}

HttpResponse Api::Vehicles() const {
  Json features = Json::array();
  for (const zone::VehicleState& vehicle : zone_.Vehicles()) {
    features.push_back(VehicleFeature(vehicle, trails_.Get(vehicle.vehicle_id)));
  }
  Json collection;
  collection["type"] = "FeatureCollection";
  collection["features"] = std::move(features);
  return JsonAnswer(collection, "application/geo+json");
}

HttpResponse Api::PageConfig() const {
  Json config;
  config["title"] = options_.title;
  config["tile_url"] = options_.tile_url.empty() ? Json(nullptr) : Json(options_.tile_url);
  config["tile_attribution"] = options_.tile_attribution;
  config["centre"] = {options_.centre.longitude_deg, options_.centre.latitude_deg};
  config["officials"] = officials_.is_open();
  return JsonAnswer(config);
}

/// A vehicle's file itself never leaves the zone.
HttpResponse Api::Picture(const std::string& sha256, const HttpRequest& question) {
  const auto path = zone_.ImagePath(sha256);
  const zone::PictureCache::File picture = path ? pictures_.Get(sha256, *path) : nullptr;
  if (!picture) return ErrorAnswer(404, "the zone has no picture of this name");
  StaticFile file;
  file.content.assign(picture->begin(), picture->end());
  file.content_type = "image/jpeg";
  file.etag = '"' + sha256 + '-' + std::to_string(options_.picture_side_px) + '"';
  HttpResponse answer =
      CacheableAnswer(std::move(file), "public, max-age=31536000, immutable", question);
  // Even opened on its own it may do nothing.
  answer.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
  return answer;
}

HttpResponse Api::File(const StaticFiles& files, std::string_view name,
                       const HttpRequest& question) const {
  auto file = files.Find(name);
  if (!file) return ErrorAnswer(404, "there is nothing at this address");
  return CacheableAnswer(*std::move(file), "no-cache", question);
}

}  // namespace livemap::web
