#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "web/http/answer_writer.h"
#include "web/server/connection.h"
#include "web/server/connection_stream.h"

namespace livemap::web {

/// One HTTP/1.1 connection: reads a request, lets Site answer it, writes the answer part by part,
/// and so on until the client, a time-out or the table of connections ends it. Only a POST may have
/// a body, a small one. A request for the live stream turns it into a WebSocketSession.
///
/// Requests are answered one after the other, also when a client sends several at once. Answers are
/// made on the context's working threads, a piece at a time: between two pieces other clients have
/// their turn. Nothing is made before what was made is written.
///
/// Where the connection speaks TLS, its handshake must be done in the time of a request. Whoever
/// begins in plain text there is sent to the address by HTTPS.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  /// What the port speaks.
  enum class Speech {
    kPlain,
    kTls,
    kRedirect  ///< Plain text, and nothing but where the same is by HTTPS.
  };

  /// `client`: TrustedProxies::ClientOf the other end of the socket.
  HttpSession(boost::asio::ip::tcp::socket socket, ConnectionSlot slot, std::string client,
              Speech speech);
  ~HttpSession();
  HttpSession(const HttpSession&) = delete;
  HttpSession& operator=(const HttpSession&) = delete;
  void Start();

 private:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  /// Looks whether the client begins with TLS.
  void DetectTls();
  void ShakeHands();
  void ReadRequest();
  void OnHeader(boost::beast::error_code failure);
  void ReadBody();
  /// What the site is asked, with the body as far as it was read.
  HttpRequest Question(const Request& request) const;
  void AnswerRequest();
  /// The answer, or the word that there is no place for who is no official. Any thread.
  HttpResponse AnswerTo(const HttpRequest& question);
  /// Whether it is served without a token: not on the reserve, but for /healthz from the loopback.
  bool HasPlace(bool is_health);
  /// The answer, such as a picture, is made elsewhere; who waits for it too long is told to come
  /// again.
  void AwaitAnswer(const HttpRequest& question);
  /// The request is this client's, or again nobody's but the other end's.
  void SetClient(std::string client);
  void AnswerUnreadable(boost::beast::error_code failure);
  /// True when the request was for the live stream and the connection has left this session.
  bool UpgradeToStream(const Request& request);
  /// Where the request that came in plain text is by HTTPS.
  HttpResponse RedirectToHttps(const Request& request) const;
  /// An answer that needs no work: an error.
  void Refuse(HttpResponse answer);
  /// Makes the writer, or one that says that the server is busy. Any thread.
  void Begin(HttpResponse answer);
  /// Makes the next part. Any thread.
  void MakePart();
  /// Has `job` done on a working thread when it is this client's turn, then writes the part that it
  /// made.
  void WriteAfter(WorkQueue::Job job);
  /// Has the next part made where this one is not made yet.
  void WritePart();
  void OnPartWritten(boost::beast::error_code failure);
  void ReleaseHeld();
  void SetPhase(ConnectionTable::Phase phase);
  void CloseGently();
  void Drain();
  void Close();
  boost::beast::tcp_stream& tcp() { return stream_.next_layer(); }
  const boost::beast::tcp_stream& tcp() const { return stream_.next_layer(); }
  WebContext& context() const { return slot_.context(); }

  ConnectionStream stream_;
  ConnectionSlot slot_;
  Speech speech_;           ///< kRedirect, too, of who begins in plain text where TLS is spoken.
  const std::string peer_;  ///< The other end of the socket: a client, or a proxy.
  std::string client_;      ///< Whose request it is: work and wrong tokens count against it.
  WorkQueue::Rank rank_ = WorkQueue::Rank::kReader;  ///< Of the request that is being answered.
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  AnswerForm form_;
  std::unique_ptr<AnswerWriter> writer_;
  std::string part_;
  std::size_t held_bytes_ = 0;  ///< What this session adds to the context's.
  std::size_t drained_bytes_ = 0;
  boost::asio::steady_timer deadline_;  ///< Of an answer that is waited for.
  std::uint64_t question_ = 0;          ///< Counts these: a late one is known.
};

}  // namespace livemap::web
