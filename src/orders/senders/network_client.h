#pragma once

#include <atomic>
#include <cstddef>
#include <string>
#include <vector>

#include "orders/senders/order_sender.h"

namespace livemap::orders {

/// One request by HTTP.
struct HttpCall {
  std::string url;
  std::vector<std::string> headers;  ///< "Name: value".
  std::string body;
  bool is_post = false;
  std::size_t max_answer_bytes = 64 << 10;
};

/// What came of it.
struct HttpAnswer {
  int status = 0;            ///< 0: there was no whole answer.
  std::string body;          ///< Empty where it had too many bytes.
  std::string error;         ///< Why there was none, or no body; one line.
  bool was_sent = false;     ///< Without an answer: the request may have arrived all the same.
  double retry_after_s = 0;  ///< 0: not said.

  bool IsSuccess() const { return status >= 200 && status < 300; }
};

/// Speaks HTTP and SMTP by libcurl, with TLS whose certificates are checked. No redirect is
/// followed and no proxy used for this machine itself. Not thread-safe; a stop makes it return.
class NetworkClient {
 public:
  struct Config {
    std::string ca_file;    ///< Certificates that are trusted; empty: the system's.
    double timeout_s = 30;  ///< For the whole exchange; connecting takes a third of it at most.
    const std::atomic<bool>* stop = nullptr;  ///< Outlives the client; null: it is never stopped.
  };

  explicit NetworkClient(Config config);

  HttpAnswer Call(const HttpCall& call) const;

  /// A message to be sent by SMTP.
  struct Mail {
    std::string server;  ///< smtp://HOST:PORT or smtps://HOST:PORT.
    bool needs_tls = true;
    std::string user;  ///< Empty: no log-in.
    std::string password;
    std::string from;
    std::vector<std::string> to;
    std::string message;
  };
  /// Whether the server has taken it for all of its recipients.
  SendResult Send(const Mail& mail) const;

  /// The text as a value of a query or a form.
  static std::string Escaped(const std::string& text);

 private:
  Config config_;
};

/// Whether a host's name means this machine itself: only then may what is sent go without TLS.
bool IsThisMachine(const std::string& host);

}  // namespace livemap::orders
