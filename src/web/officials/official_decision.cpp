#include "web/officials/official_decision.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/text_rules.h"

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
    {"/api/v1/hazards/", "/undo", Decision::kUndo},
    {"/api/v1/hazards/", "/close", Decision::kClose},
    {"/api/v1/hazards/", "/comment", Decision::kComment},
    {"/api/v1/hazards/", "/assign", Decision::kAssign},
    {"/api/v1/hazards/", "/class", Decision::kClass},
    {"/api/v1/hazards/", "/move", Decision::kMove},
    {"/api/v1/hazards/", "/merge", Decision::kMerge},
    {"/api/v1/hazards/", "/frame", Decision::kFrame},
    {"/api/v1/vehicles/", "/distrust", Decision::kDistrust},
    {"/api/v1/vehicles/", "/trust", Decision::kTrust},
    {"/api/v1/changes/", "/decision", Decision::kMapChange},
};

bool NeedsReason(Decision decision) {
  return decision == Decision::kReject || decision == Decision::kDistrust;
}

void CheckReason(const std::string& reason, const std::string& accepted) {
  if (protocol::Trimmed(reason).empty()) throw BadRequest("the reason is all blanks, " + accepted);
  if (protocol::IsAcceptableText(reason, kMaxDecisionReasonBytes)) return;
  throw BadRequest("the reason of " + std::to_string(reason.size()) + " bytes is not accepted, " +
                   accepted);
}

/// A body's "decision_id", if it has one.
std::optional<std::uint64_t> DecisionIdOf(const nlohmann::json& json) {
  const auto id = json.find("decision_id");
  if (id == json.end()) return std::nullopt;
  if (!id->is_number_unsigned() || *id == 0U) {
    throw BadRequest(
        "the decision_id is not accepted, accepted is the number that the answer to the "
        "decision had");
  }
  return id->get<std::uint64_t>();
}

/// A body's "sequence" and "position", if it has them.
std::optional<zone::SeenHazard> SeenHazardOf(const nlohmann::json& json) {
  const auto sequence = json.find("sequence");
  const auto position = json.find("position");
  if (sequence == json.end() && position == json.end()) return std::nullopt;
  if (sequence == json.end() || !sequence->is_number_unsigned()) {
    throw BadRequest(
        "the sequence is not accepted, accepted is the number that the hazard had when it was "
        "seen");
  }
  zone::SeenHazard seen;
  seen.sequence = sequence->get<std::uint64_t>();
  if (position == json.end()) return seen;
  const bool is_pair = position->is_array() && position->size() == 2 &&
                       (*position)[0].is_number() && (*position)[1].is_number();
  if (is_pair) seen.position = geo::GeoPoint{(*position)[1], (*position)[0]};
  if (!is_pair || !geo::IsValid(*seen.position)) {
    throw BadRequest("the position is not accepted, accepted is [LONGITUDE, LATITUDE] in degrees");
  }
  return seen;
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

DecisionBody ParseDecisionBody(Decision decision, const std::string& body) {
  static const std::string kAccepted =
      R"(accepted is {"reason": TEXT} with one line of printable text of 1 to )" +
      std::to_string(kMaxDecisionReasonBytes) + " bytes";
  if (body.empty() && !NeedsReason(decision)) return {};
  const nlohmann::json json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) throw BadRequest("the body is no JSON object, " + kAccepted);
  DecisionBody read;
  const bool may_be_seen = decision == Decision::kConfirm || decision == Decision::kReject ||
                           decision == Decision::kClose;
  for (const auto& [key, value] : json.items()) {
    if (key == "decision_id" && decision == Decision::kUndo) continue;
    if ((key == "sequence" || key == "position") && may_be_seen) continue;
    if (key != "reason") throw BadRequest("the body has an unknown key, " + kAccepted);
    if (!value.is_string()) throw BadRequest("the reason is no text, " + kAccepted);
  }
  read.decision_id = DecisionIdOf(json);
  read.seen = SeenHazardOf(json);
  if (json.count("reason") == 0 && !NeedsReason(decision)) return read;
  read.reason = json.value("reason", "");
  if (read.reason.empty()) throw BadRequest("there is no reason, " + kAccepted);
  CheckReason(read.reason, kAccepted);
  return read;
}

MapChangeDecision ParseMapChangeDecision(const std::string& body) {
  static const std::string kAccepted =
      R"(accepted is {"decision": "confirm", "dismiss" or "undo", "reason": TEXT} with one line of )"
      "printable text of 1 to " +
      std::to_string(kMaxDecisionReasonBytes) + " bytes, which confirm and undo may leave out";
  const nlohmann::json json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) throw BadRequest("the body is no JSON object, " + kAccepted);
  const bool undoes = json.value("decision", nlohmann::json()) == "undo";
  for (const auto& [key, value] : json.items()) {
    if (key == "decision_id" && undoes) continue;
    if (key != "decision" && key != "reason") {
      throw BadRequest("the body has an unknown key, " + kAccepted);
    }
    if (!value.is_string()) throw BadRequest("the body's values are no texts, " + kAccepted);
  }
  const std::string name = json.value("decision", "");
  if (name != "confirm" && name != "dismiss" && name != "undo")
    throw BadRequest("there is no decision, " + kAccepted);
  MapChangeDecision decision;
  decision.confirms = name == "confirm";
  decision.undoes = undoes;
  decision.decision_id = DecisionIdOf(json);
  decision.reason = json.value("reason", "");
  if (decision.reason.empty() && name != "dismiss") return decision;
  if (decision.reason.empty()) throw BadRequest("there is no reason, " + kAccepted);
  CheckReason(decision.reason, kAccepted);
  return decision;
}

}  // namespace livemap::web
