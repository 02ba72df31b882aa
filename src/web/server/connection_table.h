#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "common/mutex.h"

namespace livemap::web {

/// Who may be connected: all connections of the server by client, an IPv4 address or an IPv6 /64
/// network. Thread-safe.
///
/// Clients are weighed by their networks, the widest first: /48, /56 and /64 of IPv6, of which one
/// customer may have all addresses; an IPv4 address is all three. Two clients are compared at the
/// widest networks in which they differ. So a crowd within one network weighs as one, and does not
/// weigh on a newcomer from the same network who stands beside the crowd.
///
/// A client has a share. Whoever comes when the share or the table is full takes the place of a
/// connection that waits for its client: one that is idle, whose request is not complete, whose
/// answer is not read, or that leaves. Of a full table's, that of the heaviest client ends, the
/// longest wait first. Where nobody waits, a client takes a place of the heaviest one whose network
/// has two connections more than the newcomer's: so no network, however many connections it opens,
/// keeps another one out.
///
/// Live streams never wait for their client, and have at most three quarters of the ordinary
/// places: requests always find the others. When these are taken, the oldest stream of the heaviest
/// client makes room in the same way; one that has lasted for kStreamTurnNs does so for a
/// difference of one too, and for its own client. So streams take turns where more want one than
/// there are.
///
/// Who finds no place that way is let in on the reserve: only an official's request is served
/// there, or one from the loopback for /healthz. Connections of officials are never ended before
/// they leave.
class ConnectionTable {
 public:
  using Id = std::uint64_t;
  struct Config {
    std::size_t max_connections = 256;      ///< With the reserve.
    std::size_t max_per_client = 64;        ///< Of them three quarters may be live streams.
    std::size_t reserved_connections = 32;  ///< Less than max_connections.
    /// Names of clients without a share: others stand behind them (TrustedProxies).
    std::set<std::string> proxies;
  };
  /// A stream that has lasted so long may be ended for one of a client that weighs no more.
  static constexpr std::int64_t kStreamTurnNs = 60'000'000'000;

  enum class Phase {
    kWaiting,  ///< For a request, or the rest of one.
    kWorking,  ///< The answer is being made.
    kWriting,  ///< The answer is on its way; slow when nothing of it went for long.
    kStream,   ///< A live stream.
    kLeaving   ///< Its last answer is sent: it is only closed, and its place is anybody's.
  };
  /// Ends a connection; called from any thread, while the table is locked: must only post.
  using End = std::function<void()>;

  explicit ConnectionTable(Config config) : config_(std::move(config)) {}

  /// Lets a connection in; none when there is no place for it. Ends others as the class says.
  std::optional<Id> Admit(const std::string& client, std::int64_t now_ns);
  /// How to end this connection; until this is called it cannot be ended.
  void SetEnd(Id id, End end);
  void Remove(Id id);
  /// The connection's requests are another client's from now on, as behind a proxy. It counts
  /// against that one's share, and is on the reserve where that is full, and where it was an
  /// official's.
  void SetClient(Id id, const std::string& client, std::int64_t now_ns);

  /// Something of the connection's went on at `now_ns`, a steady clock. A client that sees the end
  /// of its connection may come again at once: kLeaving is set before that end is sent.
  void SetPhase(Id id, Phase phase, std::int64_t now_ns);
  /// False for one on the reserve that found no place since: only an official is served.
  bool MayServe(Id id);
  /// The connection has shown a valid token.
  void MakeOfficial(Id id);
  /// Makes it a live stream; false when the client has as many as it may, or all together have and
  /// none makes room. May end another one.
  bool BecomeStream(Id id, std::int64_t now_ns);

  /// Open connections, those that are just being ended too.
  std::size_t size() const;
  /// How many connections were ended for others, and turned away, since the start.
  std::uint64_t ended() const;
  std::uint64_t refused() const;

 private:
  enum class Kind { kOrdinary, kReserve, kOfficial, kEnded };
  /// How many networks a client is weighed by.
  static constexpr std::size_t kWidths = 3;
  /// A client's networks, the widest first; the last one is the client itself.
  using Networks = std::array<std::string, kWidths>;
  struct Entry {
    std::string client;
    Networks networks;
    Kind kind = Kind::kOrdinary;
    Phase phase = Phase::kWaiting;
    std::int64_t since_ns = 0;  ///< When it last went on.
    End end;
  };
  /// Ordinary connections of one network.
  struct Crowd {
    std::size_t connections = 0;
    std::size_t streams = 0;
  };
  using Number = std::size_t Crowd::*;
  using Weight = std::array<std::size_t, kWidths>;
  using Crowds = std::map<std::string, Crowd>;

  static Networks NetworksOf(const std::string& client);
  bool MakeOrdinaryPlace(const Entry& newcomer, std::int64_t now_ns) REQUIRES(mutex_);
  bool EndOneThatWaits(const std::string* client, std::int64_t now_ns) REQUIRES(mutex_);
  bool EndOneOfTheHeaviest(const Entry& newcomer) REQUIRES(mutex_);
  bool EndAStreamFor(const Entry& newcomer, std::int64_t now_ns) REQUIRES(mutex_);
  /// Ends the connection of the heaviest client, by `number`, for which `may_end` is true; of
  /// several the one that has waited or lasted the longest. False when there is none.
  bool EndHeaviest(Number number, const std::function<bool(const Entry&)>& may_end)
      REQUIRES(mutex_);
  bool EndOneOnReserve() REQUIRES(mutex_);
  void EndEntry(Entry& entry) REQUIRES(mutex_);
  void SetKind(Entry& entry, Kind kind) REQUIRES(mutex_);
  void Count(const Entry& entry, int change) REQUIRES(mutex_);
  std::size_t CountIn(std::size_t width, const Networks& networks, Number number) const
      REQUIRES(mutex_);
  std::size_t CountOf(const Entry& entry, Number number) const REQUIRES(mutex_);
  Weight WeightOf(const Entry& entry, Number number) const REQUIRES(mutex_);
  /// By how much the widest network of `entry` that is none of the newcomer's exceeds the
  /// newcomer's; none when they are of the same client.
  std::optional<std::int64_t> Excess(const Entry& entry, const Entry& newcomer, Number number) const
      REQUIRES(mutex_);
  std::size_t OrdinaryPlaces() const {
    return config_.max_connections - config_.reserved_connections;
  }

  const Config config_;
  mutable Mutex mutex_;
  std::map<Id, Entry> entries_ GUARDED_BY(mutex_);
  /// Networks with ordinary connections, of each width.
  std::array<Crowds, kWidths> crowds_ GUARDED_BY(mutex_);
  std::size_t ordinary_ GUARDED_BY(mutex_) = 0;
  std::size_t streams_ GUARDED_BY(mutex_) = 0;  ///< Of the ordinary ones.
  std::size_t reserve_ GUARDED_BY(mutex_) = 0;  ///< On the reserve, officials too.
  Id last_id_ GUARDED_BY(mutex_) = 0;
  std::uint64_t ended_ GUARDED_BY(mutex_) = 0;
  std::uint64_t refused_ GUARDED_BY(mutex_) = 0;
};

}  // namespace livemap::web
