#include "web/api/official_decision.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "zone/admission/report_validation.h"

namespace livemap::web {
namespace {

struct DecisionAddress {
  std::string_view begin;
  std::string_view end;
  Decision decision;
};
constexpr DecisionAddress kAddresses[] = {
    {"/api/v1/hazards/", "/confirm", Decision::kConfirm},
    {"/api/v1/hazards/", "/reject", Decision::kReject},
    {"/api/v1/vehicles/", "/distrust", Decision::kDistrust},
    {"/api/v1/changes/", "/decision", Decision::kMapChange},
};

void CheckReason(const std::string& reason, const std::string& accepted) {
  if (zone::IsPrintableText(reason, kMaxDecisionReasonBytes)) return;
  throw BadRequest("the reason of " + std::to_string(reason.size()) + " bytes is not accepted, " +
                   accepted);
}

}  // namespace

std::optional<DecisionTarget> ParseDecisionTarget(std::string_view path) {
  for (const auto& [begin, end, decision] : kAddresses) {
    if (path.size() < begin.size() + end.size() || path.substr(0, begin.size()) != begin) continue;
    if (path.substr(path.size() - end.size()) != end) continue;
    const std::size_t id_bytes = path.size() - begin.size() - end.size();
    return DecisionTarget{decision, std::string(path.substr(begin.size(), id_bytes))};
  }
  return std::nullopt;
}

std::string ParseDecisionBody(Decision decision, const std::string& body) {
  static const std::string kAccepted =
      R"(accepted is {"reason": TEXT} with one line of printable text of 1 to )" +
      std::to_string(kMaxDecisionReasonBytes) + " bytes";
  if (body.empty() && decision == Decision::kConfirm) return "";
  const nlohmann::json json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) throw BadRequest("the body is no JSON object, " + kAccepted);
  for (const auto& [key, value] : json.items()) {
    if (key != "reason") throw BadRequest("the body has an unknown key, " + kAccepted);
    if (!value.is_string()) throw BadRequest("the reason is no text, " + kAccepted);
  }
  if (json.empty() && decision == Decision::kConfirm) return "";
  std::string reason = json.value("reason", "");
  if (reason.empty()) throw BadRequest("there is no reason, " + kAccepted);
  CheckReason(reason, kAccepted);
  return reason;
}

MapChangeDecision ParseMapChangeDecision(const std::string& body) {
  static const std::string kAccepted =
      R"(accepted is {"decision": "confirm" or "dismiss", "reason": TEXT} with one line of )"
      "printable text of 1 to " +
      std::to_string(kMaxDecisionReasonBytes) + " bytes, which confirm may leave out";
  const nlohmann::json json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) throw BadRequest("the body is no JSON object, " + kAccepted);
  for (const auto& [key, value] : json.items()) {
    if (key != "decision" && key != "reason") {
      throw BadRequest("the body has an unknown key, " + kAccepted);
    }
    if (!value.is_string()) throw BadRequest("the body's values are no texts, " + kAccepted);
  }
  const std::string name = json.value("decision", "");
  if (name != "confirm" && name != "dismiss")
    throw BadRequest("there is no decision, " + kAccepted);
  MapChangeDecision decision;
  decision.confirms = name == "confirm";
  decision.reason = json.value("reason", "");
  if (decision.reason.empty() && decision.confirms) return decision;
  if (decision.reason.empty()) throw BadRequest("there is no reason, " + kAccepted);
  CheckReason(decision.reason, kAccepted);
  return decision;
}

}  // namespace livemap::web
