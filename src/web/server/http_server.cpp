#include "web/server/http_server.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <chrono>
#include <deque>
#include <memory>
#include <thread>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "web/server/connection.h"
#include "web/server/http_session.h"

namespace livemap::web {

namespace net = boost::asio;
using boost::system::error_code;
using net::ip::tcp;

namespace {

ConnectionTable::Config TableConfig(const WebConfig& options, const TrustedProxies& proxies) {
  ConnectionTable::Config config;
  config.max_connections = options.max_connections;
  config.max_per_client = options.max_connections_per_client;
  config.reserved_connections = std::min(options.reserved_connections, options.max_connections / 4);
  config.proxies = proxies.names();
  return config;
}

std::unique_ptr<TlsCertificate> CertificateOf(const WebConfig& options) {
  if (options.certificate_file.empty()) return nullptr;
  return std::make_unique<TlsCertificate>(options.certificate_file, options.key_file);
}

}  // namespace

class HttpServer::Implementation {
 public:
  Implementation(const WebConfig& options, Site& site, const LiveSource* live)
      : options_(options),
        certificate_(CertificateOf(options_)),
        proxies_(options_.proxies),
        table_(TableConfig(options_, proxies_)),
        context_{options_, site, live, table_, work_, proxies_, certificate_.get()},
        work_(options_.threads),
        accept_strand_(net::make_strand(io_)),
        certificate_check_(accept_strand_) {
    AddPort(options_.port, certificate_ ? HttpSession::Speech::kTls : HttpSession::Speech::kPlain);
    if (certificate_) {
      context_.https_port = port();
      CheckCertificateLater();
    }
    if (options_.redirect_port != 0) {
      AddPort(options_.redirect_port, HttpSession::Speech::kRedirect);
    }
    for (Port& opened : ports_) Accept(opened);
    for (int i = 0; i < options_.threads; ++i) {
      threads_.emplace_back([this] { io_.run(); });
    }
  }

  ~Implementation() {
    io_.stop();
    for (std::thread& thread : threads_) thread.join();
    work_.Stop();
  }

  int port() const { return ports_.front().number; }
  std::optional<CertificateState> certificate() const {
    return certificate_ ? std::optional(certificate_->state()) : std::nullopt;
  }
  std::size_t connections() const { return table_.size(); }
  Counters counters() const {
    return {table_.ended(), table_.refused(), context_.held_bytes, context_.failed_handshakes};
  }

 private:
  /// A port that the server listens on.
  struct Port {
    Port(const net::strand<net::io_context::executor_type>& strand, HttpSession::Speech spoken)
        : speech(spoken), acceptor(strand), pause(strand) {}
    const HttpSession::Speech speech;
    int number = 0;
    tcp::acceptor acceptor;
    net::steady_timer pause;
  };

  void AddPort(int number, HttpSession::Speech speech) {
    error_code failure;
    const auto address = net::ip::make_address(options_.address, failure);
    if (failure) {
      throw Error("address is '" + options_.address + "', accepted is an IPv4 or IPv6 address");
    }
    Port& port = ports_.emplace_back(accept_strand_, speech);
    const tcp::endpoint endpoint(address, static_cast<unsigned short>(number));
    port.acceptor.open(endpoint.protocol(), failure);
    if (!failure) port.acceptor.set_option(net::socket_base::reuse_address(true), failure);
    if (!failure) port.acceptor.bind(endpoint, failure);
    if (!failure) port.acceptor.listen(net::socket_base::max_listen_connections, failure);
    if (failure) {
      throw Error("the web server cannot listen on " + options_.address + ", port " +
                  std::to_string(number) + ": " + failure.message());
    }
    port.number = port.acceptor.local_endpoint().port();
  }

  void Accept(Port& port) {
    port.acceptor.async_accept(net::make_strand(io_),
                               [this, &port](error_code failure, tcp::socket socket) {
                                 if (failure == net::error::operation_aborted) return;
                                 if (failure) return PauseAccepting(port);
                                 Serve(std::move(socket), port.speech);
                                 Accept(port);
                               });
  }

  /// Out of file descriptors, most likely: trying at once would only spin.
  void PauseAccepting(Port& port) {
    port.pause.expires_after(std::chrono::milliseconds(100));
    port.pause.async_wait([this, &port](error_code failure) {
      if (!failure) Accept(port);
    });
  }

  void CheckCertificateLater() {
    const auto period_ms = static_cast<std::int64_t>(options_.certificate_check_s * 1000);
    certificate_check_.expires_after(std::chrono::milliseconds(period_ms));
    certificate_check_.async_wait([this](error_code failure) {
      if (failure) return;
      certificate_->Reload(SystemNs());
      CheckCertificateLater();
    });
  }

  void Serve(tcp::socket socket, HttpSession::Speech speech) {
    error_code ignored;
    const auto peer = socket.remote_endpoint(ignored).address();
    std::string client = ignored ? "" : proxies_.ClientOf(peer);
    const auto place = table_.Admit(client, SteadyNs());
    if (!place) {
      static constexpr char kBusy[] =
          "HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\n"
          "Connection: close\r\n\r\n";
      // Who begins with TLS would not read it.
      if (speech == HttpSession::Speech::kTls) return;
      socket.non_blocking(true, ignored);
      socket.write_some(net::buffer(kBusy, sizeof(kBusy) - 1), ignored);
      return;
    }
    ConnectionSlot slot(context_, *place);
    socket.set_option(tcp::no_delay(true), ignored);
    if (options_.socket_send_buffer_bytes > 0) {
      socket.set_option(
          net::socket_base::send_buffer_size(static_cast<int>(options_.socket_send_buffer_bytes)),
          ignored);
    }
    std::make_shared<HttpSession>(std::move(socket), std::move(slot), std::move(client), speech)
        ->Start();
  }

  // The order matters: sessions, which io_ destroys with its pending work, use all above it.
  const WebConfig options_;
  const std::unique_ptr<TlsCertificate> certificate_;  ///< Null: plain HTTP is spoken.
  const TrustedProxies proxies_;
  ConnectionTable table_;
  WebContext context_;
  net::io_context io_;
  WorkQueue work_;
  net::strand<net::io_context::executor_type> accept_strand_;
  std::deque<Port> ports_;  ///< The first one is the server's own.
  net::steady_timer certificate_check_;
  std::vector<std::thread> threads_;
};

HttpServer::HttpServer(const WebConfig& options, Site& site, const LiveSource* live)
    : implementation_(std::make_unique<Implementation>(options, site, live)) {}

HttpServer::~HttpServer() = default;

int HttpServer::port() const { return implementation_->port(); }

HttpServer::Counters HttpServer::counters() const { return implementation_->counters(); }

std::optional<CertificateState> HttpServer::certificate() const {
  return implementation_->certificate();
}

std::size_t HttpServer::connections() const { return implementation_->connections(); }

}  // namespace livemap::web
