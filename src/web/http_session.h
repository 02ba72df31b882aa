#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <memory>
#include <optional>

#include "web/connection.h"

namespace livemap {

/// One HTTP/1.1 connection: reads a request's header, lets Api answer it, and so on until the
/// client or a time-out ends it. A request for the live stream turns it into a WebSocketSession.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(boost::asio::ip::tcp::socket socket, WebContext& context);
  void Start();

 private:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;
  using Response = boost::beast::http::response<boost::beast::http::string_body>;

  void ReadRequest();
  void OnRequest(boost::beast::error_code failure);
  /// True when the request was for the live stream and the connection has left this session.
  bool UpgradeToStream(const Request& request);
  void Write(HttpAnswer answer, bool keep_alive, bool head_only);
  void Close();

  boost::beast::tcp_stream stream_;
  ConnectionSlot slot_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::empty_body>> parser_;
  Response response_;
};

}  // namespace livemap
