#include "web/server/connection_table.h"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <utility>

namespace livemap::web {
namespace {

/// An answer of which nothing went for so long counts as not read.
constexpr std::int64_t kSlowNs = 2'000'000'000;
/// Bytes of the IPv6 networks that clients are weighed by.
constexpr std::array<std::ptrdiff_t, 3> kNetworkBytes{6, 7, 8};

}  // namespace

std::optional<ConnectionTable::Id> ConnectionTable::Admit(const std::string& client,
                                                          std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  // Sockets that are being ended are closed within moments; a flood must not outrun that.
  if (entries_.size() >= 2 * config_.max_connections) {
    ++refused_;
    return std::nullopt;
  }
  Entry entry;
  entry.client = client;
  entry.networks = NetworksOf(client);
  entry.since_ns = now_ns;
  if (!MakeOrdinaryPlace(entry, now_ns)) {
    if (ordinary_ + reserve_ >= config_.max_connections && !EndOneOnReserve()) {
      ++refused_;
      return std::nullopt;
    }
    entry.kind = Kind::kReserve;
  }
  Count(entry, 1);
  entries_.emplace(++last_id_, std::move(entry));
  return last_id_;
}

ConnectionTable::Networks ConnectionTable::NetworksOf(const std::string& client) {
  Networks networks;
  networks.fill(client);
  boost::system::error_code failure;
  const auto address = boost::asio::ip::make_address(client, failure);
  if (failure || !address.is_v6()) return networks;
  for (std::size_t width = 0; width < kWidths; ++width) {
    auto bytes = address.to_v6().to_bytes();
    std::fill(bytes.begin() + kNetworkBytes.at(width), bytes.end(), static_cast<unsigned char>(0));
    networks.at(width) = boost::asio::ip::make_address_v6(bytes).to_string();
  }
  return networks;
}

bool ConnectionTable::MakeOrdinaryPlace(const Entry& newcomer, std::int64_t now_ns) {
  const bool has_share = config_.proxies.count(newcomer.client) == 0;
  if (has_share && CountOf(newcomer, &Crowd::connections) >= config_.max_per_client &&
      !EndOneThatWaits(&newcomer.client, now_ns)) {
    return false;
  }
  const auto is_full = [this]() REQUIRES(mutex_) {
    return ordinary_ >= OrdinaryPlaces() || ordinary_ + reserve_ >= config_.max_connections;
  };
  return !is_full() || EndOneThatWaits(nullptr, now_ns) || EndOneOfTheHeaviest(newcomer);
}

/// Of this client, or of whoever has the most.
bool ConnectionTable::EndOneThatWaits(const std::string* client, std::int64_t now_ns) {
  return EndHeaviest(&Crowd::connections, [&](const Entry& entry) {
    if (client != nullptr && entry.client != *client) return false;
    return entry.phase == Phase::kWaiting || entry.phase == Phase::kLeaving ||
           (entry.phase == Phase::kWriting && now_ns - entry.since_ns > kSlowNs);
  });
}

bool ConnectionTable::EndOneOfTheHeaviest(const Entry& newcomer) {
  return EndHeaviest(&Crowd::connections, [&](const Entry& entry) {
    mutex_.AssertHeld();
    return Excess(entry, newcomer, &Crowd::connections).value_or(0) >= 2;
  });
}

bool ConnectionTable::EndAStreamFor(const Entry& newcomer, std::int64_t now_ns) {
  return EndHeaviest(&Crowd::streams, [&](const Entry& entry) {
    mutex_.AssertHeld();
    if (entry.phase != Phase::kStream) return false;
    const auto excess = Excess(entry, newcomer, &Crowd::streams);
    const bool had_its_turn = now_ns - entry.since_ns >= kStreamTurnNs;
    return excess ? *excess >= (had_its_turn ? 1 : 2) : had_its_turn;
  });
}

bool ConnectionTable::EndHeaviest(Number number, const std::function<bool(const Entry&)>& may_end) {
  Entry* victim = nullptr;
  Weight heaviest{};
  for (auto& [id, entry] : entries_) {
    if (entry.kind != Kind::kOrdinary || !entry.end || !may_end(entry)) continue;
    const Weight weight = WeightOf(entry, number);
    const bool is_better = victim == nullptr || weight > heaviest ||
                           (weight == heaviest && entry.since_ns < victim->since_ns);
    if (!is_better) continue;
    victim = &entry;
    heaviest = weight;
  }
  if (victim == nullptr) return false;
  EndEntry(*victim);
  return true;
}

bool ConnectionTable::EndOneOnReserve() {
  Entry* victim = nullptr;
  for (auto& [id, entry] : entries_) {
    const bool waits = entry.kind == Kind::kReserve && entry.phase == Phase::kWaiting;
    const bool is_on_reserve = entry.kind == Kind::kReserve || entry.kind == Kind::kOfficial;
    const bool leaves = is_on_reserve && entry.phase == Phase::kLeaving;
    if (!(waits || leaves) || !entry.end) continue;
    if (victim == nullptr || entry.since_ns < victim->since_ns) victim = &entry;
  }
  if (victim == nullptr) return false;
  EndEntry(*victim);
  return true;
}

void ConnectionTable::EndEntry(Entry& entry) {
  ++ended_;
  SetKind(entry, Kind::kEnded);
  entry.end();
}

void ConnectionTable::SetKind(Entry& entry, Kind kind) {
  Count(entry, -1);
  entry.kind = kind;
  Count(entry, 1);
}

void ConnectionTable::Count(const Entry& entry, int change) {
  const auto add = [change](std::size_t& number) { number = change > 0 ? number + 1 : number - 1; };
  if (entry.kind == Kind::kReserve || entry.kind == Kind::kOfficial) add(reserve_);
  if (entry.kind != Kind::kOrdinary) return;
  const bool is_stream = entry.phase == Phase::kStream;
  add(ordinary_);
  if (is_stream) add(streams_);
  for (std::size_t width = 0; width < kWidths; ++width) {
    Crowds& crowds = crowds_.at(width);
    const auto crowd = crowds.try_emplace(entry.networks.at(width)).first;
    add(crowd->second.connections);
    if (is_stream) add(crowd->second.streams);
    if (crowd->second.connections == 0) crowds.erase(crowd);
  }
}

std::size_t ConnectionTable::CountIn(std::size_t width, const Networks& networks,
                                     Number number) const {
  const Crowds& crowds = crowds_.at(width);
  const auto found = crowds.find(networks.at(width));
  return found == crowds.end() ? 0 : found->second.*number;
}

std::size_t ConnectionTable::CountOf(const Entry& entry, Number number) const {
  return CountIn(kWidths - 1, entry.networks, number);
}

ConnectionTable::Weight ConnectionTable::WeightOf(const Entry& entry, Number number) const {
  Weight weight{};
  for (std::size_t width = 0; width < kWidths; ++width) {
    weight.at(width) = CountIn(width, entry.networks, number);
  }
  return weight;
}

std::optional<std::int64_t> ConnectionTable::Excess(const Entry& entry, const Entry& newcomer,
                                                    Number number) const {
  for (std::size_t width = 0; width < kWidths; ++width) {
    if (entry.networks.at(width) == newcomer.networks.at(width)) continue;
    return static_cast<std::int64_t>(CountIn(width, entry.networks, number)) -
           static_cast<std::int64_t>(CountIn(width, newcomer.networks, number));
  }
  return std::nullopt;
}

void ConnectionTable::SetEnd(Id id, End end) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  found->second.end = std::move(end);
  if (found->second.kind == Kind::kEnded) found->second.end();
}

void ConnectionTable::Remove(Id id) {
  End released;  // Destroyed after the lock is given back.
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  Count(found->second, -1);
  released = std::move(found->second.end);
  entries_.erase(found);
}

void ConnectionTable::SetClient(Id id, const std::string& client, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.client == client) return;
  Entry& entry = found->second;
  Count(entry, -1);
  entry.client = client;
  entry.networks = NetworksOf(client);
  if (entry.kind == Kind::kOfficial) entry.kind = Kind::kReserve;
  if (entry.kind == Kind::kOrdinary && !MakeOrdinaryPlace(entry, now_ns)) {
    entry.kind = Kind::kReserve;
  }
  Count(entry, 1);
}

void ConnectionTable::SetPhase(Id id, Phase phase, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  Count(found->second, -1);
  found->second.phase = phase;
  found->second.since_ns = now_ns;
  Count(found->second, 1);
}

bool ConnectionTable::MayServe(Id id) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return false;
  Entry& entry = found->second;
  if (entry.kind != Kind::kReserve) return entry.kind != Kind::kEnded;
  Count(entry, -1);
  const bool has_place = MakeOrdinaryPlace(entry, entry.since_ns);
  if (has_place) entry.kind = Kind::kOrdinary;
  Count(entry, 1);
  return has_place;
}

void ConnectionTable::MakeOfficial(Id id) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.kind == Kind::kEnded) return;
  SetKind(found->second, Kind::kOfficial);
}

bool ConnectionTable::BecomeStream(Id id, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.kind == Kind::kEnded) return false;
  Entry& entry = found->second;
  const std::size_t max_of_client = std::max<std::size_t>(1, config_.max_per_client * 3 / 4);
  const std::size_t max_of_all = OrdinaryPlaces() - OrdinaryPlaces() / 4;
  const bool has_share = config_.proxies.count(entry.client) == 0;
  const auto has_room = [&]() REQUIRES(mutex_) {
    if (has_share && CountOf(entry, &Crowd::streams) >= max_of_client) return false;
    return streams_ < max_of_all || EndAStreamFor(entry, now_ns);
  };
  if (entry.kind == Kind::kOrdinary && entry.phase != Phase::kStream && !has_room()) {
    ++refused_;
    return false;
  }
  Count(entry, -1);
  entry.phase = Phase::kStream;
  entry.since_ns = now_ns;
  Count(entry, 1);
  return true;
}

std::size_t ConnectionTable::size() const {
  const MutexLock lock(mutex_);
  return entries_.size();
}

std::uint64_t ConnectionTable::ended() const {
  const MutexLock lock(mutex_);
  return ended_;
}

std::uint64_t ConnectionTable::refused() const {
  const MutexLock lock(mutex_);
  return refused_;
}

}  // namespace livemap::web
