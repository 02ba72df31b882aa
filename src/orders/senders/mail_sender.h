#pragma once

#include <string>
#include <vector>

#include "orders/senders/network_client.h"
#include "orders/senders/order_sender.h"

namespace livemap::orders {

/// Sends orders by e-mail. SMTP cannot be asked whether a message arrived: one that may have is
/// sent again under the same Message-ID, by which the mailbox can drop it.
class MailSender : public OrderSender {
 public:
  struct Config {
    std::string server;     ///< smtp://HOST:PORT (STARTTLS) or smtps://HOST:PORT (TLS at once).
    bool needs_tls = true;  ///< False for this machine's own server only.
    std::string user;       ///< Empty: no log-in.
    std::string password;
    std::string from;
    std::vector<std::string> to;
  };

  MailSender(Config config, NetworkClient::Config network);

  SendResult Send(const Order& order) override;

 private:
  const Config config_;
  const NetworkClient client_;
};

}  // namespace livemap::orders
