#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <memory>
#include <optional>
#include <string>

#include "web/server/connection.h"

namespace livemap::web {

/// One HTTP/1.1 connection: reads a request, lets Api answer it, and so on until the client or a
/// time-out ends it. Only a POST may have a body, a small one. A request for the live stream turns
/// it into a WebSocketSession.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(boost::asio::ip::tcp::socket socket, WebContext& context);
  void Start();

 private:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;
  using Response = boost::beast::http::response<boost::beast::http::string_body>;

  void ReadRequest();
  void OnHeader(boost::beast::error_code failure);
  void ReadBody();
  void AnswerRequest();
  void AnswerUnreadable(boost::beast::error_code failure);
  /// True when the request was for the live stream and the connection has left this session.
  bool UpgradeToStream(const Request& request);
  void Write(HttpResponse answer, bool keep_alive, bool head_only);
  void Close();

  boost::beast::tcp_stream stream_;
  ConnectionSlot slot_;
  const std::string client_;  ///< Whom wrong tokens are counted against.
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  Response response_;
};

}  // namespace livemap::web
