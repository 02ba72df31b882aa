#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/mutex.h"
#include "common/uuid.h"
#include "orders/desk/order_desk.h"
#include "web/access/access.h"
#include "web/api/query.h"
#include "web/http/http_message.h"
#include "web/json/json.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// The address of all work orders; what one of them is told stands below it.
constexpr std::string_view kOrderAddress = "/api/v1/orders";

/// The zone's work orders, for officials only: they name people. What an official does with one is
/// in the zone's audit trail before it is done. Thread-safe; store failures come out as exceptions.
class OrderApi {
 public:
  /// Keeps references. `desk`: null where the zone has no work orders.
  OrderApi(Access& access, zone::ZoneService& zone, orders::OrderDesk* desk)
      : access_(access), zone_(zone), desk_(desk) {}

  /// Whether the path is `/api/v1/orders` or below it.
  static bool IsAddress(std::string_view path);
  /// Answers `GET /api/v1/orders`, `POST /api/v1/orders/UUID/close` and `.../retry`. Throws
  /// BadRequest.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question);

 private:
  HttpResponse List(const RequestTarget& target) const;
  /// One object each, in the same order.
  Json OrdersJson(const std::vector<orders::Order>& orders) const;
  HttpResponse Change(const RequestTarget& target, const std::string& official);
  /// Whether the order is in a state that allows it; then it is done.
  bool Do(const Uuid& uuid, zone::DecisionKind kind, const std::string& official);

  Access& access_;
  zone::ZoneService& zone_;
  Mutex change_mutex_;  ///< One change after the other: of two equal ones, one is done and kept.
  orders::OrderDesk* const desk_;
};

}  // namespace livemap::web
