#include "web/server/http_server.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <chrono>
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

}  // namespace

class HttpServer::Implementation {
 public:
  Implementation(const WebConfig& options, Site& site, const LiveSource* live)
      : options_(options),
        proxies_(options_.proxies),
        table_(TableConfig(options_, proxies_)),
        context_{options_, site, live, table_, work_, proxies_},
        work_(options_.threads),
        accept_strand_(net::make_strand(io_)),
        acceptor_(accept_strand_),
        accept_pause_(accept_strand_) {
    Listen();
    Accept();
    for (int i = 0; i < options_.threads; ++i) {
      threads_.emplace_back([this] { io_.run(); });
    }
  }

  ~Implementation() {
    io_.stop();
    for (std::thread& thread : threads_) thread.join();
    work_.Stop();
  }

  int port() const { return port_; }
  std::size_t connections() const { return table_.size(); }
  Counters counters() const { return {table_.ended(), table_.refused(), context_.held_bytes}; }

 private:
  void Listen() {
    error_code failure;
    const auto address = net::ip::make_address(options_.address, failure);
    if (failure) {
      throw Error("address is '" + options_.address + "', accepted is an IPv4 or IPv6 address");
    }
    const tcp::endpoint endpoint(address, static_cast<unsigned short>(options_.port));
    acceptor_.open(endpoint.protocol(), failure);
    if (!failure) acceptor_.set_option(net::socket_base::reuse_address(true), failure);
    if (!failure) acceptor_.bind(endpoint, failure);
    if (!failure) acceptor_.listen(net::socket_base::max_listen_connections, failure);
    if (failure) {
      throw Error("the web server cannot listen on " + options_.address + ", port " +
                  std::to_string(options_.port) + ": " + failure.message());
    }
    port_ = acceptor_.local_endpoint().port();
  }

  void Accept() {
    acceptor_.async_accept(net::make_strand(io_), [this](error_code failure, tcp::socket socket) {
      if (failure == net::error::operation_aborted) return;
      if (failure) return PauseAccepting();
      Serve(std::move(socket));
      Accept();
    });
  }

  /// Out of file descriptors, most likely: trying at once would only spin.
  void PauseAccepting() {
    accept_pause_.expires_after(std::chrono::milliseconds(100));
    accept_pause_.async_wait([this](error_code failure) {
      if (!failure) Accept();
    });
  }

  void Serve(tcp::socket socket) {
    error_code ignored;
    const auto peer = socket.remote_endpoint(ignored).address();
    std::string client = ignored ? "" : proxies_.ClientOf(peer);
    const auto place = table_.Admit(client, SteadyNs());
    if (!place) {
      static constexpr char kBusy[] =
          "HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\n"
          "Connection: close\r\n\r\n";
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
    std::make_shared<HttpSession>(std::move(socket), std::move(slot), std::move(client))->Start();
  }

  // The order matters: sessions, which io_ destroys with its pending work, use all above it.
  const WebConfig options_;
  const TrustedProxies proxies_;
  ConnectionTable table_;
  WebContext context_;
  net::io_context io_;
  WorkQueue work_;
  net::strand<net::io_context::executor_type> accept_strand_;
  tcp::acceptor acceptor_;
  net::steady_timer accept_pause_;
  int port_ = 0;
  std::vector<std::thread> threads_;
};

HttpServer::HttpServer(const WebConfig& options, Site& site, const LiveSource* live)
    : implementation_(std::make_unique<Implementation>(options, site, live)) {}

HttpServer::~HttpServer() = default;

int HttpServer::port() const { return implementation_->port(); }

HttpServer::Counters HttpServer::counters() const { return implementation_->counters(); }

std::size_t HttpServer::connections() const { return implementation_->connections(); }

}  // namespace livemap::web
