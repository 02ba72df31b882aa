#include "web/server/http_session.h"

#include <algorithm>
#include <array>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/detect_ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <utility>

#include "common/clock.h"
#include "web/access/access.h"
#include "web/api/query.h"
#include "web/http/origin.h"
#include "web/http/server_address.h"
#include "web/server/websocket_session.h"

namespace livemap::web {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;

constexpr std::size_t kMaxHeaderBytes = 8192;
/// Of what was read ahead: a header, a body, and some of the requests behind it.
constexpr std::size_t kMaxReadAheadBytes = 4 * kMaxHeaderBytes;
/// What a refused client may still send until it has read the answer.
constexpr std::size_t kMaxDrainedBytes = 1 << 20;
constexpr std::chrono::seconds kDrainTime{2};
constexpr const char* kNoPlace = "the server has no place for another connection now";

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

std::string Field(const http::request<http::string_body>& request, http::field name) {
  const auto value = request[name];
  return std::string(value.data(), value.size());
}

/// All that stands in fields of this name, in their order: a client's own comes before the proxy's.
std::string ForwardedFor(const http::request<http::string_body>& request) {
  std::string text;
  const auto [begin, end] = request.equal_range("X-Forwarded-For");
  for (auto field = begin; field != end; ++field) {
    text += text.empty() ? "" : ",";
    text.append(field->value().data(), field->value().size());
  }
  return text;
}

/// HTTP's reason phrases come from Beast; this maps a failed parse to an answer.
int StatusOfParseError(const beast::error_code& failure) {
  if (failure == http::error::body_limit) return 413;
  const bool is_long =
      failure == http::error::header_limit || failure == http::error::buffer_overflow;
  return is_long ? 431 : 400;
}

bool IsParseError(const beast::error_code& failure) {
  return failure.category() == http::make_error_code(http::error::bad_value).category() &&
         failure != http::error::end_of_stream && failure != http::error::partial_message;
}

bool IsLoopback(const boost::asio::ip::tcp::socket& socket) {
  beast::error_code failure;
  const auto endpoint = socket.remote_endpoint(failure);
  return !failure && endpoint.address().is_loopback();
}

}  // namespace

HttpSession::HttpSession(boost::asio::ip::tcp::socket socket, ConnectionSlot slot,
                         std::string client, Speech speech)
    : stream_(std::move(socket)),
      slot_(std::move(slot)),
      speech_(speech),
      peer_(std::move(client)),
      client_(peer_),
      buffer_(kMaxReadAheadBytes),
      deadline_(stream_.get_executor()) {}

HttpSession::~HttpSession() { ReleaseHeld(); }

void HttpSession::Start() {
  const std::weak_ptr<HttpSession> weak = weak_from_this();
  context().table.SetEnd(slot_.id(), [weak, executor = stream_.get_executor()] {
    boost::asio::post(executor, [weak] {
      if (const auto self = weak.lock()) self->Close();
    });
  });
  boost::asio::dispatch(stream_.get_executor(), [self = shared_from_this()] {
    if (self->speech_ == Speech::kTls) return self->DetectTls();
    self->ReadRequest();
  });
}

void HttpSession::DetectTls() {
  tcp().expires_after(Milliseconds(context().options.request_timeout_s));
  beast::async_detect_ssl(tcp(), buffer_,
                          [self = shared_from_this()](beast::error_code failure, bool is_tls) {
                            if (failure) return self->Close();
                            if (is_tls) return self->ShakeHands();
                            self->speech_ = Speech::kRedirect;
                            self->ReadRequest();
                          });
}

/// In as much time as its first bytes had.
void HttpSession::ShakeHands() {
  const auto tls = context().certificate->context();
  stream_.StartTls(*tls);
  tcp().expires_after(Milliseconds(context().options.request_timeout_s));
  stream_.async_handshake(buffer_.data(),
                          [self = shared_from_this()](beast::error_code failure, std::size_t) {
                            // A client has nothing to say behind its greeting before it was
                            // answered.
                            self->buffer_.clear();
                            if (!failure) return self->ReadRequest();
                            ++self->context().failed_handshakes;
                            self->Close();
                          });
}

void HttpSession::SetPhase(ConnectionTable::Phase phase) {
  context().table.SetPhase(slot_.id(), phase, SteadyNs());
}

void HttpSession::SetClient(std::string client) {
  if (client == client_) return;
  client_ = std::move(client);
  context().table.SetClient(slot_.id(), client_, SteadyNs());
}

void HttpSession::ReadRequest() {
  // What a proxy has open between two requests is nobody's share.
  SetClient(peer_);
  SetPhase(ConnectionTable::Phase::kWaiting);
  parser_.emplace();
  parser_->header_limit(static_cast<std::uint32_t>(kMaxHeaderBytes));
  parser_->body_limit(kMaxBodyBytes);
  tcp().expires_after(Milliseconds(context().options.request_timeout_s));
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
  form_ = AnswerForm();
  Refuse(MakeErrorAnswer(status, sentence));
}

void HttpSession::OnHeader(beast::error_code failure) {
  if (failure) return AnswerUnreadable(failure);
  const Request& request = parser_->get();
  form_ = AnswerForm();
  form_.head_only = request.method() == http::verb::head;
  form_.chunked = request.version() >= 11;
  form_.keep_alive = request.version() >= 11 && request.keep_alive();
  if (context().proxies.names().count(peer_) != 0) {
    beast::error_code gone;
    const auto endpoint = tcp().socket().remote_endpoint(gone);
    if (gone) return Close();
    SetClient(context().proxies.ClientOf(endpoint.address(), ForwardedFor(request)));
  }
  if (speech_ == Speech::kRedirect) return Refuse(RedirectToHttps(request));
  form_.gzip = AcceptsGzip(Field(request, http::field::accept_encoding));
  // On the reserve only officials are served, and whoever watches over the zone. Whether a token is
  // an official's is seen with the answer.
  const bool may_be_official =
      !request[http::field::authorization].empty() || !request[http::field::cookie].empty();
  if (!may_be_official && !HasPlace(request.target() == "/healthz")) {
    return Refuse(MakeBusyAnswer(kNoPlace));
  }
  if (parser_->is_done()) {
    if (!UpgradeToStream(request)) AnswerRequest();
    return;
  }
  if (request.method() == http::verb::post) return ReadBody();
  // A body that is not read would be taken for the next request: the connection ends.
  Refuse(MakeErrorAnswer(413, "a request with a body is not accepted"));
}

/// Within the time that the header had, too.
void HttpSession::ReadBody() {
  http::async_read(stream_, buffer_, *parser_,
                   [self = shared_from_this()](beast::error_code failure, std::size_t) {
                     if (failure) return self->AnswerUnreadable(failure);
                     self->AnswerRequest();
                   });
}

HttpRequest HttpSession::Question(const Request& request) const {
  HttpRequest question;
  question.method = std::string(request.method_string());
  question.target = std::string(request.target());
  question.if_none_match = Field(request, http::field::if_none_match);
  question.authorization = Field(request, http::field::authorization);
  question.content_type = Field(request, http::field::content_type);
  question.cookie = Field(request, http::field::cookie);
  question.csrf_token = std::string(request["X-CSRF-Token"]);
  question.on_behalf_of = std::string(request["X-LiveMap-On-Behalf-Of"]);
  question.origin = Field(request, http::field::origin);
  question.host = Field(request, http::field::host);
  question.client = client_;
  question.body = request.body();
  return question;
}

void HttpSession::AnswerRequest() {
  HttpRequest question = Question(parser_->get());
  rank_ =
      context().site.IsByOfficial(question) ? WorkQueue::Rank::kOfficial : WorkQueue::Rank::kReader;
  SetPhase(ConnectionTable::Phase::kWorking);
  if (question.target == "/healthz") {
    // Whoever watches over the zone does not wait for anybody's answer.
    Begin(AnswerTo(question));
    return WritePart();
  }
  if (context().site.AnswersLater(question)) return AwaitAnswer(question);
  WriteAfter([this, question = std::move(question)] { Begin(AnswerTo(question)); });
}

bool HttpSession::HasPlace(bool is_health) {
  const bool is_local = client_ == peer_ && IsLoopback(tcp().socket());
  return (is_health && is_local) || context().table.MayServe(slot_.id());
}

HttpResponse HttpSession::AnswerTo(const HttpRequest& question) {
  HttpResponse answer = context().site.Answer(question);
  if (question.authorization.empty() && question.cookie.empty()) return answer;  // It has a place.
  if (answer.by_official) context().table.MakeOfficial(slot_.id());
  const bool may_be_told = answer.by_official || answer.status >= 400;
  if (may_be_told || HasPlace(question.target == "/healthz")) return answer;
  return MakeBusyAnswer(kNoPlace);
}

void HttpSession::AwaitAnswer(const HttpRequest& question) {
  const auto serve = [self = shared_from_this()](std::uint64_t number, HttpResponse answer) {
    if (number != self->question_) return;
    ++self->question_;
    self->deadline_.cancel();
    if (answer.by_official) self->context().table.MakeOfficial(self->slot_.id());
    const bool may_be_served = self->context().table.MayServe(self->slot_.id());
    self->Begin(may_be_served ? std::move(answer) : MakeBusyAnswer(kNoPlace));
    self->WritePart();
  };
  deadline_.expires_after(Milliseconds(context().options.picture_timeout_s));
  deadline_.async_wait(
      [serve, number = question_, late = context().site.LateAnswer()](beast::error_code failure) {
        if (!failure) serve(number, late);
      });
  context().site.Answer(question, [serve, number = question_,
                                   executor = stream_.get_executor()](HttpResponse answer) {
    boost::asio::post(executor, [serve, number, answer = std::move(answer)]() mutable {
      serve(number, std::move(answer));
    });
  });
}

bool HttpSession::UpgradeToStream(const Request& request) {
  if (!beast::websocket::is_upgrade(request)) return false;
  HttpResponse refusal;
  try {
    const RequestTarget target = ParseTarget(std::string(request.target()));
    const LiveSource* const live = context().live;
    if (live == nullptr || target.path != "/ws") return false;
    const auto since = ParseStreamQuery(target);
    HttpRequest question = Question(request);
    if (!context().site.VisibilityFor(question).told) {
      Refuse(LogInFirst());
      return true;
    }
    const bool may_open =
        IsAllowedOrigin(Field(request, http::field::origin), Field(request, http::field::host),
                        context().options.allowed_origins, stream_.is_tls());
    // A token that nobody has looked at yet holds no place on the reserve.
    const bool has_place = may_open && context().table.MayServe(slot_.id()) &&
                           context().table.BecomeStream(slot_.id(), SteadyNs());
    if (has_place) {
      tcp().expires_never();
      std::make_shared<WebSocketSession>(std::move(stream_), std::move(slot_), *live,
                                         std::move(question), since)
          ->Start(request);
      return true;
    }
    refusal = may_open
                  ? MakeBusyAnswer("there is no place for another live stream of your address now")
                  : MakeErrorAnswer(403, "pages of another origin may not open the live stream");
  } catch (const BadRequest& mistake) {
    refusal = MakeErrorAnswer(400, mistake.what());
  }
  Refuse(std::move(refusal));
  return true;
}

HttpResponse HttpSession::RedirectToHttps(const Request& request) const {
  HttpResponse answer = MakeErrorAnswer(400, "this port speaks HTTPS only");
  const std::string target(request.target());
  const bool is_read = request.method() == http::verb::get || request.method() == http::verb::head;
  if (!is_read || target.empty() || target.front() != '/') return answer;
  const std::string address =
      HttpsAddress(context().options, Field(request, http::field::host), context().https_port);
  if (address.empty()) return answer;
  answer = MakeErrorAnswer(308, "this is served by HTTPS");
  answer.headers.emplace_back("Location", address + target);
  return answer;
}

void HttpSession::Refuse(HttpResponse answer) {
  form_.keep_alive = false;
  Begin(std::move(answer));
  WritePart();
}

void HttpSession::Begin(HttpResponse answer) {
  const auto hsts_s = static_cast<std::int64_t>(context().options.hsts_s);
  if (stream_.is_tls() && hsts_s > 0) {
    answer.headers.emplace_back("Strict-Transport-Security", "max-age=" + std::to_string(hsts_s));
  }
  writer_ = std::make_unique<AnswerWriter>(std::move(answer), form_);
  const std::size_t wanted = writer_->HeldBytes();
  held_bytes_ = wanted;
  if (context().held_bytes.fetch_add(wanted) + wanted > context().options.max_held_bytes) {
    // The few bytes that say so are not counted.
    ReleaseHeld();
    writer_ = std::make_unique<AnswerWriter>(
        MakeBusyAnswer("the server writes as many answers as it may now"), form_);
  }
  MakePart();
}

void HttpSession::MakePart() {
  try {
    if (!writer_->Next(part_)) part_.clear();
  } catch (const std::exception&) {
    // The client must not take half an answer for a whole one.
    part_.clear();
    writer_.reset();
  }
}

void HttpSession::WriteAfter(WorkQueue::Job job) {
  SetPhase(ConnectionTable::Phase::kWorking);
  context().work.Post(client_, rank_, [self = shared_from_this(), job = std::move(job)] {
    job();
    boost::asio::post(self->stream_.get_executor(), [self] { self->WritePart(); });
  });
}

void HttpSession::WritePart() {
  if (!writer_) return Close();
  if (part_.empty() && !writer_->IsDone()) {
    if (!tcp().socket().is_open()) return;  // Ended meanwhile: nobody waits for more.
    return WriteAfter([this] { MakePart(); });
  }
  SetPhase(ConnectionTable::Phase::kWriting);
  tcp().expires_after(Milliseconds(context().options.answer_timeout_s));
  boost::asio::async_write(stream_, boost::asio::buffer(part_),
                           [self = shared_from_this()](beast::error_code failure, std::size_t) {
                             self->OnPartWritten(failure);
                           });
}

void HttpSession::OnPartWritten(beast::error_code failure) {
  if (failure) return Close();
  if (!writer_->IsDone()) return WriteAfter([this] { MakePart(); });
  const bool keeps_alive = writer_->keep_alive();
  writer_.reset();
  part_ = std::string();
  ReleaseHeld();
  if (keeps_alive) {
    ReadRequest();
  } else {
    CloseGently();
  }
}

void HttpSession::ReleaseHeld() {
  if (held_bytes_ == 0) return;  // The place, and with it the context, may be another session's.
  context().held_bytes -= held_bytes_;
  held_bytes_ = 0;
}

/// A socket that is closed while the client still sends is reset, and the client may lose the
/// answer that it was about to read.
void HttpSession::CloseGently() {
  // First: the client may come again as soon as it sees the end, and this place is free for it.
  SetPhase(ConnectionTable::Phase::kLeaving);
  tcp().expires_after(kDrainTime);
  stream_.async_end([self = shared_from_this()](beast::error_code failure) {
    if (failure) return self->Close();
    self->Drain();
  });
}

void HttpSession::Drain() {
  buffer_.clear();
  tcp().async_read_some(buffer_.prepare(kMaxReadAheadBytes),
                        [self = shared_from_this()](beast::error_code failure, std::size_t bytes) {
                          self->drained_bytes_ += bytes;
                          if (failure || self->drained_bytes_ > kMaxDrainedBytes)
                            return self->Close();
                          self->Drain();
                        });
}

void HttpSession::Close() {
  if (!slot_.is_held()) return;  // The connection is a live stream's now.
  SetPhase(ConnectionTable::Phase::kLeaving);
  tcp().close();
}

}  // namespace livemap::web
