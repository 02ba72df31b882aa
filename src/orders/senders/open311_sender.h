#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "orders/senders/network_client.h"
#include "orders/senders/order_sender.h"

namespace livemap::orders {

/// Sends orders as service requests by Open311 GeoReport v2
/// (https://wiki.open311.org/GeoReport_v2/), and asks for their status.
///
/// The protocol has no key by which a server knows a repeat. So a request that may have arrived is
/// looked for in the server's list, by the order's reference in its description, before it is
/// posted again. Where the list cannot be had whole, it is not posted.
class Open311Sender : public OrderSender {
 public:
  struct Config {
    std::string url;              ///< Of the endpoint, without a slash at its end.
    std::string jurisdiction_id;  ///< Empty where the server has one jurisdiction.
    std::string api_key;
    std::map<std::string, std::string> services;  ///< service_code by class of hazard.
    std::string default_service;                  ///< Of all other classes; empty: none.
  };
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.

  Open311Sender(Config config, NetworkClient::Config network, Clock now_ns);

  SendResult Send(const Order& order) override;
  bool HasStatus() const override { return true; }
  std::optional<OrderStatus> AskStatus(const Order& order) override;

  /// A list of this many requests may have been cut: the standard lets a server stop there.
  static constexpr std::size_t kMaxListed = 1000;

 private:
  enum class Found { kYes, kNo, kUnknown };

  std::string ServiceOf(const Order& order) const;
  std::string WithJurisdiction(std::string url) const;
  HttpCall PostOf(const Order& order, const std::string& service) const;
  Found FindPosted(const Order& order, const std::string& service, SendResult& result) const;
  SendResult Post(const Order& order, const std::string& service) const;
  std::optional<std::string> ResolveToken(const std::string& token) const;

  const Config config_;
  const NetworkClient client_;
  const Clock now_ns_;
};

}  // namespace livemap::orders
