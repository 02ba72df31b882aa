#pragma once

#include <string>
#include <string_view>

#include "accounts/account_store.h"
#include "common/mutex.h"
#include "common/queues/token_bucket.h"
#include "web/access/access.h"
#include "web/http/http_message.h"
#include "web/http/request_target.h"
#include "web/officials/account_body.h"

namespace livemap::web {

/// The address of the accounts; what is done to one of them stands below it.
constexpr std::string_view kAccountAddress = "/api/v1/accounts";

/// The zone's accounts and the trail of log-ins, for admins who have logged in. Thread-safe;
/// failures of the account store come out as exceptions.
class AccountApi {
 public:
  /// So many changes one admin may make at once, and another each time the seconds have passed.
  static constexpr int kMaxChanges = 60;
  static constexpr double kSecondsPerChange = 10;

  /// Keeps the reference.
  explicit AccountApi(Access& access);

  /// Whether the path is `/api/v1/accounts` or below it.
  static bool IsAddress(std::string_view path);
  /// Answers `GET /api/v1/accounts` and `.../events`, and `POST` (ParseAccountBody) to `.../add`,
  /// `.../role`, `.../password`, `.../remove`, `.../lock`, `.../unlock` and `.../end_sessions`,
  /// which go into the trail and want the admin's own password (Access::WhyNotConfirmed). Throws
  /// BadRequest.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question);

 private:
  HttpResponse List(const RequestTarget& target) const;
  HttpResponse Events(const RequestTarget& target) const;
  HttpResponse Change(accounts::AccountEventKind action, const std::string& admin,
                      const HttpRequest& question);
  HttpResponse ChangeNow(accounts::AccountEventKind action, const std::string& admin,
                         const AccountBody& body, const HttpRequest& question);
  bool MayChange(const std::string& admin);

  Access& access_;
  Mutex mutex_;
  KeyedTokenBuckets<1> changes_ GUARDED_BY(mutex_);  ///< By admin.
};

}  // namespace livemap::web
