#include "web/server/api.h"

#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "common/sha256.h"
#include "common/time.h"
#include "web/http/page_answer.h"
#include "web/json/json.h"
#include "web/metrics/metrics_text.h"
#include "zone/pictures/picture_recoder.h"

namespace livemap::web {
namespace {

constexpr std::string_view kSessionAddress = "/api/v1/session";
constexpr std::string_view kConfirmAddress = "/api/v1/session/confirm";
constexpr std::string_view kImagePrefix = "/images/";
constexpr std::string_view kLeafletPrefix = "/vendor/leaflet/";
constexpr std::string_view kTilePrefix = "/tiles/";
/// Even opened on its own it may do nothing.
constexpr const char* kPicturePolicy = "default-src 'none'; sandbox";

bool StartsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

/// The address itself, or one that goes on with '/'.
bool IsAtOrBelow(std::string_view path, std::string_view address) {
  return StartsWith(path, address) &&
         (path.size() == address.size() || path[address.size()] == '/');
}

HttpResponse NoPicture() { return MakeErrorAnswer(404, "the zone has no picture of this name"); }

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

}  // namespace

Api::Api(const WebConfig& options, zone::ZoneService& zone,
         const protocol::HazardCatalogue& catalogue, const VehicleTrails& trails,
         orders::OrderDesk* orders, const NeighbourReader* neighbours)
    : options_(options),
      zone_(zone),
      catalogue_(catalogue),
      trails_(trails),
      access_(options_),
      accounts_(access_),
      officials_(access_, zone, catalogue),
      hazards_(zone, catalogue),
      map_changes_(zone),
      desk_(zone, catalogue),
      streets_(zone.streets()),
      feeds_({options_, zone, catalogue}),
      ogc_({options_, zone, catalogue}),
      order_desk_(orders),
      neighbours_(neighbours),
      orders_(access_, zone, orders),
      pictures_([limits = LimitsOf(options)](
                    const auto& file) { return zone::RecodePicture(file, limits); },
                {LimitsOf(options).max_bytes, options.picture_cache_bytes}),
      page_(options.web_root),
      leaflet_(options.leaflet_root + "/leaflet"),
      page_policy_(PagePolicy(TileSource(options.tile_url))),
      picture_queue_(pictures_, {}) {
  if (!options_.tile_file.empty()) tiles_.emplace(options_.tile_file);
}

bool Api::AnswersLater(const HttpRequest& question) const {
  return StartsWith(question.target, kImagePrefix);
}

void Api::Answer(const HttpRequest& question, const Done& done) {
  std::optional<std::pair<std::string, std::string>> found;
  try {
    found = FindPicture(question);
  } catch (const BadRequest&) {  // Answered below.
  }
  if (!found) return done(Answer(question));
  const auto& [sha256, path] = *found;
  const auto serve = [this, question, sha256 = sha256, done](const auto& picture) {
    done(Finish(Picture(sha256, picture, question)));
  };
  if (picture_queue_.Ask(question.client, sha256, path, serve)) return;
  done(Finish(MakeBusyAnswer("too many pictures are being made now")));
}

std::optional<std::pair<std::string, std::string>> Api::FindPicture(
    const HttpRequest& question) const {
  if (question.method != "GET" && question.method != "HEAD") return std::nullopt;
  if (!AnswersLater(question) || !VisibilityFor(question).told) return std::nullopt;
  std::string sha256 = ParseTarget(question.target).path.substr(kImagePrefix.size());
  auto path = zone_.ImagePath(sha256);
  if (!path) return std::nullopt;
  return std::pair(std::move(sha256), *std::move(path));
}

Api::PictureCounters Api::picture_counters() const {
  return {pictures_.refused(), pictures_.last_refusal(), picture_queue_.busy()};
}

void Api::TellServer(std::function<ServerMetrics()> server) {
  const MutexLock lock(server_mutex_);
  server_ = std::move(server);
}

HttpResponse Api::Answer(const HttpRequest& question) {
  const std::int64_t begin_ns = SteadyNs();
  HttpResponse answer = AnswerNow(question);
  answer_times_.Add(Seconds(SteadyNs() - begin_ns));
  return answer;
}

HttpResponse Api::AnswerNow(const HttpRequest& question) {
  HttpResponse answer;
  try {
    const bool is_read = question.method == "GET" || question.method == "HEAD";
    answer = is_read ? AnswerGet(question) : AnswerPost(question);
  } catch (const BadRequest& mistake) {
    answer = MakeErrorAnswer(400, mistake.what());
  } catch (const std::exception&) {
    // The zone's log names the cause; a stranger gets no paths or SQL.
    answer = MakeBusyAnswer("the zone's store does not answer");
  }
  return Finish(std::move(answer));
}

HttpResponse Api::Finish(HttpResponse answer) const {
  AddSecurityHeaders(page_policy_, answer);
  return answer;
}

bool Api::IsByOfficial(const HttpRequest& question) const {
  try {
    return access_.IsByOfficial(question);
  } catch (const std::exception&) {
    return false;
  }
}

Visibility Api::VisibilityFor(const HttpRequest& question) const {
  try {
    return access_.VisibilityFor(question);
  } catch (const std::exception&) {
    return {false, false, false};
  }
}

/// Each way looks at the token once: twice would count a wrong one twice.
HttpResponse Api::AnswerGet(const HttpRequest& question) {
  const RequestTarget target = ParseTarget(question.target);
  const auto decision = ParseDecisionTarget(target.path);
  if (decision && HasPreview(decision->decision)) {
    RefuseQueryParameters(target);
    return officials_.Preview(*decision, question);
  }
  if (OrderApi::IsAddress(target.path)) return orders_.Answer(target, question);
  if (AccountApi::IsAddress(target.path)) return accounts_.Answer(target, question);
  HttpResponse answer = Route(target, question);
  answer.by_official = access_.CheckOfficial(question);
  return answer;
}

/// Any method but GET and HEAD.
HttpResponse Api::AnswerPost(const HttpRequest& question) {
  const RequestTarget target = ParseTarget(question.target);
  const auto decision = ParseDecisionTarget(target.path);
  if (decision && question.method == "POST") {
    RefuseQueryParameters(target);
    return officials_.Decide(*decision, question);
  }
  if (OrderApi::IsAddress(target.path)) return orders_.Answer(target, question);
  if (AccountApi::IsAddress(target.path)) return accounts_.Answer(target, question);
  if (target.path == kSessionAddress) {
    RefuseQueryParameters(target);
    if (question.method == "POST") return access_.LogIn(question);
    if (question.method == "DELETE") return access_.LogOut(question);
    HttpResponse refusal =
        MakeErrorAnswer(405, "the method is not allowed, accepted are GET, HEAD, POST and DELETE");
    refusal.headers.emplace_back("Allow", "GET, HEAD, POST, DELETE");
    return refusal;
  }
  if (target.path == kConfirmAddress) {
    RefuseQueryParameters(target);
    return question.method == "POST" ? access_.Confirm(question) : PostOnly();
  }
  const bool can_be_read = decision && CanBeRead(decision->decision);
  const char* accepted = can_be_read ? "GET, HEAD, POST" : decision ? "POST" : "GET, HEAD";
  HttpResponse answer =
      MakeErrorAnswer(405, std::string("the method is not allowed, accepted is ") + accepted);
  answer.headers.emplace_back("Allow", accepted);
  return answer;
}

HttpResponse Api::Route(const RequestTarget& target, const HttpRequest& question) {
  const std::string& path = target.path;
  if (StartsWith(path, "/api/")) return RouteApi(target, question);
  if (IsAtOrBelow(path, kFeedAddress)) {
    return feeds_.Answer(target, question, access_.VisibilityFor(question));
  }
  if (IsAtOrBelow(path, kOgcAddress)) {
    return ogc_.Answer(target, question, access_.VisibilityFor(question));
  }
  // One that there is comes from the queue: nothing is decoded here.
  if (StartsWith(path, kImagePrefix)) {
    return VisibilityFor(question).told ? NoPicture() : LogInFirst();
  }
  if (path == "/healthz") {
    return JsonAnswer({{"status", "ok"}, {"sequence", zone_.Sequence()}});
  }
  if (path == "/readyz") return Readiness();
  if (path == "/metrics") return Metrics();
  if (path == "/ws") {
    HttpResponse answer = MakeErrorAnswer(426, "this address speaks WebSocket only");
    answer.headers.emplace_back("Upgrade", "websocket");
    return answer;
  }
  if (StartsWith(path, kLeafletPrefix)) {
    return FileAnswer(leaflet_, std::string_view(path).substr(kLeafletPrefix.size()), question);
  }
  if (StartsWith(path, kTilePrefix)) {
    RefuseQueryParameters(target);
    return Tile(path, question);
  }
  if (path == "/") return FileAnswer(page_, "index.html", question);
  return FileAnswer(page_, std::string_view(path).substr(1), question);
}

HttpResponse Api::RouteApi(const RequestTarget& target, const HttpRequest& question) const {
  const std::string& path = target.path;
  const Visibility sees = access_.VisibilityFor(question);
  const bool is_decision = ParseDecisionTarget(path).has_value();
  // As those who decided.
  if (DeskApi::Has(path)) return sees.vehicles ? desk_.Answer(target) : LogInFirst();
  if (!is_decision && StartsWith(path, kHazardAddress)) {
    return sees.told ? hazards_.Answer(target, sees.candidates) : LogInFirst();
  }
  if (!is_decision && StartsWith(path, kMapChangeAddress)) {
    return sees.candidates ? map_changes_.Answer(target) : LogInFirst();
  }
  if (path == kStreetAddress) return streets_.Answer(target, question);
  // Who has logged in may know who decided; while there are no accounts, everybody.
  if (path == "/api/v1/decisions") {
    return sees.vehicles ? officials_.Decisions(ParseDecisionsQuery(target)) : LogInFirst();
  }
  RefuseQueryParameters(target);
  if (is_decision) return PostOnly();
  if (path == kNeighbourAddress && neighbours_ != nullptr) {
    if (!sees.told) return LogInFirst();
    return JsonAnswer(NeighboursJson(neighbours_->Hazards(), catalogue_), "application/geo+json");
  }
  if (path == "/api/v1/classes") return JsonAnswer(ClassesJson(catalogue_));
  if (path == "/api/v1/vehicles") return sees.vehicles ? Vehicles() : LogInFirst();
  if (path == kSessionAddress) return access_.Session(question);
  if (path == kConfirmAddress) return PostOnly();
  if (path == "/api/v1/config") return PageConfig();
  return MakeErrorAnswer(404, "there is nothing at this address");
}

HttpResponse Api::Tile(const std::string& path, const HttpRequest& question) const {
  const auto place = ParseTilePath(path);
  const auto tile = place && tiles_ ? tiles_->Find(place->zoom, place->x, place->y) : std::nullopt;
  if (!tile) return MakeErrorAnswer(404, "there is no tile at this address");
  const std::string etag =
      '"' + Sha256Hex(tile->content->data(), tile->content->size()).substr(0, 32) + '"';
  HttpResponse answer =
      CacheableAnswer(tile->content, tile->media_type, etag, "public, max-age=3600", question);
  answer.headers.emplace_back("Content-Security-Policy", kPicturePolicy);
  return answer;
}

HttpResponse Api::Metrics() const {
  ServerMetrics server;
  {
    const MutexLock lock(server_mutex_);
    if (server_) server = server_();
  }
  server.answers = answer_times_.counts();
  HttpResponse answer;
  answer.content_type = kMetricsType;
  answer.content = ZoneMetricsText(zone_, server, order_desk_);
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

HttpResponse Api::Readiness() const {
  if (!zone_.IsActive()) return MakeBusyAnswer("the zone's lease was not renewed in time");
  if (zone_.IsStoreWell()) return JsonAnswer({{"status", "ready"}});
  return MakeBusyAnswer("the store does not answer, or does not keep what is written");
}

HttpResponse Api::Vehicles() const {
  auto pieces = [this, last = std::string(), is_begun = false,
                 has_items = false](std::string& piece) mutable {
    if (!is_begun) piece += R"({"type":"FeatureCollection","features":[)";
    is_begun = true;
    // A few: each may have a long trail.
    constexpr std::size_t kVehiclesPerRead = 8;
    const auto vehicles = zone_.VehiclesAfter(last, kVehiclesPerRead);
    for (const zone::VehicleState& vehicle : vehicles) {
      if (has_items) piece += ',';
      has_items = true;
      piece += ToText(VehicleFeature(vehicle, trails_.Get(vehicle.vehicle_id)));
      last = vehicle.vehicle_id;
      if (piece.size() >= kPieceBytes) return true;
    }
    if (vehicles.size() == kVehiclesPerRead) return true;
    piece += "]}";
    return false;
  };
  return PiecesAnswer(std::move(pieces), "application/geo+json");
}

HttpResponse Api::PageConfig() const {
  Json config;
  config["title"] = options_.title;
  config["tile_url"] = options_.tile_url.empty() ? Json(nullptr) : Json(options_.tile_url);
  const bool says_itself = tiles_ && options_.tile_attribution.empty();
  config["tile_attribution"] = says_itself ? tiles_->attribution() : options_.tile_attribution;
  config["tiles"] = nullptr;
  if (tiles_)
    config["tiles"] = {{"min_zoom", tiles_->min_zoom()}, {"max_zoom", tiles_->max_zoom()}};
  config["centre"] = {options_.centre.longitude_deg, options_.centre.latitude_deg};
  config["officials"] = access_.is_open();
  config["orders"] = order_desk_ != nullptr;
  config["neighbours"] = neighbours_ != nullptr;
  config["streets"] = zone_.streets() != nullptr;
  config["view"] = nullptr;
  auto view = zone_.View();
  // A zone without hazards is still where its streets are.
  if (!view) view = streets_.bounds();
  if (view) {
    config["view"] = {{"south", view->south_west.latitude_deg},
                      {"west", view->south_west.longitude_deg},
                      {"north", view->north_east.latitude_deg},
                      {"east", view->north_east.longitude_deg}};
  }
  return JsonAnswer(config);
}

/// A vehicle's file itself never leaves the zone.
HttpResponse Api::Picture(const std::string& sha256, const zone::PictureCache::File& picture,
                          const HttpRequest& question) const {
  if (!picture) return NoPicture();
  const std::string etag = '"' + sha256 + '-' + std::to_string(options_.picture_side_px) + '"';
  HttpResponse answer =
      CacheableAnswer(picture, "image/jpeg", etag, "public, max-age=31536000, immutable", question);
  answer.headers.emplace_back("Content-Security-Policy", kPicturePolicy);
  return answer;
}

}  // namespace livemap::web
