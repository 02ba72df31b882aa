#pragma once

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace livemap::web {

using Headers = std::vector<std::pair<std::string, std::string>>;

struct HttpResult {
  int status = 0;
  std::string body;
  boost::beast::http::fields fields;

  std::string Field(const std::string& name) const { return std::string(fields[name]); }
  nlohmann::json Json() const { return nlohmann::json::parse(body); }
};

/// One request over a connection of its own; throws after 30 s, which only a hang takes.
inline HttpResult Request(int port, const std::string& method, const std::string& target,
                          const Headers& headers = {}, const std::string& body = "") {
  namespace beast = boost::beast;
  namespace http = beast::http;
  boost::asio::io_context io;
  beast::tcp_stream stream(io);
  stream.expires_after(std::chrono::seconds(30));
  const auto loopback = boost::asio::ip::make_address("127.0.0.1");
  stream.connect({loopback, static_cast<unsigned short>(port)});
  http::request<http::string_body> request;
  request.version(11);
  request.method_string(method);
  request.target(target);
  request.set(http::field::host, "127.0.0.1:" + std::to_string(port));
  for (const auto& [name, value] : headers) request.set(name, value);
  if (!body.empty()) {
    request.body() = body;
    request.prepare_payload();
  }
  http::write(stream, request);
  beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.skip(method == "HEAD");
  parser.body_limit(256U << 20);
  http::read(stream, buffer, parser);
  const auto& response = parser.get();
  return {static_cast<int>(response.result_int()), response.body(), response.base()};
}

inline HttpResult Get(int port, const std::string& target, const Headers& headers = {}) {
  return Request(port, "GET", target, headers);
}

/// A client of the live stream.
class StreamClient {
 public:
  using Stream = boost::beast::websocket::stream<boost::asio::ip::tcp::socket>;

  explicit StreamClient(int port, const std::string& target = "/ws", const std::string& origin = "",
                        int receive_buffer_bytes = 0, const std::string& cookie = "")
      : stream_(io_) {
    namespace websocket = boost::beast::websocket;
    auto& socket = stream_.next_layer();
    socket.open(boost::asio::ip::tcp::v4());
    if (receive_buffer_bytes > 0) {
      socket.set_option(boost::asio::socket_base::receive_buffer_size(receive_buffer_bytes));
    }
    const auto loopback = boost::asio::ip::make_address("127.0.0.1");
    socket.connect({loopback, static_cast<unsigned short>(port)});
    stream_.set_option(
        websocket::stream_base::decorator([origin, cookie](websocket::request_type& request) {
          if (!origin.empty()) request.set(boost::beast::http::field::origin, origin);
          if (!cookie.empty()) request.set(boost::beast::http::field::cookie, cookie);
        }));
    stream_.handshake("127.0.0.1:" + std::to_string(port), target);
  }

  /// The next message; throws boost::system::system_error when the server closed.
  nlohmann::json Next() {
    boost::beast::flat_buffer buffer;
    stream_.read(buffer);
    return nlohmann::json::parse(boost::beast::buffers_to_string(buffer.data()));
  }

  /// The next message of the type, skipping others.
  nlohmann::json NextOfType(const std::string& type) {
    for (;;) {
      auto message = Next();
      if (message["type"] == type) return message;
    }
  }

  Stream& stream() { return stream_; }

 private:
  boost::asio::io_context io_;
  Stream stream_;
};

}  // namespace livemap::web
