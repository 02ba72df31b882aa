#include "orders/senders/webhook_sender.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <array>
#include <utility>

#include "common/error.h"
#include "orders/order_text.h"
#include "orders/secret_file.h"

namespace livemap::orders {

std::string HmacSha256Hex(const std::string& secret, const std::string& text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned int size = 0;
  const auto* const bytes = reinterpret_cast<const unsigned char*>(text.data());
  if (HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()), bytes, text.size(),
           digest.data(), &size) == nullptr) {
    throw Error("libcrypto cannot sign");
  }
  std::string hex;
  constexpr char kDigits[] = "0123456789abcdef";
  for (unsigned int i = 0; i < size; ++i) {
    hex += kDigits[digest.at(i) >> 4U];
    hex += kDigits[digest.at(i) & 15U];
  }
  return hex;
}

namespace {

constexpr std::size_t kMaxHookWordsBytes = 200;

/// "the recipient answered 422: no such street", with the first line of its answer.
std::string HookRefusal(const HttpAnswer& answer) {
  std::string text = "the recipient answered " + std::to_string(answer.status);
  const std::string words =
      OneLine(answer.body.substr(0, answer.body.find_first_of("\r\n")), kMaxHookWordsBytes);
  // A page in HTML is nothing to read in one line.
  const bool says_why = !words.empty() && words.front() != '<';
  return says_why ? text + ": " + words : text;
}

}  // namespace

WebhookSender::WebhookSender(Config config, NetworkClient::Config network, Clock now_ns)
    : config_(std::move(config)), client_(std::move(network)), now_ns_(std::move(now_ns)) {}

SendResult WebhookSender::Send(const Order& order) {
  HttpCall call;
  call.is_post = true;
  call.url = config_.url;
  call.body = JsonOf(order);
  const std::string time = std::to_string(now_ns_() / 1'000'000'000);
  call.headers = {"Content-Type: application/json",
                  "Idempotency-Key: \"" + order.uuid.ToString() + '"',
                  "X-LiveMap-Signature: t=" + time +
                      ",v1=" + HmacSha256Hex(config_.secret, time + "." + call.body)};
  const HttpAnswer answer = client_.Call(call);
  SendResult result;
  result.retry_after_s = answer.retry_after_s;
  if (answer.IsSuccess()) {
    result.outcome = SendResult::Outcome::kSent;
    return result;
  }
  // A server that breaks down may have kept what it was given.
  const bool is_unknown = answer.status == 0 ? answer.was_sent : answer.status >= 500;
  result.outcome = is_unknown ? SendResult::Outcome::kUnknown : SendResult::Outcome::kRefused;
  result.error = answer.status == 0 ? answer.error : HookRefusal(answer);
  result.error = WithoutSecret(std::move(result.error), config_.secret);
  return result;
}

}  // namespace livemap::orders
