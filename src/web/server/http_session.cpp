#include "web/server/http_session.h"

#include <algorithm>
#include <boost/asio/dispatch.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <utility>

#include "web/http/origin.h"
#include "web/server/websocket_session.h"

namespace livemap::web {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;

constexpr std::uint32_t kMaxHeaderBytes = 8192;

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

std::string Field(const http::request<http::string_body>& request, http::field name) {
  const auto value = request[name];
  return std::string(value.data(), value.size());
}

/// HTTP's reason phrases come from Beast; this maps a failed parse to an answer.
int StatusOfParseError(const beast::error_code& failure) {
  if (failure == http::error::body_limit) return 413;
  return failure == http::error::header_limit ? 431 : 400;
}

bool IsParseError(const beast::error_code& failure) {
  return failure.category() == http::make_error_code(http::error::bad_value).category() &&
         failure != http::error::end_of_stream && failure != http::error::partial_message;
}

/// An IPv4 address; of an IPv6 one the network, of which a single customer has every address.
std::string ClientOf(const boost::asio::ip::tcp::socket& socket) {
  beast::error_code failure;
  const auto endpoint = socket.remote_endpoint(failure);
  if (failure) return "";
  if (endpoint.address().is_v4()) return endpoint.address().to_string();
  auto bytes = endpoint.address().to_v6().to_bytes();
  if (endpoint.address().to_v6().is_v4_mapped()) return endpoint.address().to_string();
  std::fill(bytes.begin() + 8, bytes.end(), static_cast<unsigned char>(0));
  return boost::asio::ip::make_address_v6(bytes).to_string();
}

}  // namespace

HttpSession::HttpSession(boost::asio::ip::tcp::socket socket, WebContext& context)
    : stream_(std::move(socket)), slot_(context), client_(ClientOf(stream_.socket())) {}

void HttpSession::Start() {
  boost::asio::dispatch(stream_.get_executor(),
                        [self = shared_from_this()] { self->ReadRequest(); });
}

void HttpSession::ReadRequest() {
  parser_.emplace();
  parser_->header_limit(kMaxHeaderBytes);
  parser_->body_limit(kMaxBodyBytes);
  stream_.expires_after(Milliseconds(slot_.context().options.request_timeout_s));
  http::async_read_header(stream_, buffer_, *parser_,
                          [self = shared_from_this()](beast::error_code failure, std::size_t) {
                            self->OnHeader(failure);
                          });
}

void HttpSession::AnswerUnreadable(beast::error_code failure) {
  if (!IsParseError(failure)) return Close();
  const int status = StatusOfParseError(failure);
  const char* sentence = status == 413 ? "the request's body is too large or not accepted"
                                       : "the request's header is malformed or too large";
  Write(slot_.context().api.ErrorAnswer(status, sentence), false, false);
}

void HttpSession::OnHeader(beast::error_code failure) {
  if (failure) return AnswerUnreadable(failure);
  if (parser_->is_done()) {
    if (!UpgradeToStream(parser_->get())) AnswerRequest();
    return;
  }
  if (parser_->get().method() == http::verb::post) return ReadBody();
  // A body that is not read would be taken for the next request: the connection ends.
  const bool head_only = parser_->get().method() == http::verb::head;
  Write(slot_.context().api.ErrorAnswer(413, "a request with a body is not accepted"), false,
        head_only);
}

/// Within the time that the header had, too.
void HttpSession::ReadBody() {
  http::async_read(stream_, buffer_, *parser_,
                   [self = shared_from_this()](beast::error_code failure, std::size_t) {
                     if (failure) return self->AnswerUnreadable(failure);
                     self->AnswerRequest();
                   });
}

void HttpSession::AnswerRequest() {
  const Request& request = parser_->get();
  HttpRequest question;
  question.method = std::string(request.method_string());
  question.target = std::string(request.target());
  question.if_none_match = Field(request, http::field::if_none_match);
  question.authorization = Field(request, http::field::authorization);
  question.content_type = Field(request, http::field::content_type);
  question.origin = Field(request, http::field::origin);
  question.host = Field(request, http::field::host);
  question.client = client_;
  question.body = request.body();
  HttpResponse answer = slot_.context().api.Answer(question);
  Write(std::move(answer), request.keep_alive(), question.method == "HEAD");
}

bool HttpSession::UpgradeToStream(const Request& request) {
  if (!beast::websocket::is_upgrade(request)) return false;
  WebContext& context = slot_.context();
  HttpResponse refusal;
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

void HttpSession::Write(HttpResponse answer, bool keep_alive, bool head_only) {
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

}  // namespace livemap::web
