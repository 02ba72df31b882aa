#pragma once

#include <optional>
#include <string>

#include "orders/order.h"

namespace livemap::orders {

/// What came of one attempt to send an order.
struct SendResult {
  enum class Outcome {
    kSent,     ///< The recipient has it.
    kRefused,  ///< It certainly has not: it was not reached, or it said no.
    kUnknown,  ///< The connection broke: it may have it.
  };
  Outcome outcome = Outcome::kRefused;
  std::string error;      ///< One line that holds no secret; empty when sent.
  std::string reference;  ///< The recipient's own id of the order; may be empty.
  std::string token;      ///< What it gave in place of that, for the time being; may be empty.
  double retry_after_s =
      0;  ///< The recipient wants to be left alone for so long; 0: it does not say.
};

/// What a recipient says of an order that it took.
struct OrderStatus {
  bool is_closed = false;  ///< The work is done.
  std::string reference;   ///< Its id of the order, where it is known by now; may be empty.
};

/// Sends orders to one recipient. One thread at a time; every function may take as long as the
/// recipient's timeout.
class OrderSender {
 public:
  OrderSender() = default;
  virtual ~OrderSender() = default;
  OrderSender(const OrderSender&) = delete;
  OrderSender& operator=(const OrderSender&) = delete;

  /// Sends the order. Where an attempt before may have arrived (Order::uncertain_ns), it first
  /// makes sure as far as the recipient's protocol can tell.
  virtual SendResult Send(const Order& order) = 0;
  /// Whether the recipient tells what became of an order.
  virtual bool HasStatus() const { return false; }
  /// None where it cannot be asked now. Only where HasStatus.
  virtual std::optional<OrderStatus> AskStatus(const Order& order);
};

inline std::optional<OrderStatus> OrderSender::AskStatus(const Order&) { return std::nullopt; }

}  // namespace livemap::orders
