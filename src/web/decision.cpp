#include "web/decision.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "zone/report_validation.h"

namespace livemap {
namespace {

constexpr std::string_view kHazardAddress = "/api/v1/hazards/";

}  // namespace

std::optional<DecisionTarget> ParseDecisionTarget(std::string_view path) {
  if (path.substr(0, kHazardAddress.size()) != kHazardAddress) return std::nullopt;
  path.remove_prefix(kHazardAddress.size());
  for (const auto& [ending, decision] :
       {std::pair<std::string_view, Decision>{"/confirm", Decision::kConfirm},
        {"/reject", Decision::kReject}}) {
    if (path.size() < ending.size()) continue;
    if (path.substr(path.size() - ending.size()) != ending) continue;
    return DecisionTarget{decision, std::string(path.substr(0, path.size() - ending.size()))};
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
  const std::string reason = json.value("reason", "");
  if (reason.empty()) throw BadRequest("there is no reason, " + kAccepted);
  if (!IsPrintableText(reason, kMaxDecisionReasonBytes)) {
    throw BadRequest("the reason of " + std::to_string(reason.size()) + " bytes is not accepted, " +
                     kAccepted);
  }
  return reason;
}

}  // namespace livemap
