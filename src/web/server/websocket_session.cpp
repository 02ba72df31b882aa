#include "web/server/websocket_session.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <map>
#include <utility>

#include "web/json/json.h"
#include "web/json/map_change_json.h"

namespace livemap::web {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;

constexpr std::size_t kReplayPage = 256;
/// Clients have nothing to say: enough for a courtesy, too little to cost anything.
constexpr std::size_t kMaxClientMessageBytes = 1024;
constexpr std::chrono::seconds kCloseGrace{2};

std::shared_ptr<const std::string> Shared(const Json& json) {
  return std::make_shared<const std::string>(ToText(json));
}

}  // namespace

WebSocketSession::WebSocketSession(beast::tcp_stream stream, ConnectionSlot slot,
                                   std::optional<std::uint64_t> since)
    : slot_(std::move(slot)),
      stream_(std::move(stream)),
      close_deadline_(stream_.get_executor()),
      heartbeat_(stream_.get_executor()),
      since_(since) {}

void WebSocketSession::Start(const Request& upgrade) {
  websocket::stream_base::timeout timeout{};
  const auto ping_timeout_ms =
      static_cast<std::int64_t>(slot_.context().options.ping_timeout_s * 1000);
  timeout.handshake_timeout = std::chrono::seconds(10);
  timeout.idle_timeout = std::chrono::milliseconds(ping_timeout_ms);
  timeout.keep_alive_pings = true;
  stream_.set_option(timeout);
  stream_.read_message_max(kMaxClientMessageBytes);
  stream_.text(true);
  stream_.async_accept(upgrade, [self = shared_from_this()](beast::error_code failure) {
    if (!failure) self->OnAccepted();
  });
}

void WebSocketSession::OnAccepted() {
  WebContext& context = slot_.context();
  // Joined before the store is asked: what the store does not tell any more, the hub will.
  context.hub.Join(shared_from_this());
  Read();
  try {
    const std::uint64_t newest = context.zone.Sequence();
    // A client ahead of the store knew another one (restored from a backup, say): told by the
    // sequence of this message, it forgets what it knew and loads the list.
    told_sequence_ = std::min(since_.value_or(newest), newest);
    Enqueue(Shared({{"type", "hello"}, {"sequence", newest}}));
    for (const zone::VehicleState& vehicle : context.zone.Vehicles()) {
      Enqueue(Shared(VehicleMessage(vehicle)));
    }
  } catch (const std::exception&) {
    return CloseAsFailed();
  }
  BeatLater();
  WriteNext();
}

/// Lets a page notice a connection that died without a word: browsers hide pings from it.
void WebSocketSession::BeatLater() {
  const auto period_ms = static_cast<std::int64_t>(slot_.context().options.heartbeat_s * 1000);
  heartbeat_.expires_after(std::chrono::milliseconds(period_ms));
  heartbeat_.async_wait([self = shared_from_this()](beast::error_code failure) {
    if (failure || self->state_ == State::kClosing) return;
    if (self->queue_.empty()) {
      self->Enqueue(Shared({{"type", "beat"}, {"sequence", self->told_sequence_}}));
      self->WriteNext();
    }
    self->BeatLater();
  });
}

void WebSocketSession::Read() {
  stream_.async_read(read_buffer_,
                     [self = shared_from_this()](beast::error_code failure, std::size_t) {
                       if (failure) {
                         // The other end is gone or was closed: nothing more is queued for it.
                         self->state_ = State::kClosing;
                         self->slot_.context().hub.Leave(self.get());
                         self->close_deadline_.cancel();
                         self->heartbeat_.cancel();
                         return;
                       }
                       self->read_buffer_.clear();
                       self->Read();
                     });
}

void WebSocketSession::Deliver(const LiveMessage& message) {
  boost::asio::post(stream_.get_executor(),
                    [self = shared_from_this(), message] { self->OnMessage(message); });
}

void WebSocketSession::OnMessage(const LiveMessage& message) {
  if (state_ == State::kClosing) return;
  const WebConfig& options = slot_.context().options;
  const bool is_vehicle = message.sequence == 0;
  if (is_vehicle) {
    // A position is soon followed by the next: it never fills a queue that hazards need.
    if (state_ != State::kLive || queue_.size() > options.max_queued_messages / 2) return;
  } else if (state_ == State::kReplaying) {
    announced_sequence_ = std::max(announced_sequence_, message.sequence);
    return;
  } else if (message.sequence <= told_sequence_) {
    return;  // The replay already told it.
  } else {
    told_sequence_ = message.sequence;
  }
  Enqueue(message.text);
  if (queue_.size() > options.max_queued_messages || queued_bytes_ > options.max_queued_bytes) {
    return CloseAsTooSlow();
  }
  WriteNext();
}

/// Called when the queue has run dry during the replay.
void WebSocketSession::ReplayPage() {
  WebContext& context = slot_.context();
  try {
    // Read before the lists, and the end of both: what happens between the two comes later.
    const std::uint64_t newest = context.zone.Sequence();
    const auto hazards = context.zone.Query(std::nullopt, told_sequence_, kReplayPage);
    const auto changes = context.zone.QueryMapChanges(std::nullopt, told_sequence_, kReplayPage);
    std::uint64_t end = newest;
    if (hazards.size() == kReplayPage) end = std::min(end, hazards.back().sequence);
    if (changes.size() == kReplayPage) end = std::min(end, changes.back().sequence);
    std::map<std::uint64_t, std::shared_ptr<const std::string>> messages;
    for (const zone::Hazard& hazard : hazards) {
      if (hazard.sequence > end) break;
      messages[hazard.sequence] =
          Shared(HazardMessage(ReplayAction(hazard), hazard, context.catalogue));
    }
    for (const zone::MapChangeFeature& change : changes) {
      if (change.sequence > end) break;
      messages[change.sequence] = Shared(MapChangeMessage(ReplayAction(change), change));
    }
    for (auto& entry : messages) Enqueue(std::move(entry.second));
    told_sequence_ = std::max(told_sequence_, end);
    if (end == newest && announced_sequence_ <= told_sequence_) {
      state_ = State::kLive;
      Enqueue(Shared({{"type", "live"}, {"sequence", told_sequence_}}));
    }
  } catch (const std::exception&) {
    return CloseAsFailed();
  }
}

void WebSocketSession::Enqueue(std::shared_ptr<const std::string> text) {
  queued_bytes_ += text->size();
  queue_.push_back(std::move(text));
}

void WebSocketSession::WriteNext() {
  if (writing_ || state_ == State::kClosing) return;
  while (queue_.empty() && state_ == State::kReplaying) ReplayPage();
  if (queue_.empty() || state_ == State::kClosing) return;
  writing_ = true;
  stream_.async_write(boost::asio::buffer(*queue_.front()),
                      [self = shared_from_this()](beast::error_code failure, std::size_t) {
                        self->OnWritten(failure);
                      });
}

void WebSocketSession::OnWritten(beast::error_code failure) {
  writing_ = false;
  queued_bytes_ -= queue_.front()->size();
  queue_.pop_front();
  if (failure) {
    state_ = State::kClosing;
    return;
  }
  WriteNext();
}

void WebSocketSession::CloseAsTooSlow() {
  CloseWith(websocket::close_code::try_again_later,
            "too far behind: reconnect with since=SEQUENCE of the last message");
}

void WebSocketSession::CloseAsFailed() {
  CloseWith(websocket::close_code::internal_error, "the zone's store does not answer");
}

void WebSocketSession::CloseWith(websocket::close_code code, const char* reason) {
  if (state_ == State::kClosing) return;
  state_ = State::kClosing;
  slot_.context().hub.Leave(this);
  heartbeat_.cancel();
  // Only the message that is being written may finish.
  queue_.resize(writing_ ? 1 : 0);
  queued_bytes_ = writing_ ? queue_.front()->size() : 0;
  stream_.async_close({code, reason}, [self = shared_from_this()](beast::error_code) {
    self->close_deadline_.cancel();
  });
  // A client that reads nothing never answers the close either.
  close_deadline_.expires_after(kCloseGrace);
  close_deadline_.async_wait([self = shared_from_this()](beast::error_code failure) {
    if (!failure) beast::get_lowest_layer(self->stream_).close();
  });
}

}  // namespace livemap::web
