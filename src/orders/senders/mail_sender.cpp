#include "orders/senders/mail_sender.h"

#include <utility>

#include "orders/secret_file.h"
#include "orders/senders/mail_message.h"

namespace livemap::orders {

MailSender::MailSender(Config config, NetworkClient::Config network)
    : config_(std::move(config)), client_(std::move(network)) {}

SendResult MailSender::Send(const Order& order) {
  NetworkClient::Mail mail;
  mail.server = config_.server;
  mail.needs_tls = config_.needs_tls;
  mail.user = config_.user;
  mail.password = config_.password;
  mail.from = config_.from;
  mail.to = config_.to;
  mail.message = MailMessage(order, config_.from, config_.to);
  SendResult result = client_.Send(mail);
  result.error = WithoutSecret(std::move(result.error), config_.password);
  return result;
}

}  // namespace livemap::orders
