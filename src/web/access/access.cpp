#include "web/access/access.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "common/clock.h"
#include "common/sha256.h"
#include "common/time.h"
#include "protocol/text_rules.h"
#include "web/http/cookie.h"
#include "web/http/origin.h"
#include "web/http/request_body.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr std::size_t kMaxCountedNames = 8192;

HttpResponse Unauthorized(const std::string& sentence) {
  HttpResponse answer = MakeErrorAnswer(401, sentence);
  answer.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"livemap\"");
  return answer;
}

/// Whoever can read an answer to the session knows it; a page of another origin cannot.
std::string CsrfTokenOf(const std::string& session_token) {
  return Sha256Hex("csrf " + session_token);
}

Json PersonJson(const accounts::Person& person, const std::string& session_token) {
  return {{"name", person.name},
          {"role", accounts::RoleName(person.role)},
          {"csrf_token", CsrfTokenOf(session_token)}};
}

struct LogInBody {
  std::string name;
  std::string password;
};

/// None where the body is anything but {"name": TEXT, "password": TEXT}.
std::optional<LogInBody> ParseLogIn(const std::string& body) {
  const auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object() || json.size() != 2) return std::nullopt;
  const auto name = json.find("name");
  const auto password = json.find("password");
  if (name == json.end() || !name->is_string()) return std::nullopt;
  if (password == json.end() || !password->is_string()) return std::nullopt;
  return LogInBody{*name, *password};
}

/// None where the body is anything but {"password": TEXT}.
std::optional<std::string> ParseConfirmation(const std::string& body) {
  const auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object() || json.size() != 1) return std::nullopt;
  const auto password = json.find("password");
  if (password == json.end() || !password->is_string()) return std::nullopt;
  return password->get<std::string>();
}

/// Sets a flag as long as it lives, where nobody else had.
class Turn {
 public:
  explicit Turn(std::atomic_flag& flag) : flag_(flag), is_mine_(!flag.test_and_set()) {}
  ~Turn() {
    if (is_mine_) flag_.clear();
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  bool is_mine() const { return is_mine_; }

 private:
  std::atomic_flag& flag_;
  const bool is_mine_;
};

/// Puts whom the request names before the token's owner; else the refusal.
std::optional<HttpResponse> SpeakFor(const std::string& other, bool may_speak,
                                     std::string& official) {
  if (!may_speak) {
    return MakeErrorAnswer(
        403, std::string("X-LiveMap-On-Behalf-Of names somebody, accepted is that from a token "
                         "alone behind which the token file has the word ") +
                 kSpeaksForOthers);
  }
  std::string name = other + " at " + official;
  if (!protocol::IsAcceptableName(other, kMaxOfficialBytes) || name.size() > kMaxOfficialBytes) {
    return MakeErrorAnswer(400,
                           "X-LiveMap-On-Behalf-Of is not accepted, accepted is a printable "
                           "name that has with ' at " +
                               official + "' at most " + std::to_string(kMaxOfficialBytes) +
                               " bytes");
  }
  official = std::move(name);
  return std::nullopt;
}

}  // namespace

HttpResponse TooMany(const std::string& sentence) {
  HttpResponse answer = MakeErrorAnswer(429, sentence);
  answer.headers.emplace_back("Retry-After", "60");
  return answer;
}

HttpResponse LogInFirst() { return Unauthorized("log in to see this"); }

Access::Access(const WebConfig& options)
    : options_(options),
      authenticator_(options.token_file.empty() ? std::vector<Official>()
                                                : ReadTokenFile(options.token_file)),
      attempts_({TokenBucket({kMaxWrongPasswords, kMaxWrongPasswords * kSecondsPerWrongPassword})},
                kMaxCountedNames, KeyedTokenBuckets<1>::Eviction::kAlways) {
  if (options.accounts_file.empty()) return;
  accounts_.emplace(options.accounts_file, accounts::AccountStore::Config{options.session_s});
}

/// Of this zone alone: browsers keep cookies by host, and ports do not count.
std::string Access::CookieName() const { return "livemap_" + accounts_->id(); }

std::string Access::SessionToken(const HttpRequest& question) const {
  return accounts_ && !question.cookie.empty() ? CookieValue(question.cookie, CookieName()) : "";
}

std::optional<accounts::Person> Access::PersonOf(const HttpRequest& question) const {
  const std::string token = SessionToken(question);
  return token.empty() ? std::nullopt : accounts_->FindSession(token, SystemNs());
}

bool Access::IsByOfficial(const HttpRequest& question) const {
  if (!question.authorization.empty()) {
    return authenticator_.IsRight(question.authorization, question.client, Seconds(SteadyNs()));
  }
  const auto person = PersonOf(question);
  return person && person->role >= accounts::Role::kOfficial;
}

bool Access::CheckOfficial(const HttpRequest& question) {
  if (question.authorization.empty()) return IsByOfficial(question);
  return authenticator_.Check(question.authorization, question.client, Seconds(SteadyNs()))
             .verdict == OfficialAuthenticator::Verdict::kAllowed;
}

Visibility Access::VisibilityFor(const HttpRequest& question) const {
  const bool shows_token = !question.authorization.empty();
  if (shows_token ? IsByOfficial(question) : PersonOf(question).has_value()) return {};
  if (!HasAccounts()) return {};
  Visibility visibility;
  visibility.vehicles = false;
  visibility.candidates = options_.public_sees == PublicSees::kAll;
  visibility.told = options_.public_sees != PublicSees::kNothing;
  return visibility;
}

std::optional<HttpResponse> Access::WhyForged(const HttpRequest& question,
                                              const std::string& session_token) const {
  const bool only_https = !options_.certificate_file.empty();
  if (!IsAllowedOrigin(question.origin, question.host, options_.allowed_origins, only_https)) {
    return MakeErrorAnswer(403, "pages of another origin may not decide anything");
  }
  const bool changes_something = question.method != "GET" && question.method != "HEAD";
  if (session_token.empty() || !changes_something) return std::nullopt;
  // Both are hashes of one length: what is compared tells nothing of the token.
  if (question.csrf_token == CsrfTokenOf(session_token)) return std::nullopt;
  return MakeErrorAnswer(403, "the header X-CSRF-Token is not the session's");
}

std::optional<HttpResponse> Access::WhyNotOfficial(const HttpRequest& question,
                                                   std::string& official) {
  const auto person = question.authorization.empty() ? PersonOf(question) : std::nullopt;
  if (auto forged = WhyForged(question, person ? SessionToken(question) : "")) return forged;
  if (person) {
    if (person->role < accounts::Role::kOfficial) {
      return MakeErrorAnswer(403, "a viewer may not decide anything");
    }
    official = person->name;
    return question.on_behalf_of.empty() ? std::nullopt
                                         : SpeakFor(question.on_behalf_of, false, official);
  }
  OfficialAuthenticator::Answer answer =
      authenticator_.Check(question.authorization, question.client, Seconds(SteadyNs()));
  switch (answer.verdict) {
    case OfficialAuthenticator::Verdict::kAllowed:
      official = std::move(answer.official);
      return question.on_behalf_of.empty()
                 ? std::nullopt
                 : SpeakFor(question.on_behalf_of, answer.speaks_for_others, official);
    case OfficialAuthenticator::Verdict::kClosed:
      if (HasAccounts()) return Unauthorized("log in to decide anything");
      return MakeErrorAnswer(403,
                             "nobody may decide anything here: the server was started without a "
                             "token file and has no accounts");
    case OfficialAuthenticator::Verdict::kNoToken:
      return Unauthorized(HasAccounts() ? "log in, or send a token: Authorization: Bearer TOKEN"
                                        : "a token is needed: Authorization: Bearer TOKEN");
    case OfficialAuthenticator::Verdict::kWrongToken:
      return Unauthorized("the token is wrong");
    case OfficialAuthenticator::Verdict::kTooManyWrong:
      break;
  }
  return TooMany("too many wrong tokens came from your address, try again in a minute");
}

std::optional<HttpResponse> Access::WhyNotAdmin(const HttpRequest& question,
                                                std::string& admin) const {
  const auto person = PersonOf(question);
  if (!person) return Unauthorized("log in as an admin");
  if (auto forged = WhyForged(question, SessionToken(question))) return forged;
  if (person->role < accounts::Role::kAdmin) {
    return MakeErrorAnswer(403, "only an admin may see and change accounts");
  }
  admin = person->name;
  return std::nullopt;
}

HttpResponse Access::HashInTurn(const std::function<HttpResponse()>& work) {
  const Turn turn(hashes_);
  if (!turn.is_mine()) return MakeBusyAnswer("another password is looked at just now");
  return work();
}

void Access::Note(accounts::AccountEventKind kind, const std::string& name,
                  const HttpRequest& question) {
  accounts_->Note({0, kind, name, name, question.client, SystemNs()});
}

bool Access::MayTryPassword(const std::string& client, const std::string& name) const {
  const std::int64_t now_ns = SteadyNs();
  const MutexLock lock(mutex_);
  for (const std::string& key : {"c:" + client, "a:" + name}) {
    const auto* attempts = attempts_.Find(key);
    if (attempts != nullptr && attempts->front().TokensAt(now_ns) < 1) return false;
  }
  return true;
}

void Access::CountWrongPassword(const std::string& client, const std::string& name) {
  const std::int64_t now_ns = SteadyNs();
  const MutexLock lock(mutex_);
  for (const std::string& key : {"c:" + client, "a:" + name}) {
    attempts_.Use(key, now_ns)->front().Spend(1);
  }
}

/// Secure: browsers send it by HTTPS, or to this machine itself.
std::string Access::Cookie(const std::string& token, double lasts_s) const {
  return CookieName() + "=" + token + "; Path=/; Secure; HttpOnly; SameSite=Strict; Max-Age=" +
         std::to_string(static_cast<std::int64_t>(lasts_s));
}

HttpResponse Access::LogIn(const HttpRequest& question) {
  if (auto forged = WhyForged(question, "")) return *std::move(forged);
  if (!HasAccounts()) return MakeErrorAnswer(403, "this zone has no accounts");
  if (!IsJsonType(question.content_type)) return WrongBodyType();
  const auto body = ParseLogIn(question.body);
  if (!body) {
    return MakeErrorAnswer(400,
                           "the body is not accepted, accepted are the texts name and password");
  }
  HttpResponse refusal;
  const auto person = CheckPassword(question, body->name, body->password, refusal);
  if (!person) return refusal;
  const std::string token = accounts_->OpenSession(person->name, SystemNs());
  {
    const MutexLock lock(mutex_);
    confirmed_.Confirm(token, SteadyNs());
  }
  Note(accounts::AccountEventKind::kLogIn, person->name, question);
  HttpResponse answer = JsonAnswer(PersonJson(*person, token));
  answer.headers.emplace_back("Set-Cookie", Cookie(token, options_.session_s));
  return answer;
}

/// Whose password it is; none, and a refusal, where it is nobody's or is not looked at now.
std::optional<accounts::Person> Access::CheckPassword(const HttpRequest& question,
                                                      const std::string& name,
                                                      const std::string& password,
                                                      HttpResponse& refusal) {
  // By its hash: a name may be as long as a body.
  const std::string counted = Sha256Hex(name);
  if (!MayTryPassword(question.client, counted)) {
    refusal = TooMany("too many passwords were wrong, try again in a minute");
    return std::nullopt;
  }
  const Turn turn(hashes_);
  if (!turn.is_mine()) {
    refusal = MakeBusyAnswer("another password is looked at just now");
    return std::nullopt;
  }
  auto person = accounts_->CheckPassword(name, password);
  if (person) return person;
  CountWrongPassword(question.client, counted);
  // A name that is none is not written down: it may be a password in the wrong field.
  const bool is_name = accounts_->Has(name);
  Note(accounts::AccountEventKind::kWrongPassword, is_name ? name : "", question);
  refusal = Unauthorized("the name or the password is wrong");
  return std::nullopt;
}

HttpResponse Access::Confirm(const HttpRequest& question) {
  const auto person = PersonOf(question);
  if (!person) return Unauthorized("nobody has logged in");
  const std::string token = SessionToken(question);
  if (auto forged = WhyForged(question, token)) return *std::move(forged);
  if (!IsJsonType(question.content_type)) return WrongBodyType();
  const auto password = ParseConfirmation(question.body);
  if (!password) {
    return MakeErrorAnswer(400, "the body is not accepted, accepted is the text password");
  }
  HttpResponse refusal;
  if (!CheckPassword(question, person->name, *password, refusal)) return refusal;
  const MutexLock lock(mutex_);
  confirmed_.Confirm(token, SteadyNs());
  return JsonAnswer({{"name", person->name}, {"confirmed_s", kConfirmedS}});
}

std::optional<HttpResponse> Access::WhyNotConfirmed(const HttpRequest& question) const {
  const MutexLock lock(mutex_);
  if (confirmed_.IsConfirmed(SessionToken(question), SteadyNs())) return std::nullopt;
  HttpResponse refusal =
      JsonAnswer({{"error", "enter your own password again"}, {"confirm", true}});
  refusal.status = 403;
  return refusal;
}

HttpResponse Access::LogOut(const HttpRequest& question) {
  const std::string token = SessionToken(question);
  const auto person = PersonOf(question);
  if (!person) return Unauthorized("nobody has logged in");
  if (auto forged = WhyForged(question, token)) return *std::move(forged);
  accounts_->CloseSession(token);
  Note(accounts::AccountEventKind::kLogOut, person->name, question);
  HttpResponse answer = JsonAnswer({{"name", nullptr}});
  answer.headers.emplace_back("Set-Cookie", Cookie("", 0));
  return answer;
}

HttpResponse Access::Session(const HttpRequest& question) const {
  const auto person = PersonOf(question);
  Json answer = person ? PersonJson(*person, SessionToken(question)) : Json{{"name", nullptr}};
  const Visibility visibility = VisibilityFor(question);
  answer["has_accounts"] = HasAccounts();
  answer["sees"] = {{"told", visibility.told},
                    {"candidates", visibility.candidates},
                    {"vehicles", visibility.vehicles}};
  return JsonAnswer(answer);
}

}  // namespace livemap::web
