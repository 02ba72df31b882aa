#pragma once

#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "web/server/connection.h"
#include "web/server/connection_stream.h"

namespace livemap::web {

/// One client of the live stream.
///
/// It first *replays* what happened after the client's `since`, page by page from the store, read
/// on the context's working threads, and then is *live*: events go from the hub into its queue.
/// Events that come during the replay are not queued but remembered by their sequence; the replay
/// goes on until it has passed them. So no event is lost or told twice, and memory stays bounded
/// however long the client was away. A live client whose queue is full is closed with a reason; it
/// reconnects with `since`.
class WebSocketSession : public LiveListener,
                         public std::enable_shared_from_this<WebSocketSession> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  /// Without `since` the client is told only what happens from now on.
  /// `upgrade` is who asked: what it may see is looked up again as long as the stream lives.
  WebSocketSession(ConnectionStream stream, ConnectionSlot slot, const LiveSource& live,
                   HttpRequest upgrade, std::optional<std::uint64_t> since);

  void Start(const Request& upgrade);
  void Deliver(const LiveMessage& message) override;

 private:
  enum class State { kReplaying, kLive, kClosing };

  void OnAccepted();
  /// The table of connections needs it for another client.
  void GiveUpPlace();
  void Read();
  void OnMessage(const LiveMessage& message);
  /// What the store tells of one page.
  struct Replay {
    std::vector<std::shared_ptr<const std::string>> messages;
    std::optional<std::string> last_vehicle;  ///< None when all vehicles were told.
    std::uint64_t told_sequence = 0;
    std::uint64_t newest = 0;
    bool failed = false;
  };
  void StartReplayPage();
  /// On a working thread.
  Replay ReadVehicles(const std::string& after, std::uint64_t told_sequence) const;
  Replay ReadEvents(std::uint64_t told_sequence) const;
  void TakeReplay(Replay replay);
  void Enqueue(std::shared_ptr<const std::string> text);
  void BeatLater();
  void WriteNext();
  void OnWritten(boost::beast::error_code failure);
  void CloseAsTooSlow();
  void CloseAsFailed();
  void CloseWith(boost::beast::websocket::close_code code, const char* reason);

  ConnectionSlot slot_;
  const LiveSource& live_;
  const HttpRequest upgrade_;
  const Visibility sees_;
  boost::beast::websocket::stream<ConnectionStream> stream_;
  boost::asio::steady_timer close_deadline_;
  boost::asio::steady_timer heartbeat_;
  boost::beast::flat_buffer read_buffer_;
  State state_ = State::kReplaying;
  std::optional<std::uint64_t> since_;
  std::uint64_t told_sequence_ = 0;       ///< The client knows everything up to here.
  std::uint64_t announced_sequence_ = 0;  ///< The newest event that came during the replay.
  std::deque<std::shared_ptr<const std::string>> queue_;  ///< The front one is being written.
  std::size_t queued_bytes_ = 0;
  bool is_accepted_ = false;
  bool writing_ = false;
  bool replay_is_read_ = false;                   ///< A working thread reads the next page.
  std::optional<std::string> last_vehicle_ = "";  ///< Told so far; none when all were.
};

}  // namespace livemap::web
