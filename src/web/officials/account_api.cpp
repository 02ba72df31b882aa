#include "web/officials/account_api.h"

#include <map>
#include <optional>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "common/sqlite.h"
#include "common/utc_text.h"
#include "web/api/query.h"
#include "web/http/request_body.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

using accounts::AccountEventKind;

constexpr std::string_view kAccountEvents = "/events";

HttpResponse AccountMethodNotAllowed(const char* accepted) {
  HttpResponse answer =
      MakeErrorAnswer(405, std::string("the method is not allowed, accepted is ") + accepted);
  answer.headers.emplace_back("Allow", accepted);
  return answer;
}

std::optional<AccountEventKind> ActionOf(std::string_view what) {
  static const std::map<std::string_view, AccountEventKind> actions{
      {"/add", AccountEventKind::kAdd},
      {"/role", AccountEventKind::kRole},
      {"/password", AccountEventKind::kSetPassword},
      {"/remove", AccountEventKind::kRemove},
      {"/lock", AccountEventKind::kLock},
      {"/unlock", AccountEventKind::kUnlock},
      {"/end_sessions", AccountEventKind::kEndSessions}};
  const auto found = actions.find(what);
  return found == actions.end() ? std::nullopt : std::optional(found->second);
}

/// What would leave the admin without the own rights: the last admin would lock everybody out.
const char* WhyNotOnOwnAccount(AccountEventKind action) {
  switch (action) {
    case AccountEventKind::kLock:
      return "nobody may lock the own account";
    case AccountEventKind::kRole:
      return "nobody may change the own role";
    case AccountEventKind::kRemove:
      return "nobody may remove the own account";
    default:
      return nullptr;
  }
}

}  // namespace

AccountApi::AccountApi(Access& access)
    : access_(access),
      changes_({TokenBucket({kMaxChanges, kMaxChanges * kSecondsPerChange})},
               accounts::AccountStore::kMaxAccounts, KeyedTokenBuckets<1>::Eviction::kAlways) {}

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
  } else if (const auto action = ActionOf(below)) {
    RefuseQueryParameters(target);
    if (question.method != "POST") {
      answer = AccountMethodNotAllowed("POST");
    } else if (auto unconfirmed = access_.WhyNotConfirmed(question)) {
      answer = *std::move(unconfirmed);
    } else {
      answer = Change(*action, admin, question);
    }
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
                                {"role", event.role ? Json(RoleName(*event.role)) : Json()},
                                {"time", Rfc3339(event.at_ns)}});
  }
  // As many as were asked for: there may be more.
  answer["next"] = events.size() == query.limit ? Json(events.back().id) : Json();
  return JsonAnswer(answer);
}

bool AccountApi::MayChange(const std::string& admin) {
  const MutexLock lock(mutex_);
  return changes_.Use(admin, SteadyNs())->front().Take(1);
}

HttpResponse AccountApi::Change(AccountEventKind action, const std::string& admin,
                                const HttpRequest& question) {
  if (!IsJsonType(question.content_type)) return WrongBodyType();
  const AccountBody body = ParseAccountBody(action, question.body);
  const char* const refusal = body.name == admin ? WhyNotOnOwnAccount(action) : nullptr;
  if (refusal != nullptr) return MakeErrorAnswer(409, refusal);
  const bool is_there = access_.accounts()->Has(body.name);
  const bool is_new = action == AccountEventKind::kAdd;
  if (!is_there && !is_new) return MakeErrorAnswer(404, "there is no account of this name");
  if (is_there && is_new) return MakeErrorAnswer(409, "there is an account of this name already");
  if (!MayChange(admin)) return TooMany("too many accounts were changed, try again in a minute");
  const bool hashes = is_new || action == AccountEventKind::kSetPassword;
  const auto change = [&] { return ChangeNow(action, admin, body, question); };
  try {
    return hashes ? access_.HashInTurn(change) : change();
  } catch (const StoreError&) {
    throw;
  } catch (const Error& error) {
    throw BadRequest(error.what());
  }
}

HttpResponse AccountApi::ChangeNow(AccountEventKind action, const std::string& admin,
                                   const AccountBody& body, const HttpRequest& question) {
  accounts::AccountStore& store = *access_.accounts();
  const std::int64_t now_ns = SystemNs();
  Json answer{{"name", body.name}};
  switch (action) {
    case AccountEventKind::kAdd:
      store.Add(body.name, *body.role, body.password, now_ns);
      answer["role"] = RoleName(*body.role);
      break;
    case AccountEventKind::kRole:
      store.SetRole(body.name, *body.role);
      answer["role"] = RoleName(*body.role);
      break;
    case AccountEventKind::kSetPassword:
      store.SetPassword(body.name, body.password, now_ns);
      break;
    case AccountEventKind::kRemove:
      store.Remove(body.name);
      break;
    case AccountEventKind::kEndSessions:
      answer["ended"] = store.EndSessions(body.name);
      break;
    default:
      answer["locked"] = action == AccountEventKind::kLock;
      store.SetLocked(body.name, action == AccountEventKind::kLock);
  }
  store.Note({0, action, body.name, admin, question.client, now_ns, body.role});
  return JsonAnswer(answer);
}

}  // namespace livemap::web
