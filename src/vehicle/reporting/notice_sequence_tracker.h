#pragma once

#include <cstddef>
#include <cstdint>
#include <map>

namespace livemap::vehicle {

/// Up to which of the zone's announcements a vehicle knows all. Every announcement names the one
/// before it: when that is not known, something was missed, and those that came ahead wait until
/// the gap is closed. Not thread-safe.
class NoticeSequenceTracker {
 public:
  explicit NoticeSequenceTracker(std::uint64_t known = 0) : known_(known) {}

  /// An announcement came, `previous` is the one before it. False when there is a gap before it.
  bool Add(std::uint64_t previous, std::uint64_t sequence);
  /// All up to `sequence` is known: what waited for that counts now.
  void CloseTo(std::uint64_t sequence);

  std::uint64_t known() const { return known_; }
  bool has_gap() const { return !ahead_.empty(); }

 private:
  static constexpr std::size_t kMaxAhead = 10000;

  std::uint64_t known_;
  std::map<std::uint64_t, std::uint64_t> ahead_;  // Previous and own sequence of what came ahead.
};

}  // namespace livemap::vehicle
