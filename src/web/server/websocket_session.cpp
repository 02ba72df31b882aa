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

constexpr std::size_t kReplayPage = 64;
/// Clients have nothing to say: enough for a courtesy, too little to cost anything.
constexpr std::size_t kMaxClientMessageBytes = 1024;
constexpr std::chrono::seconds kCloseGrace{2};

std::shared_ptr<const std::string> Shared(const Json& json) {
  return std::make_shared<const std::string>(ToText(json));
}

}  // namespace

WebSocketSession::WebSocketSession(ConnectionStream stream, ConnectionSlot slot,
                                   const LiveSource& live, HttpRequest upgrade,
                                   std::optional<std::uint64_t> since)
    : slot_(std::move(slot)),
      live_(live),
      upgrade_(std::move(upgrade)),
      sees_(slot_.context().site.VisibilityFor(upgrade_)),
      stream_(std::move(stream)),
      close_deadline_(stream_.get_executor()),
      heartbeat_(stream_.get_executor()),
      since_(since) {
  if (!sees_.vehicles) last_vehicle_.reset();
}

void WebSocketSession::Start(const Request& upgrade) {
  const std::weak_ptr<WebSocketSession> weak = weak_from_this();
  slot_.context().table.SetEnd(slot_.id(), [weak, executor = stream_.get_executor()] {
    boost::asio::post(executor, [weak] {
      if (const auto self = weak.lock()) self->GiveUpPlace();
    });
  });
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

void WebSocketSession::GiveUpPlace() {
  if (is_accepted_) {
    CloseWith(websocket::close_code::try_again_later,
              "another client needs the place: reconnect later");
  } else {
    beast::get_lowest_layer(stream_).close();
  }
}

void WebSocketSession::OnAccepted() {
  is_accepted_ = true;
  // Joined before the store is asked: what the store does not tell any more, the hub will.
  live_.hub.Join(shared_from_this());
  Read();
  try {
    const std::uint64_t newest = live_.zone.Sequence();
    // A client ahead of the store knew another one (restored from a backup, say): told by the
    // sequence of this message, it forgets what it knew and loads the list.
    told_sequence_ = std::min(since_.value_or(newest), newest);
    Enqueue(Shared({{"type", "hello"}, {"sequence", newest}}));
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
    // Who logged out, or was logged out, is told no more.
    if (!(self->slot_.context().site.VisibilityFor(self->upgrade_) == self->sees_)) {
      return self->CloseWith(websocket::close_code::try_again_later,
                             "what you may see has changed: reconnect");
    }
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
                         self->live_.hub.Leave(self.get());
                         self->close_deadline_.cancel();
                         self->heartbeat_.cancel();
                         // Else a write that nobody reads would go on until its time-out.
                         beast::get_lowest_layer(self->stream_).close();
                         return;
                       }
                       self->read_buffer_.clear();
                       self->Read();
                     });
}

void WebSocketSession::Deliver(const LiveMessage& message) {
  // Decided here: a thousand vehicles would wake each of many clients a thousand times a second.
  const bool is_vehicle = message.sequence == 0;
  if (is_vehicle && !sees_.vehicles) return;
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
  if (!is_vehicle && !sees_.candidates && !message.is_told) return;
  Enqueue(message.text);
  if (queue_.size() > options.max_queued_messages || queued_bytes_ > options.max_queued_bytes) {
    return CloseAsTooSlow();
  }
  WriteNext();
}

/// Called when the queue has run dry during the replay.
void WebSocketSession::StartReplayPage() {
  if (replay_is_read_) return;
  replay_is_read_ = true;
  const auto read = [self = shared_from_this(), after = last_vehicle_, told = told_sequence_] {
    Replay replay;
    try {
      replay = after ? self->ReadVehicles(*after, told) : self->ReadEvents(told);
    } catch (const std::exception&) {
      replay.failed = true;
    }
    boost::asio::post(self->stream_.get_executor(), [self, replay = std::move(replay)]() mutable {
      self->TakeReplay(std::move(replay));
    });
  };
  slot_.context().work.Post(upgrade_.client, WorkQueue::Rank::kReader, read);
}

WebSocketSession::Replay WebSocketSession::ReadVehicles(const std::string& after,
                                                        std::uint64_t told_sequence) const {
  Replay replay;
  replay.told_sequence = told_sequence;
  replay.newest = UINT64_MAX;  // Events are still to come.
  const auto vehicles = live_.zone.VehiclesAfter(after, kReplayPage);
  for (const zone::VehicleState& vehicle : vehicles) {
    replay.messages.push_back(Shared(VehicleMessage(vehicle)));
  }
  if (vehicles.size() == kReplayPage) replay.last_vehicle = vehicles.back().vehicle_id;
  return replay;
}

WebSocketSession::Replay WebSocketSession::ReadEvents(std::uint64_t told_sequence) const {
  Replay replay;
  // Read before the lists, and the end of both: what happens between the two comes later.
  replay.newest = live_.zone.Sequence();
  zone::Walk<zone::HazardState> hazard_walk;
  zone::Walk<zone::MapChangeState> change_walk;
  hazard_walk.after = change_walk.after = told_sequence;
  hazard_walk.until = change_walk.until = replay.newest;
  if (told_sequence == 0) {
    hazard_walk.states = zone::StatesOnMap();
    change_walk.states = zone::OpenStates();
  }
  const auto hazards = live_.zone.ReadHazards(hazard_walk, kReplayPage);
  const auto changes = live_.zone.ReadMapChanges(change_walk, kReplayPage);
  std::uint64_t end = replay.newest;
  if (!hazards.is_last) end = std::min(end, hazards.sequence);
  if (!changes.is_last) end = std::min(end, changes.sequence);
  std::map<std::uint64_t, std::shared_ptr<const std::string>> messages;
  for (const zone::Hazard& hazard : hazards.items) {
    if (hazard.sequence > end) break;
    if (!sees_.candidates && hazard.announced_sequence == 0) continue;
    messages[hazard.sequence] = Shared(
        HazardMessage(ReplayAction(hazard), hazard, live_.catalogue, live_.zone.WordsOf(hazard)));
  }
  for (const zone::MapChangeFeature& change : changes.items) {
    if (change.sequence > end || !sees_.candidates) break;
    messages[change.sequence] = Shared(MapChangeMessage(ReplayAction(change), change));
  }
  for (auto& entry : messages) replay.messages.push_back(std::move(entry.second));
  replay.told_sequence = std::max(told_sequence, end);
  return replay;
}

void WebSocketSession::TakeReplay(Replay replay) {
  replay_is_read_ = false;
  if (state_ == State::kClosing) return;
  if (replay.failed) return CloseAsFailed();
  for (auto& message : replay.messages) Enqueue(std::move(message));
  last_vehicle_ = std::move(replay.last_vehicle);
  told_sequence_ = replay.told_sequence;
  if (told_sequence_ >= replay.newest && announced_sequence_ <= told_sequence_) {
    state_ = State::kLive;
    Enqueue(Shared({{"type", "live"}, {"sequence", told_sequence_}}));
  }
  WriteNext();
}

void WebSocketSession::Enqueue(std::shared_ptr<const std::string> text) {
  queued_bytes_ += text->size();
  queue_.push_back(std::move(text));
}

void WebSocketSession::WriteNext() {
  if (writing_ || state_ == State::kClosing) return;
  if (queue_.empty() && state_ == State::kReplaying) StartReplayPage();
  if (queue_.empty()) return;
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
  live_.hub.Leave(this);
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
