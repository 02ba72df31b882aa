#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "common/uuid.h"
#include "orders/desk/order_desk.h"
#include "web/access/access.h"
#include "web/api/query.h"
#include "web/http/http_message.h"

namespace livemap::web {

/// The address of all work orders; what one of them is told stands below it.
constexpr std::string_view kOrderAddress = "/api/v1/orders";

/// The zone's work orders, for officials only: they name people. Thread-safe; store failures come
/// out as exceptions.
class OrderApi {
 public:
  /// Keeps references. `desk`: null where the zone has no work orders.
  OrderApi(Access& access, orders::OrderDesk* desk) : access_(access), desk_(desk) {}

  /// Whether the path is `/api/v1/orders` or below it.
  static bool IsAddress(std::string_view path);
  /// Answers `GET /api/v1/orders`, `POST /api/v1/orders/UUID/close` and `.../retry`. Throws
  /// BadRequest.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question);

 private:
  HttpResponse List(const RequestTarget& target) const;
  HttpResponse Change(const RequestTarget& target, const std::string& official);

  Access& access_;
  orders::OrderDesk* const desk_;
};

}  // namespace livemap::web
