#include "web/officials/official_api.h"

#include "common/time.h"
#include "common/utc_text.h"
#include "web/http/request_body.h"
#include "web/json/map_change_json.h"
#include "web/officials/desk_body.h"

namespace livemap::web {
namespace {

constexpr char kHazardIsGone[] = "the hazard is gone; seen again it is a new one";
constexpr char kMapChangeIsUndone[] = "the map change is undone; told again it is a new one";
constexpr char kUnknownVehicle[] = "the zone has never heard of a vehicle of this name";

/// None when the decision is taken back, now or before.
std::optional<HttpResponse> WhyNotUndone(zone::ZoneService::Undone undone, const std::string& what,
                                         const std::string& why_gone) {
  switch (undone) {
    case zone::ZoneService::Undone::kDone:
    case zone::ZoneService::Undone::kBefore:
      return std::nullopt;
    case zone::ZoneService::Undone::kNothing:
      return MakeErrorAnswer(409, "no decision about the " + what + " is known to undo");
    case zone::ZoneService::Undone::kOther:
      return MakeErrorAnswer(
          409, "another decision about the " + what + " was made since, and nothing is undone");
    case zone::ZoneService::Undone::kGone:
      return MakeErrorAnswer(409, why_gone);
    case zone::ZoneService::Undone::kUnknown:
      break;
  }
  return MakeErrorAnswer(404, "the zone knows no " + what + " with this id");
}

/// What was decided about, with the id by which an undo names this decision.
HttpResponse DecidedAnswer(Json feature, std::uint64_t decision_id) {
  feature["properties"]["decision_id"] = decision_id;
  return JsonAnswer(feature, "application/geo+json");
}

}  // namespace

HttpResponse OfficialApi::Decide(const DecisionTarget& target, const HttpRequest& question) {
  std::string official;
  if (auto refusal = access_.WhyNotOfficial(question, official)) return *std::move(refusal);
  HttpResponse answer = DecideAs(official, target, question);
  answer.by_official = true;
  return answer;
}

HttpResponse OfficialApi::DecideAs(const std::string& official, const DecisionTarget& target,
                                   const HttpRequest& question) {
  if (!question.body.empty() && !IsJsonType(question.content_type)) {
    return WrongBodyType();
  }
  try {
    return DecideNow(official, target, question);
  } catch (const zone::DecisionConflict& conflict) {
    HttpResponse answer = JsonAnswer({{"error", conflict.what()}, {"changed", true}});
    answer.status = 409;
    return answer;
  } catch (const zone::DecisionTooOften& refusal) {
    HttpResponse answer = MakeErrorAnswer(429, refusal.what());
    answer.headers.emplace_back("Retry-After", "120");
    return answer;
  }
}

HttpResponse OfficialApi::DecideNow(const std::string& official, const DecisionTarget& target,
                                    const HttpRequest& question) {
  if (target.decision == Decision::kMapChange) {
    return DecideMapChange(target, official, question.body);
  }
  if (IsDeskDecision(target.decision)) return ActAtDesk(target, official, question.body);
  const DecisionBody body = ParseDecisionBody(target.decision, question.body);
  if (target.decision == Decision::kDistrust || target.decision == Decision::kTrust) {
    return DecideVehicle(target, official, body.reason);
  }
  if (target.decision == Decision::kUndo) return UndoHazard(target.id, official, body);
  return DecideHazard(target, official, body);
}

HttpResponse OfficialApi::DecideHazard(const DecisionTarget& target, const std::string& official,
                                       const DecisionBody& body) {
  const auto uuid = Uuid::Parse(target.id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  const auto hazard = zone_.Find(*uuid);
  if (!hazard) return MakeErrorAnswer(404, "the zone knows no hazard with this id");
  const auto decided = target.decision == Decision::kReject
                           ? zone_.Reject(*uuid, official, body.reason, body.seen)
                       : target.decision == Decision::kClose
                           ? zone_.Close(*uuid, official, body.reason, body.seen)
                           : zone_.Confirm(*uuid, official, body.reason, body.seen);
  if (!decided) {
    return MakeErrorAnswer(409, hazard->state == zone::HazardState::kRejected
                                    ? "the hazard is rejected already"
                                    : kHazardIsGone);
  }
  const zone::Hazard now = *zone_.Find(*uuid);
  return DecidedAnswer(HazardFeature(now, catalogue_, zone_.WordsOf(now)), *decided);
}

HttpResponse OfficialApi::ActAtDesk(const DecisionTarget& target, const std::string& official,
                                    const std::string& body) {
  const zone::DeskAction action = ParseDeskAction(target.decision, body);
  const auto uuid = Uuid::Parse(target.id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  if (target.decision == Decision::kClass && !catalogue_.Names(action.class_name)) {
    throw BadRequest("the zone's catalogue has no such class, see /api/v1/classes");
  }
  const auto decided = zone_.Act(*uuid, official, action);
  if (!decided) return MakeErrorAnswer(404, "the zone knows no hazard with this id");
  const zone::Hazard now = *zone_.Find(*uuid);
  return DecidedAnswer(HazardFeature(now, catalogue_, zone_.WordsOf(now)), *decided);
}

HttpResponse OfficialApi::UndoHazard(const std::string& id, const std::string& official,
                                     const DecisionBody& body) {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  const auto undone = zone_.Undo(*uuid, official, body.reason, body.decision_id);
  if (auto refusal = WhyNotUndone(undone, "hazard", kHazardIsGone)) return *std::move(refusal);
  const zone::Hazard hazard = *zone_.Find(*uuid);
  return JsonAnswer(HazardFeature(hazard, catalogue_, zone_.WordsOf(hazard)),
                    "application/geo+json");
}

HttpResponse OfficialApi::DecideMapChange(const DecisionTarget& target, const std::string& official,
                                          const std::string& body) {
  const MapChangeDecision decision = ParseMapChangeDecision(body);
  const auto uuid = Uuid::Parse(target.id);
  if (!uuid) throw BadRequest("the map change's id is no UUID");
  if (decision.undoes) {
    const auto undone = zone_.UndoMapChange(*uuid, official, decision.reason, decision.decision_id);
    if (auto refusal = WhyNotUndone(undone, "map change", kMapChangeIsUndone)) {
      return *std::move(refusal);
    }
    return JsonAnswer(MapChangeGeoJson(*zone_.FindMapChange(*uuid)), "application/geo+json");
  }
  const auto feature = zone_.FindMapChange(*uuid);
  if (!feature) return MakeErrorAnswer(404, "the zone knows no map change with this id");
  const auto decided = decision.confirms ? zone_.ConfirmMapChange(*uuid, official, decision.reason)
                                         : zone_.DismissMapChange(*uuid, official, decision.reason);
  if (!decided) {
    return MakeErrorAnswer(409, feature->state == zone::MapChangeState::kDismissed
                                    ? "the map change is dismissed already"
                                    : kMapChangeIsUndone);
  }
  return DecidedAnswer(MapChangeGeoJson(*zone_.FindMapChange(*uuid)), *decided);
}

HttpResponse OfficialApi::DecideVehicle(const DecisionTarget& target, const std::string& official,
                                        const std::string& reason) {
  const auto changed = target.decision == Decision::kDistrust
                           ? zone_.Distrust(target.id, official, reason)
                           : zone_.Trust(target.id, official, reason);
  if (!changed) return MakeErrorAnswer(404, kUnknownVehicle);
  return JsonAnswer({{"vehicle", target.id}, {"hazards", *changed}});
}

HttpResponse OfficialApi::Preview(const DecisionTarget& target, const HttpRequest& question) {
  std::string official;
  if (auto refusal = access_.WhyNotOfficial(question, official)) return *std::move(refusal);
  HttpResponse answer = PreviewDistrust(target.id);
  answer.by_official = true;
  return answer;
}

/// "hazard", "map_change" or "vehicle".
const char* OfficialApi::KindOfSubject(const zone::DecisionRecord& decision) const {
  switch (decision.kind) {
    case zone::DecisionKind::kConfirmHazard:
    case zone::DecisionKind::kRejectHazard:
    case zone::DecisionKind::kCloseHazard:
    case zone::DecisionKind::kComment:
    case zone::DecisionKind::kAssign:
    case zone::DecisionKind::kReclassHazard:
    case zone::DecisionKind::kMoveHazard:
    case zone::DecisionKind::kMergeHazard:
    case zone::DecisionKind::kAskFrame:
    case zone::DecisionKind::kCloseOrder:
    case zone::DecisionKind::kRetryOrder:
      return "hazard";
    case zone::DecisionKind::kConfirmMapChange:
    case zone::DecisionKind::kDismissMapChange:
      return "map_change";
    case zone::DecisionKind::kDistrustVehicle:
    case zone::DecisionKind::kTrustVehicle:
    case zone::DecisionKind::kForgetVehicle:
      return "vehicle";
    case zone::DecisionKind::kUndo:
      break;
  }
  const auto uuid = Uuid::Parse(decision.subject);
  return uuid && zone_.Find(*uuid) ? "hazard" : "map_change";
}

HttpResponse OfficialApi::Decisions(const DecisionsQuery& query) const {
  Json answer;
  answer["decisions"] = Json::array();
  const auto decisions = query.hazard ? zone_.DecisionsAbout(*query.hazard, query.limit)
                                      : zone_.Decisions(query.before, query.limit);
  for (const zone::DecisionRecord& decision : decisions) {
    const bool is_undone = decision.undone_by != 0;
    answer["decisions"].push_back({{"id", decision.id},
                                   {"decision", DecisionName(decision.kind)},
                                   {"about", KindOfSubject(decision)},
                                   {"subject", decision.subject},
                                   {"official", decision.official},
                                   {"reason", decision.reason},
                                   {"detail", decision.detail},
                                   {"hazards", decision.hazards},
                                   {"time", Rfc3339(decision.at_ns)},
                                   {"undone_by", is_undone ? Json(decision.undone_by) : Json()}});
  }
  // As many as were asked for: there may be more.
  const bool is_cut = !query.hazard && decisions.size() == query.limit;
  answer["next"] = is_cut ? Json(decisions.back().id) : Json();
  return JsonAnswer(answer);
}

HttpResponse OfficialApi::PreviewDistrust(const std::string& vehicle) const {
  const auto preview = zone_.PreviewDistrust(vehicle);
  if (!preview) return MakeErrorAnswer(404, kUnknownVehicle);
  Json answer;
  answer["vehicle"] = vehicle;
  answer["distrusted"] = preview->is_distrusted;
  answer["hazards"] = preview->hazards;
  answer["would_change"] = preview->would_change;
  answer["would_vanish"] = preview->would_vanish;
  answer["examples"] = Json::array();
  for (const zone::DistrustExample& example : preview->examples) {
    answer["examples"].push_back({{"id", example.hazard},
                                  {"class", example.class_name},
                                  {"from", example.from},
                                  {"to", example.to}});
  }
  answer["decisions"] = Json::array();
  for (const zone::DecisionRecord& decision : preview->decisions) {
    answer["decisions"].push_back({{"decision", DecisionName(decision.kind)},
                                   {"official", decision.official},
                                   {"reason", decision.reason},
                                   {"hazards", decision.hazards},
                                   {"time", Rfc3339(decision.at_ns)},
                                   {"undone", decision.undone_by != 0}});
  }
  return JsonAnswer(answer);
}

}  // namespace livemap::web
