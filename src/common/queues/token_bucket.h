#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "common/time.h"

namespace livemap {

/// A budget that refills evenly with time and never holds more than its capacity, so that any span
/// of `refill_s` spends at most twice the capacity, and the long run no more than one capacity for
/// each `refill_s`. Tokens may be messages, bytes or anything else that is counted. A new bucket is
/// full. Not thread-safe.
///
/// Typical usage:
///   TokenBucket budget({600.0, 60.0});  // 600 bytes a minute.
///   budget.Refill(now_ns);
///   if (!budget.Take(size)) return;  // Nothing was taken.
class TokenBucket {
 public:
  /// A step back of the clock never takes tokens away.
  enum class StepBack {
    kWait,   ///< Refill again once the clock is past the latest moment it has shown.
    kFollow  ///< Refill again from the earlier moment on.
  };
  struct Config {
    double capacity = 1;
    double refill_s = 1;  ///< An empty bucket is full after so many seconds.
    StepBack step_back = StepBack::kWait;
  };

  explicit TokenBucket(const Config& config) : config_(config), tokens_(config.capacity) {}

  /// The tokens that the bucket would hold after Refill(now_ns).
  double TokensAt(std::int64_t now_ns) const {
    if (!at_ns_ || now_ns <= *at_ns_) return tokens_;
    const double gained = Seconds(now_ns - *at_ns_) / config_.refill_s * config_.capacity;
    return std::min(config_.capacity, tokens_ + gained);
  }
  void Refill(std::int64_t now_ns) {
    tokens_ = TokensAt(now_ns);
    const bool goes_back = at_ns_ && now_ns < *at_ns_;
    if (!goes_back || config_.step_back == StepBack::kFollow) at_ns_ = now_ns;
  }
  /// Takes `amount` tokens; returns false, and takes nothing, when the bucket holds fewer.
  bool Take(double amount) {
    if (tokens_ < amount) return false;
    tokens_ -= amount;
    return true;
  }
  /// Takes `amount` tokens even where that leaves a debt; a negative amount gives tokens back.
  void Spend(double amount) { tokens_ = std::min(config_.capacity, tokens_ - amount); }

  double tokens() const { return tokens_; }
  double capacity() const { return config_.capacity; }
  /// Returns whether an empty bucket that was last refilled at its latest moment is full by now.
  bool IsSurelyFull(std::int64_t now_ns) const {
    return !at_ns_ || Seconds(now_ns - *at_ns_) >= config_.refill_s;
  }

 private:
  Config config_;
  double tokens_;
  std::optional<std::int64_t> at_ns_;  ///< `tokens_` is of this moment; none before any Refill.
};

/// The buckets of many keys, `kBuckets` for each, in bounded memory whatever keys come. Not
/// thread-safe.
template <std::size_t kBuckets>
class KeyedTokenBuckets {
 public:
  using Buckets = std::array<TokenBucket, kBuckets>;
  /// When a new key comes and `max_keys` are kept, the longest-silent key is forgotten...
  enum class Eviction {
    kOnlyFull,  ///< ...if its buckets are full again: otherwise it would gain by being forgotten,
                ///< and the new key gets none.
    kAlways     ///< ...in any case.
  };

  /// A new key starts with a copy of `full`. Requires `max_keys` >= 1.
  KeyedTokenBuckets(Buckets full, std::size_t max_keys, Eviction eviction)
      : full_(std::move(full)), max_keys_(max_keys), eviction_(eviction) {}

  /// Returns the key's buckets, refilled up to `now_ns`, and counts the key as heard now; null for
  /// a new key that there is no room for. The pointer holds until the next call.
  Buckets* Use(const std::string& key, std::int64_t now_ns) {
    auto found = entries_.find(key);
    if (found == entries_.end()) {
      if (entries_.size() >= max_keys_ && !ForgetLongestSilent(now_ns)) return nullptr;
      const auto place = by_use_.insert(by_use_.end(), key);
      found = entries_.emplace(key, Entry{full_, place}).first;
    }
    Entry& entry = found->second;
    by_use_.splice(by_use_.end(), by_use_, entry.place);
    for (TokenBucket& bucket : entry.buckets) bucket.Refill(now_ns);
    return &entry.buckets;
  }
  /// Returns the key's buckets as they were when it was last used; null for an unknown key.
  const Buckets* Find(const std::string& key) const {
    const auto found = entries_.find(key);
    return found == entries_.end() ? nullptr : &found->second.buckets;
  }

  std::size_t keys() const { return entries_.size(); }

 private:
  struct Entry {
    Buckets buckets;
    std::list<std::string>::iterator place;
  };

  bool ForgetLongestSilent(std::int64_t now_ns) {
    const auto silent = entries_.find(by_use_.front());
    const Buckets& buckets = silent->second.buckets;
    const bool is_full =
        std::all_of(buckets.begin(), buckets.end(),
                    [&](const TokenBucket& bucket) { return bucket.IsSurelyFull(now_ns); });
    if (eviction_ == Eviction::kOnlyFull && !is_full) return false;
    by_use_.pop_front();
    entries_.erase(silent);
    return true;
  }

  Buckets full_;
  std::size_t max_keys_;
  Eviction eviction_;
  std::unordered_map<std::string, Entry> entries_;
  std::list<std::string> by_use_;  ///< Longest silent first.
};

}  // namespace livemap
