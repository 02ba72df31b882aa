#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "orders/senders/network_client.h"
#include "orders/senders/order_sender.h"

namespace livemap::orders {

/// HMAC-SHA256 (RFC 2104) as 64 lower-case hexadecimal digits.
std::string HmacSha256Hex(const std::string& secret, const std::string& text);

/// Sends orders by HTTP POST of JSON to an address of the recipient. Each request has the order's
/// uuid as Idempotency-Key, the same however often it is sent, and a signature over its time and
/// its body: "X-LiveMap-Signature: t=SECONDS,v1=HEX", where HEX is HmacSha256Hex of
/// "SECONDS.BODY".
class WebhookSender : public OrderSender {
 public:
  struct Config {
    std::string url;
    std::string secret;
  };
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.

  WebhookSender(Config config, NetworkClient::Config network, Clock now_ns);

  SendResult Send(const Order& order) override;

 private:
  const Config config_;
  const NetworkClient client_;
  const Clock now_ns_;
};

}  // namespace livemap::orders
