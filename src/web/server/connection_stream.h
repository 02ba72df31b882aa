#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <utility>
#include <variant>

namespace livemap::web {

/// A connection by TCP, plain or with TLS on top, behind one interface: an asynchronous stream as
/// Boost.Asio and Boost.Beast define it (AsyncReadStream, AsyncWriteStream), so that a session is
/// written once for both. Time-outs are those of the TCP stream below and hold for all that is
/// above it. Handlers are functions; no other completion token is taken. Not thread-safe.
class ConnectionStream {
 public:
  using next_layer_type = boost::beast::tcp_stream;
  using executor_type = next_layer_type::executor_type;

  explicit ConnectionStream(boost::asio::ip::tcp::socket socket)
      : layers_(std::in_place_type<next_layer_type>, std::move(socket)) {}

  /// Speaks TLS from now on, as a server.
  void StartTls(boost::asio::ssl::context& context) {
    next_layer_type tcp = std::move(next_layer());
    layers_.emplace<TlsStream>(std::move(tcp), context);
  }
  bool is_tls() const { return std::holds_alternative<TlsStream>(layers_); }

  executor_type get_executor() { return next_layer().get_executor(); }
  /// The TCP stream, by which Beast closes the connection, too.
  next_layer_type& next_layer() {
    if (is_tls()) return std::get<TlsStream>(layers_).next_layer();
    return std::get<next_layer_type>(layers_);
  }
  const next_layer_type& next_layer() const {
    if (is_tls()) return std::get<TlsStream>(layers_).next_layer();
    return std::get<next_layer_type>(layers_);
  }

  template <typename Buffers, typename Handler>
  void async_read_some(const Buffers& buffers, Handler&& handler) {
    std::visit([&](auto& layer) { layer.async_read_some(buffers, std::forward<Handler>(handler)); },
               layers_);
  }
  template <typename Buffers, typename Handler>
  void async_write_some(const Buffers& buffers, Handler&& handler) {
    std::visit(
        [&](auto& layer) { layer.async_write_some(buffers, std::forward<Handler>(handler)); },
        layers_);
  }
  /// The handshake of TLS, of which `begun` was read from the TCP stream already; only after
  /// StartTls. `handler` is called with an error code and the size of what of `begun` was used.
  template <typename Buffers, typename Handler>
  void async_handshake(const Buffers& begun, Handler&& handler) {
    std::get<TlsStream>(layers_).async_handshake(boost::asio::ssl::stream_base::server, begun,
                                                 std::forward<Handler>(handler));
  }
  /// Tells the other end that nothing more comes: of TLS with its own word for that, too, after
  /// which the other end's is waited for. `handler` is called with an error code.
  template <typename Handler>
  void async_end(Handler&& handler) {
    if (is_tls()) {
      return std::get<TlsStream>(layers_).async_shutdown(
          [this, handler = std::forward<Handler>(handler)](boost::beast::error_code) mutable {
            handler(EndTcp());
          });
    }
    handler(EndTcp());
  }

  friend void teardown(boost::beast::role_type role, ConnectionStream& stream,
                       boost::beast::error_code& failure) {
    using boost::beast::websocket::teardown;
    if (stream.is_tls()) return teardown(role, std::get<TlsStream>(stream.layers_), failure);
    teardown(role, stream.next_layer().socket(), failure);
  }
  template <typename Handler>
  friend void async_teardown(boost::beast::role_type role, ConnectionStream& stream,
                             Handler&& handler) {
    using boost::beast::websocket::async_teardown;
    if (stream.is_tls()) {
      return async_teardown(role, std::get<TlsStream>(stream.layers_),
                            std::forward<Handler>(handler));
    }
    async_teardown(role, stream.next_layer().socket(), std::forward<Handler>(handler));
  }

 private:
  using TlsStream = boost::beast::ssl_stream<next_layer_type>;

  boost::beast::error_code EndTcp() {
    boost::beast::error_code failure;
    next_layer().socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, failure);
    return failure;
  }

  std::variant<next_layer_type, TlsStream> layers_;
};

}  // namespace livemap::web
