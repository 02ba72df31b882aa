#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "accounts/account_store.h"
#include "common/mutex.h"
#include "common/queues/token_bucket.h"
#include "web/access/confirmed_sessions.h"
#include "web/access/official_authenticator.h"
#include "web/http/http_message.h"
#include "web/http/site.h"
#include "web/http/web_config.h"

namespace livemap::web {

/// Knows who asks: an official by the bearer token of a program, or somebody who has logged in by
/// the cookie of a session. A request by cookie that changes something also needs the session's
/// CSRF token in X-CSRF-Token, which no page of another origin can read. Thread-safe; failures of
/// the account store come out as exceptions.
class Access {
 public:
  /// Keeps a reference to the options. Throws Error when the token file or the accounts are not
  /// accepted.
  explicit Access(const WebConfig& options);

  /// Whether anybody may decide at all.
  bool is_open() const { return authenticator_.is_open() || HasAccounts(); }
  bool HasAccounts() const { return accounts_ && accounts_->HasAccounts(); }
  /// Whose session the request's cookie is of; none where it is none's.
  std::optional<accounts::Person> PersonOf(const HttpRequest& question) const;
  /// Whether the request is an official's; a wrong token is not counted. Quick.
  bool IsByOfficial(const HttpRequest& question) const;
  /// The same, and a wrong token is counted against the client.
  bool CheckOfficial(const HttpRequest& question);
  /// What whoever asks may see. Quick.
  Visibility VisibilityFor(const HttpRequest& question) const;
  /// None where the request may decide something in the name of `official`, else the refusal. By a
  /// token that speaks for others the official is "NAME at OWNER": whom the request names in
  /// X-LiveMap-On-Behalf-Of, and whose the token is. Any other request that names somebody is
  /// refused.
  std::optional<HttpResponse> WhyNotOfficial(const HttpRequest& question, std::string& official);

  /// None where the request may do in the name of `admin` what is about the zone itself, else the
  /// refusal: only somebody who has logged in may, no program by a token.
  std::optional<HttpResponse> WhyNotAdmin(const HttpRequest& question, std::string& admin) const;
  /// None where whoever has logged in has shown the password in the last kConfirmedS seconds, else
  /// a refusal whose key `confirm` is true.
  std::optional<HttpResponse> WhyNotConfirmed(const HttpRequest& question) const;
  /// Runs `work`, which hashes a password, and returns its answer. While another password is hashed
  /// it is not run, and the answer is a refusal: each takes 64 MiB.
  HttpResponse HashInTurn(const std::function<HttpResponse()>& work);
  /// Null where the zone keeps no accounts.
  accounts::AccountStore* accounts() { return accounts_ ? &*accounts_ : nullptr; }

  /// `POST /api/v1/session` with `{"name", "password"}`: opens a session, whose cookie it sets.
  HttpResponse LogIn(const HttpRequest& question);
  /// `POST /api/v1/session/confirm` with `{"password"}`: whoever has logged in shows the password
  /// again, which a log-in has done, too.
  HttpResponse Confirm(const HttpRequest& question);
  /// `DELETE /api/v1/session`: closes it.
  HttpResponse LogOut(const HttpRequest& question);
  /// `GET /api/v1/session`: who has logged in, and what may be seen.
  HttpResponse Session(const HttpRequest& question) const;

  /// So many passwords of one account, or from one client, may be wrong at once, and another each
  /// time the seconds have passed.
  static constexpr int kMaxWrongPasswords = 10;
  static constexpr double kSecondsPerWrongPassword = 60;
  /// What changes accounts wants a password that was shown so lately, s.
  static constexpr double kConfirmedS = 300;

 private:
  std::string CookieName() const;
  std::string SessionToken(const HttpRequest& question) const;
  /// The cookie of a session, or of none any more.
  std::string Cookie(const std::string& token, double lasts_s) const;
  /// Into the trail of log-ins: what the account's owner did, or somebody in its name.
  void Note(accounts::AccountEventKind kind, const std::string& name, const HttpRequest& question);
  bool MayTryPassword(const std::string& client, const std::string& name) const;
  std::optional<accounts::Person> CheckPassword(const HttpRequest& question,
                                                const std::string& name,
                                                const std::string& password, HttpResponse& refusal);
  void CountWrongPassword(const std::string& client, const std::string& name);
  /// Refuses pages of other origins, and forged requests of a session.
  std::optional<HttpResponse> WhyForged(const HttpRequest& question,
                                        const std::string& session_token) const;

  const WebConfig& options_;
  OfficialAuthenticator authenticator_;
  std::optional<accounts::AccountStore> accounts_;
  /// One password at a time is hashed: each takes 64 MiB and a thread that others wait for.
  std::atomic_flag hashes_ = ATOMIC_FLAG_INIT;
  mutable Mutex mutex_;
  /// By client and by account, "c:NAME" and "a:NAME".
  KeyedTokenBuckets<1> attempts_ GUARDED_BY(mutex_);
  ConfirmedSessions confirmed_ GUARDED_BY(mutex_){kConfirmedS};
};

/// An official's name has at most so many bytes, also with " at " and the owner of a token that
/// speaks for others.
constexpr std::size_t kMaxOfficialBytes = 64;

/// Status 429, to be asked again in a minute.
HttpResponse TooMany(const std::string& sentence);

/// Status 401: reading this needs a log-in.
HttpResponse LogInFirst();

}  // namespace livemap::web
