#include "web/official_api.h"

#include <chrono>

#include "web/origin.h"
#include "zone/report_validation.h"

namespace livemap {
namespace {

constexpr std::size_t kMaxReasonBytes = 200;
constexpr std::string_view kPrefix = "/api/v1/hazards/";

double SteadySeconds() {
  const auto since_start = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(since_start).count();
}

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// "application/json", with or without parameters. A page of another origin cannot send it without
/// asking first, which this server never allows.
bool IsJsonType(const std::string& content_type) {
  const std::string type = content_type.substr(0, content_type.find(';'));
  return type == "application/json" || type == "application/json ";
}

}  // namespace

std::optional<DecisionTarget> ParseDecisionTarget(std::string_view path) {
  if (path.substr(0, kPrefix.size()) != kPrefix) return std::nullopt;
  path.remove_prefix(kPrefix.size());
  for (const auto& [ending, decision] :
       {std::pair<std::string_view, Decision>{"/confirm", Decision::kConfirm},
        {"/reject", Decision::kReject}}) {
    if (!EndsWith(path, ending)) continue;
    return DecisionTarget{decision, std::string(path.substr(0, path.size() - ending.size()))};
  }
  return std::nullopt;
}

std::string ParseDecisionBody(Decision decision, const std::string& body) {
  static const std::string kAccepted =
      R"(accepted is {"reason": TEXT} with one line of printable text of 1 to )" +
      std::to_string(kMaxReasonBytes) + " bytes";
  if (body.empty() && decision == Decision::kConfirm) return "";
  const Json json = Json::parse(body, nullptr, false);
  if (!json.is_object()) throw BadRequest("the body is no JSON object, " + kAccepted);
  for (const auto& [key, value] : json.items()) {
    if (key != "reason") throw BadRequest("the body has an unknown key, " + kAccepted);
    if (!value.is_string()) throw BadRequest("the reason is no text, " + kAccepted);
  }
  if (json.empty() && decision == Decision::kConfirm) return "";
  const std::string reason = json.value("reason", "");
  if (reason.empty()) throw BadRequest("there is no reason, " + kAccepted);
  if (!IsPrintableText(reason, kMaxReasonBytes)) {
    throw BadRequest("the reason of " + std::to_string(reason.size()) + " bytes is not accepted, " +
                     kAccepted);
  }
  return reason;
}

OfficialApi::OfficialApi(const WebOptions& options, ZoneService& zone,
                         const HazardCatalogue& catalogue)
    : options_(options),
      zone_(zone),
      catalogue_(catalogue),
      gate_(options.token_file.empty() ? std::vector<Official>()
                                       : ReadTokenFile(options.token_file)) {}

std::optional<HttpAnswer> OfficialApi::WhyNotAllowed(const HttpQuestion& question,
                                                     std::string& official) {
  if (!IsAllowedOrigin(question.origin, question.host, options_.allowed_origins)) {
    return MakeErrorAnswer(403, "pages of another origin may not decide about hazards");
  }
  OfficialGate::Answer answer =
      gate_.Check(question.authorization, question.client, SteadySeconds());
  std::optional<HttpAnswer> refusal;
  switch (answer.verdict) {
    case OfficialGate::Verdict::kAllowed:
      official = std::move(answer.official);
      return std::nullopt;
    case OfficialGate::Verdict::kClosed:
      return MakeErrorAnswer(
          403, "nobody may decide about hazards here: the server was started without a token file");
    case OfficialGate::Verdict::kNoToken:
      refusal = MakeErrorAnswer(401, "a token is needed: Authorization: Bearer TOKEN");
      break;
    case OfficialGate::Verdict::kWrongToken:
      refusal = MakeErrorAnswer(401, "the token is wrong");
      break;
    case OfficialGate::Verdict::kTooManyWrong:
      refusal = MakeErrorAnswer(
          429, "too many wrong tokens came from your address, try again in a minute");
      refusal->headers.emplace_back("Retry-After", "60");
      return refusal;
  }
  refusal->headers.emplace_back("WWW-Authenticate", "Bearer realm=\"livemap\"");
  return refusal;
}

HttpAnswer OfficialApi::Decide(const DecisionTarget& target, const HttpQuestion& question) {
  std::string official;
  if (auto refusal = WhyNotAllowed(question, official)) return *std::move(refusal);
  if (!question.body.empty() && !IsJsonType(question.content_type)) {
    return MakeErrorAnswer(415, "the body's type is not accepted, accepted is application/json");
  }
  const std::string reason = ParseDecisionBody(target.decision, question.body);
  const auto uuid = Uuid::Parse(target.id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  if (!zone_.Find(*uuid)) return MakeErrorAnswer(404, "the zone knows no hazard with this id");
  const bool decided = target.decision == Decision::kReject ? zone_.Reject(*uuid, official, reason)
                                                            : zone_.Confirm(*uuid, official);
  if (!decided) return MakeErrorAnswer(409, "the hazard is no longer on the map");
  return JsonAnswer(HazardFeature(*zone_.Find(*uuid), catalogue_), "application/geo+json");
}

}  // namespace livemap
