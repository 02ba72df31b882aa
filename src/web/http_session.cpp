#include "web/http_session.h"

#include <boost/asio/dispatch.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <utility>

#include "web/origin.h"
#include "web/websocket_session.h"

namespace livemap {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;

constexpr std::uint32_t kMaxHeaderBytes = 8192;

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

std::string Field(const http::request<http::empty_body>& request, http::field name) {
  const auto value = request[name];
  return std::string(value.data(), value.size());
}

/// HTTP's reason phrases come from Beast; this maps a failed parse to an answer.
int StatusOfParseError(const beast::error_code& failure) {
  return failure == http::error::header_limit ? 431 : 400;
}

bool IsParseError(const beast::error_code& failure) {
  return failure.category() == http::make_error_code(http::error::bad_value).category() &&
         failure != http::error::end_of_stream && failure != http::error::partial_message;
}

}  // namespace

HttpSession::HttpSession(boost::asio::ip::tcp::socket socket, WebContext& context)
    : stream_(std::move(socket)), slot_(context) {}

void HttpSession::Start() {
  boost::asio::dispatch(stream_.get_executor(),
                        [self = shared_from_this()] { self->ReadRequest(); });
}

void HttpSession::ReadRequest() {
  parser_.emplace();
  parser_->header_limit(kMaxHeaderBytes);
  stream_.expires_after(Milliseconds(slot_.context().options.request_timeout_s));
  http::async_read_header(stream_, buffer_, *parser_,
                          [self = shared_from_this()](beast::error_code failure, std::size_t) {
                            self->OnRequest(failure);
                          });
}

void HttpSession::OnRequest(beast::error_code failure) {
  const Api& api = slot_.context().api;
  if (failure) {
    if (!IsParseError(failure)) return Close();
    const int status = StatusOfParseError(failure);
    return Write(api.ErrorAnswer(status, "the request's header is malformed or too large"), false,
                 false);
  }
  const Request& request = parser_->get();
  // No request of this server has a body; one that announces it is not read any further.
  const bool has_body = !parser_->is_done();
  if (!has_body && UpgradeToStream(request)) return;

  HttpQuestion question;
  question.method = std::string(request.method_string());
  question.target = std::string(request.target());
  question.if_none_match = Field(request, http::field::if_none_match);
  const bool head_only = question.method == "HEAD";
  const bool is_read = head_only || question.method == "GET";
  HttpAnswer answer = has_body && is_read
                          ? api.ErrorAnswer(413, "a request with a body is not accepted")
                          : api.Answer(question);
  Write(std::move(answer), request.keep_alive() && !has_body, head_only);
}

bool HttpSession::UpgradeToStream(const Request& request) {
  if (!beast::websocket::is_upgrade(request)) return false;
  WebContext& context = slot_.context();
  HttpAnswer refusal;
  try {
    const RequestTarget target = ParseTarget(std::string(request.target()));
    if (target.path != "/ws") return false;
    const auto since = ParseStreamQuery(target);
    if (IsAllowedOrigin(Field(request, http::field::origin), Field(request, http::field::host),
                        context.options.allowed_origins)) {
      stream_.expires_never();
      std::make_shared<WebSocketSession>(std::move(stream_), std::move(slot_), since)
          ->Start(request);
      return true;
    }
    refusal = context.api.ErrorAnswer(403, "pages of another origin may not open the live stream");
  } catch (const BadRequest& mistake) {
    refusal = context.api.ErrorAnswer(400, mistake.what());
  }
  Write(std::move(refusal), false, false);
  return true;
}

void HttpSession::Write(HttpAnswer answer, bool keep_alive, bool head_only) {
  response_ = Response(static_cast<http::status>(answer.status), 11);
  for (const auto& [name, value] : answer.headers) response_.set(name, value);
  if (!answer.content_type.empty()) response_.set(http::field::content_type, answer.content_type);
  response_.keep_alive(keep_alive);
  if (answer.status == 304) {
    response_.erase(http::field::content_type);
  } else {
    response_.content_length(answer.content.size());
  }
  if (!head_only) response_.body() = std::move(answer.content);
  stream_.expires_after(Milliseconds(slot_.context().options.answer_timeout_s));
  http::async_write(stream_, response_,
                    [self = shared_from_this()](beast::error_code failure, std::size_t) {
                      if (failure || self->response_.need_eof()) return self->Close();
                      self->ReadRequest();
                    });
}

void HttpSession::Close() {
  beast::error_code ignored;
  stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
}

}  // namespace livemap
