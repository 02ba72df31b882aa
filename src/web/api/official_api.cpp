#include "web/api/official_api.h"

#include "common/clock.h"
#include "common/time.h"
#include "web/http/origin.h"
#include "web/json/map_change_json.h"

namespace livemap::web {
namespace {

/// "application/json", with or without parameters. A page of another origin cannot send it without
/// asking first, which this server never allows.
bool IsJsonType(const std::string& content_type) {
  const std::string type = content_type.substr(0, content_type.find(';'));
  return type == "application/json" || type == "application/json ";
}

}  // namespace

OfficialApi::OfficialApi(const WebConfig& options, zone::ZoneService& zone,
                         const protocol::HazardCatalogue& catalogue)
    : options_(options),
      zone_(zone),
      catalogue_(catalogue),
      gate_(options.token_file.empty() ? std::vector<Official>()
                                       : ReadTokenFile(options.token_file)) {}

std::optional<HttpResponse> OfficialApi::WhyNotAllowed(const HttpRequest& question,
                                                       std::string& official) {
  if (!IsAllowedOrigin(question.origin, question.host, options_.allowed_origins)) {
    return MakeErrorAnswer(403, "pages of another origin may not decide anything");
  }
  OfficialAuthenticator::Answer answer =
      gate_.Check(question.authorization, question.client, Seconds(SteadyNs()));
  std::optional<HttpResponse> refusal;
  switch (answer.verdict) {
    case OfficialAuthenticator::Verdict::kAllowed:
      official = std::move(answer.official);
      return std::nullopt;
    case OfficialAuthenticator::Verdict::kClosed:
      return MakeErrorAnswer(
          403, "nobody may decide anything here: the server was started without a token file");
    case OfficialAuthenticator::Verdict::kNoToken:
      refusal = MakeErrorAnswer(401, "a token is needed: Authorization: Bearer TOKEN");
      break;
    case OfficialAuthenticator::Verdict::kWrongToken:
      refusal = MakeErrorAnswer(401, "the token is wrong");
      break;
    case OfficialAuthenticator::Verdict::kTooManyWrong:
      refusal = MakeErrorAnswer(
          429, "too many wrong tokens came from your address, try again in a minute");
      refusal->headers.emplace_back("Retry-After", "60");
      return refusal;
  }
  refusal->headers.emplace_back("WWW-Authenticate", "Bearer realm=\"livemap\"");
  return refusal;
}

HttpResponse OfficialApi::Decide(const DecisionTarget& target, const HttpRequest& question) {
  std::string official;
  if (auto refusal = WhyNotAllowed(question, official)) return *std::move(refusal);
  if (!question.body.empty() && !IsJsonType(question.content_type)) {
    return MakeErrorAnswer(415, "the body's type is not accepted, accepted is application/json");
  }
  if (target.decision == Decision::kMapChange) {
    return DecideMapChange(target, official, question.body);
  }
  const std::string reason = ParseDecisionBody(target.decision, question.body);
  if (target.decision == Decision::kDistrust) return Distrust(target.id, official, reason);
  return DecideHazard(target, official, reason);
}

HttpResponse OfficialApi::DecideHazard(const DecisionTarget& target, const std::string& official,
                                       const std::string& reason) {
  const auto uuid = Uuid::Parse(target.id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  const auto hazard = zone_.Find(*uuid);
  if (!hazard) return MakeErrorAnswer(404, "the zone knows no hazard with this id");
  const bool decided = target.decision == Decision::kReject
                           ? zone_.Reject(*uuid, official, reason)
                           : zone_.Confirm(*uuid, official, reason);
  if (!decided) {
    return MakeErrorAnswer(409, hazard->state == zone::HazardState::kRejected
                                    ? "the hazard is rejected already"
                                    : "the hazard is gone; seen again it is a new one");
  }
  return JsonAnswer(HazardFeature(*zone_.Find(*uuid), catalogue_), "application/geo+json");
}

HttpResponse OfficialApi::DecideMapChange(const DecisionTarget& target, const std::string& official,
                                          const std::string& body) {
  const MapChangeDecision decision = ParseMapChangeDecision(body);
  const auto uuid = Uuid::Parse(target.id);
  if (!uuid) throw BadRequest("the map change's id is no UUID");
  const auto feature = zone_.FindMapChange(*uuid);
  if (!feature) return MakeErrorAnswer(404, "the zone knows no map change with this id");
  const bool decided = decision.confirms ? zone_.ConfirmMapChange(*uuid, official, decision.reason)
                                         : zone_.DismissMapChange(*uuid, official, decision.reason);
  if (!decided) {
    return MakeErrorAnswer(409, feature->state == zone::MapChangeState::kDismissed
                                    ? "the map change is dismissed already"
                                    : "the map change is undone; told again it is a new one");
  }
  return JsonAnswer(MapChangeGeoJson(*zone_.FindMapChange(*uuid)), "application/geo+json");
}

HttpResponse OfficialApi::Distrust(const std::string& vehicle, const std::string& official,
                                   const std::string& reason) {
  const auto withdrawn = zone_.Distrust(vehicle, official, reason);
  if (!withdrawn) return MakeErrorAnswer(404, "the zone has never heard of a vehicle of this name");
  return JsonAnswer({{"vehicle", vehicle}, {"hazards", *withdrawn}});
}

}  // namespace livemap::web
