#include "web/officials/account_api.h"

#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "common/clock.h"
#include "web/api/query.h"
#include "web/http/request_body.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr std::string_view kAccountEvents = "/events";

HttpResponse AccountMethodNotAllowed(const char* accepted) {
  HttpResponse answer =
      MakeErrorAnswer(405, std::string("the method is not allowed, accepted is ") + accepted);
  answer.headers.emplace_back("Allow", accepted);
  return answer;
}

/// None where the body is anything but {"name": TEXT}.
std::optional<std::string> ParseAccountName(const std::string& body) {
  const auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object() || json.size() != 1) return std::nullopt;
  const auto name = json.find("name");
  if (name == json.end() || !name->is_string()) return std::nullopt;
  return name->get<std::string>();
}

std::optional<accounts::AccountEventKind> ActionOf(std::string_view what) {
  if (what == "/lock") return accounts::AccountEventKind::kLock;
  if (what == "/unlock") return accounts::AccountEventKind::kUnlock;
  if (what == "/end_sessions") return accounts::AccountEventKind::kEndSessions;
  return std::nullopt;
}

}  // namespace

bool AccountApi::IsAddress(std::string_view path) {
  return path.substr(0, kAccountAddress.size()) == kAccountAddress &&
         (path.size() == kAccountAddress.size() || path[kAccountAddress.size()] == '/');
}

HttpResponse AccountApi::Answer(const RequestTarget& target, const HttpRequest& question) {
  std::string admin;
  if (auto refusal = access_.WhyNotAdmin(question, admin)) return *std::move(refusal);
  const bool is_read = question.method == "GET" || question.method == "HEAD";
  const std::string_view below = std::string_view(target.path).substr(kAccountAddress.size());
  HttpResponse answer;
  if (below.empty()) {
    answer = is_read ? List(target) : AccountMethodNotAllowed("GET, HEAD");
  } else if (below == kAccountEvents) {
    answer = is_read ? Events(target) : AccountMethodNotAllowed("GET, HEAD");
  } else if (ActionOf(below)) {
    RefuseQueryParameters(target);
    answer = question.method == "POST" ? Change(below, admin, question)
                                       : AccountMethodNotAllowed("POST");
  } else {
    answer = MakeErrorAnswer(404, "there is nothing at this address");
  }
  answer.by_official = true;
  return answer;
}

HttpResponse AccountApi::List(const RequestTarget& target) const {
  RefuseQueryParameters(target);
  const auto sessions = access_.accounts()->CountSessions(SystemNs());
  Json answer;
  answer["accounts"] = Json::array();
  for (const accounts::Account& account : access_.accounts()->List()) {
    const auto open = sessions.find(account.name);
    answer["accounts"].push_back(
        {{"name", account.name},
         {"role", accounts::RoleName(account.role)},
         {"created", Rfc3339(account.created_ns)},
         {"password_set", Rfc3339(account.password_ns)},
         {"last_log_in", account.last_log_in ? Json(Rfc3339(*account.last_log_in)) : Json()},
         {"sessions", open == sessions.end() ? 0 : open->second},
         {"locked", account.locked}});
  }
  return JsonAnswer(answer);
}

HttpResponse AccountApi::Events(const RequestTarget& target) const {
  const DecisionsQuery query = ParseDecisionsQuery(target);
  if (query.hazard) throw BadRequest("parameter hazard is unknown, accepted are before and limit");
  const auto events = access_.accounts()->Events(query.before, query.limit);
  Json answer;
  answer["events"] = Json::array();
  for (const accounts::AccountEvent& event : events) {
    answer["events"].push_back({{"id", event.id},
                                {"event", accounts::AccountEventName(event.kind)},
                                {"name", event.name},
                                {"by", event.by},
                                {"client", event.client},
                                {"time", Rfc3339(event.at_ns)}});
  }
  // As many as were asked for: there may be more.
  answer["next"] = events.size() == query.limit ? Json(events.back().id) : Json();
  return JsonAnswer(answer);
}

HttpResponse AccountApi::Change(std::string_view what, const std::string& admin,
                                const HttpRequest& question) {
  if (!IsJsonType(question.content_type)) return WrongBodyType();
  const auto name = ParseAccountName(question.body);
  if (!name) return MakeErrorAnswer(400, "the body is not accepted, accepted is the text name");
  accounts::AccountStore& store = *access_.accounts();
  if (!store.Has(*name)) return MakeErrorAnswer(404, "there is no account of this name");
  const accounts::AccountEventKind kind = *ActionOf(what);
  if (kind == accounts::AccountEventKind::kLock && *name == admin) {
    return MakeErrorAnswer(409, "nobody may lock the own account");
  }
  Json answer{{"name", *name}};
  if (kind == accounts::AccountEventKind::kEndSessions) {
    answer["ended"] = store.EndSessions(*name);
  } else {
    store.SetLocked(*name, kind == accounts::AccountEventKind::kLock);
    answer["locked"] = kind == accounts::AccountEventKind::kLock;
  }
  store.Note({0, kind, *name, admin, question.client, SystemNs()});
  return JsonAnswer(answer);
}

}  // namespace livemap::web
