#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "web/http/site.h"
#include "web/http/web_config.h"
#include "web/server/tls_certificate.h"

namespace livemap::web {

struct LiveSource;

/// Serves a site by HTTP/1.1 from threads of its own, to as many clients as its table of
/// connections lets in; where `live` is given, also the live stream. With a certificate in its
/// options it speaks HTTPS.
class HttpServer {
 public:
  struct Counters {
    std::uint64_t connections_ended = 0;    ///< For others that needed their place.
    std::uint64_t connections_refused = 0;  ///< There was no place.
    std::uint64_t held_bytes = 0;           ///< Of the answers that are being written now.
    std::uint64_t failed_handshakes = 0;    ///< Connections that began TLS in vain.
  };

  /// Listens and serves when it returns. Keeps references to `site` and `live`. Throws Error when
  /// the address is none, the port cannot be opened or the certificate is not accepted.
  HttpServer(const WebConfig& options, Site& site, const LiveSource* live);
  /// Closes every connection and joins the threads. Nobody may call a session any more: what made
  /// answers for it has stopped.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// The port it listens on, also where the options asked for any.
  int port() const;
  /// Open connections, HTTP and live streams together.
  std::size_t connections() const;
  Counters counters() const;
  /// None where plain HTTP is spoken.
  std::optional<CertificateState> certificate() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap::web
