#pragma once

#include <string>
#include <string_view>

#include "web/access/access.h"
#include "web/http/http_message.h"
#include "web/http/request_target.h"

namespace livemap::web {

/// The address of the accounts; what is done to one of them stands below it.
constexpr std::string_view kAccountAddress = "/api/v1/accounts";

/// The zone's accounts and the trail of log-ins, for admins who have logged in. Thread-safe;
/// failures of the account store come out as exceptions.
class AccountApi {
 public:
  /// Keeps the reference.
  explicit AccountApi(Access& access) : access_(access) {}

  /// Whether the path is `/api/v1/accounts` or below it.
  static bool IsAddress(std::string_view path);
  /// Answers `GET /api/v1/accounts` and `.../events`, and `POST` of `{"name": NAME}` to `.../lock`,
  /// `.../unlock` and `.../end_sessions`, which go into the trail. Throws BadRequest.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question);

 private:
  HttpResponse List(const RequestTarget& target) const;
  HttpResponse Events(const RequestTarget& target) const;
  HttpResponse Change(std::string_view what, const std::string& admin, const HttpRequest& question);

  Access& access_;
};

}  // namespace livemap::web
