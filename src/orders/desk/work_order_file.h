#pragma once

#include <string>
#include <variant>
#include <vector>

#include "orders/desk/order_rule.h"
#include "orders/senders/mail_sender.h"
#include "orders/senders/open311_sender.h"
#include "orders/senders/webhook_sender.h"

namespace livemap::orders {

/// Where orders go.
struct Recipient {
  std::string name;
  std::variant<MailSender::Config, WebhookSender::Config, Open311Sender::Config> way;
  std::string ca_file;    ///< Certificates that are trusted; empty: the system's.
  double timeout_s = 30;  ///< For one exchange.
  double poll_s = 900;    ///< Between two questions for an order's status, where there is one.
};

/// What the file of work orders says (docs/reference/work-orders.md).
struct WorkOrderConfig {
  std::vector<Recipient> recipients;
  std::vector<OrderRule> rules;
  double retry_s = 30;  ///< After the first attempt that failed; it doubles each time.
  double longest_retry_s = 3600;
  double give_up_s = 7 * 86400;  ///< From the order's making to the last attempt.
};

/// Reads the file, and the secrets in the files that it names. Throws Error with one sentence that
/// names file, line, key, value and what is accepted; it never holds a secret.
WorkOrderConfig ReadWorkOrderFile(const std::string& path);
/// The same of its text; `name` is the file's. Paths in it are relative to `folder`.
WorkOrderConfig ParseWorkOrders(const std::string& text, const std::string& name,
                                const std::string& folder);

}  // namespace livemap::orders
