#include "orders/senders/network_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "common/error.h"
#include "orders/order_text.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kMaxErrorBytes = 200;

/// Once for the process, before there are threads that use it.
void InitialiseCurl() {
  static const CURLcode kDone = curl_global_init(CURL_GLOBAL_DEFAULT);
  if (kDone != CURLE_OK) throw Error("libcurl cannot be used");
}

/// A list of texts that libcurl reads.
class CurlList {
 public:
  explicit CurlList(const std::vector<std::string>& lines) {
    for (const std::string& line : lines) {
      curl_slist* const longer = curl_slist_append(list_, line.c_str());
      if (longer == nullptr) {
        curl_slist_free_all(list_);
        throw Error("there is no memory for a request");
      }
      list_ = longer;
    }
  }
  ~CurlList() { curl_slist_free_all(list_); }
  CurlList(const CurlList&) = delete;
  CurlList& operator=(const CurlList&) = delete;
  curl_slist* get() const { return list_; }

 private:
  curl_slist* list_ = nullptr;
};

struct AnswerBuffer {
  std::string bytes;
  std::size_t max_bytes = 0;
};

std::size_t TakeAnswer(const char* data, std::size_t, std::size_t size, void* user) {
  auto& buffer = *static_cast<AnswerBuffer*>(user);
  if (size > buffer.max_bytes - buffer.bytes.size()) return 0;  // Ends the exchange.
  buffer.bytes.append(data, size);
  return size;
}

struct MessageReader {
  const std::string& message;
  std::size_t at = 0;
};

std::size_t GiveMessage(char* data, std::size_t size, std::size_t count, void* user) {
  auto& reader = *static_cast<MessageReader*>(user);
  const std::size_t bytes = std::min(size * count, reader.message.size() - reader.at);
  std::copy_n(reader.message.data() + reader.at, bytes, data);
  reader.at += bytes;
  return bytes;
}

int IsStopped(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return static_cast<const std::atomic<bool>*>(user)->load() ? 1 : 0;
}

/// The recipient cannot have got anything.
bool IsBeforeSending(CURLcode code) {
  switch (code) {
    case CURLE_UNSUPPORTED_PROTOCOL:
    case CURLE_URL_MALFORMAT:
    case CURLE_COULDNT_RESOLVE_PROXY:
    case CURLE_COULDNT_RESOLVE_HOST:
    case CURLE_COULDNT_CONNECT:
    case CURLE_SSL_CONNECT_ERROR:
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
    case CURLE_USE_SSL_FAILED:
    case CURLE_LOGIN_DENIED:
      return true;
    default:
      return false;
  }
}

/// One exchange, with what all exchanges have in common.
class Exchange {
 public:
  Exchange(const NetworkClient::Config& config, const std::string& url, const char* protocols)
      : handle_(curl_easy_init(), &curl_easy_cleanup) {
    if (!handle_) throw Error("there is no memory for a connection");
    Set(CURLOPT_URL, url.c_str());
    Set(CURLOPT_PROTOCOLS_STR, protocols);
    Set(CURLOPT_ERRORBUFFER, words_.data());
    Set(CURLOPT_NOSIGNAL, 1L);
    Set(CURLOPT_FOLLOWLOCATION, 0L);
    Set(CURLOPT_NOPROXY, "localhost,127.0.0.1,::1");
    const auto timeout_ms = static_cast<long>(1000 * config.timeout_s);
    Set(CURLOPT_TIMEOUT_MS, timeout_ms);
    Set(CURLOPT_CONNECTTIMEOUT_MS, std::max(timeout_ms / 3, 1L));
    if (!config.ca_file.empty()) {
      Set(CURLOPT_CAINFO, config.ca_file.c_str());
      Set(CURLOPT_CAPATH, static_cast<const char*>(nullptr));
    }
    if (config.stop == nullptr) return;
    Set(CURLOPT_NOPROGRESS, 0L);
    Set(CURLOPT_XFERINFOFUNCTION, &IsStopped);
    Set(CURLOPT_XFERINFODATA, config.stop);
  }

  template <typename Value>
  void Set(CURLoption option, Value value) {
    if (curl_easy_setopt(handle_.get(), option, value) == CURLE_OK) return;
    throw Error("libcurl refuses an option of a request");
  }

  CURLcode Run() { return curl_easy_perform(handle_.get()); }

  /// 0: there was no answer.
  int Status() const {
    long status = 0;
    curl_easy_getinfo(handle_.get(), CURLINFO_RESPONSE_CODE, &status);
    return static_cast<int>(status);
  }

  double RetryAfterS() const {
    curl_off_t seconds = 0;
    curl_easy_getinfo(handle_.get(), CURLINFO_RETRY_AFTER, &seconds);
    return static_cast<double>(std::max<curl_off_t>(seconds, 0));
  }

  std::string Words(CURLcode code) const {
    const bool has_words = words_[0] != '\0';
    return OneLine(has_words ? words_.data() : curl_easy_strerror(code), kMaxErrorBytes);
  }

 private:
  std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle_;
  std::array<char, CURL_ERROR_SIZE> words_{};
};

}  // namespace

NetworkClient::NetworkClient(Config config) : config_(std::move(config)) { InitialiseCurl(); }

HttpAnswer NetworkClient::Call(const HttpCall& call) const {
  Exchange exchange(config_, call.url, "http,https");
  // No "Expect: 100-continue": recipients that do not know it are waited for.
  std::vector<std::string> lines = call.headers;
  lines.emplace_back("Expect:");
  lines.emplace_back("User-Agent: LiveMap");
  const CurlList headers(lines);
  AnswerBuffer buffer{{}, call.max_answer_bytes};
  exchange.Set(CURLOPT_HTTPHEADER, headers.get());
  exchange.Set(CURLOPT_WRITEFUNCTION, &TakeAnswer);
  exchange.Set(CURLOPT_WRITEDATA, &buffer);
  if (call.is_post) {
    exchange.Set(CURLOPT_POST, 1L);
    exchange.Set(CURLOPT_POSTFIELDS, call.body.c_str());
    exchange.Set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(call.body.size()));
  }
  const CURLcode code = exchange.Run();
  HttpAnswer answer;
  answer.retry_after_s = exchange.RetryAfterS();
  answer.was_sent = !IsBeforeSending(code);
  // What is too long is cut off, but that there is an answer is known.
  const bool is_too_long = code == CURLE_WRITE_ERROR;
  if (code == CURLE_OK || is_too_long) answer.status = exchange.Status();
  if (code == CURLE_OK) answer.body = std::move(buffer.bytes);
  if (code != CURLE_OK) {
    answer.error =
        is_too_long ? "the answer has more than " + std::to_string(call.max_answer_bytes) + " bytes"
                    : exchange.Words(code);
  }
  return answer;
}

SendResult NetworkClient::Send(const Mail& mail) const {
  Exchange exchange(config_, mail.server, "smtp,smtps");
  const CurlList recipients(mail.to);
  MessageReader reader{mail.message};
  AnswerBuffer nothing{{}, 64 << 10};
  exchange.Set(CURLOPT_WRITEFUNCTION, &TakeAnswer);
  exchange.Set(CURLOPT_WRITEDATA, &nothing);
  exchange.Set(CURLOPT_USE_SSL,
               static_cast<long>(mail.needs_tls ? CURLUSESSL_ALL : CURLUSESSL_NONE));
  if (!mail.user.empty()) {
    exchange.Set(CURLOPT_USERNAME, mail.user.c_str());
    exchange.Set(CURLOPT_PASSWORD, mail.password.c_str());
  }
  exchange.Set(CURLOPT_MAIL_FROM, mail.from.c_str());
  exchange.Set(CURLOPT_MAIL_RCPT, recipients.get());
  exchange.Set(CURLOPT_UPLOAD, 1L);
  exchange.Set(CURLOPT_READFUNCTION, &GiveMessage);
  exchange.Set(CURLOPT_READDATA, &reader);
  exchange.Set(CURLOPT_INFILESIZE_LARGE, static_cast<curl_off_t>(mail.message.size()));
  const CURLcode code = exchange.Run();
  SendResult result;
  if (code == CURLE_OK) {
    result.outcome = SendResult::Outcome::kSent;
    return result;
  }
  // The server said no, or had not got the whole message.
  const bool is_refused =
      IsBeforeSending(code) || exchange.Status() >= 400 || reader.at < mail.message.size();
  result.outcome = is_refused ? SendResult::Outcome::kRefused : SendResult::Outcome::kUnknown;
  result.error = exchange.Words(code);
  return result;
}

std::string NetworkClient::Escaped(const std::string& text) {
  std::string escaped;
  constexpr char kHex[] = "0123456789ABCDEF";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                          (c >= 'a' && c <= 'z') || std::strchr("-._~", c) != nullptr;
    if (is_plain && c != '\0') {
      escaped += c;
    } else {
      escaped += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return escaped;
}

bool IsThisMachine(const std::string& host) {
  return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

}  // namespace livemap::orders
