#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "vehicle/alerts/driver_alerts.h"

namespace livemap::vehicle {

/// Which alert the driver hears next. One is spoken at a time. The most urgent goes first, then the
/// one that is reached first. An alert that is cancelled or passed before it is spoken is never
/// spoken, and neither is one that would come too late. Deterministic. Not thread-safe.
///
/// Typical usage: Take alerts as they come; when Next gives one, say it, and tell Finish how it
/// ended; stop saying it where Take returned true.
class SpeechQueue {
 public:
  struct Config {
    std::size_t max_waiting = 8;  ///< Beyond it the last in order is dropped.
    double max_wait_s = 10;       ///< An alert that has waited for longer is not said, s.
    double min_left_s = 1.0;      ///< Nor one whose hazard is reached sooner than this, s.
  };
  struct Counters {
    std::uint64_t said = 0;         ///< To their end.
    std::uint64_t interrupted = 0;  ///< Cancelled while they were said.
    std::uint64_t failed = 0;       ///< Nothing could be heard.
    std::uint64_t withdrawn = 0;    ///< Cancelled or passed before.
    std::uint64_t late = 0;         ///< Waited too long.
    std::uint64_t refused = 0;      ///< More urgent ones filled the queue.
  };
  enum class End { kSaid, kInterrupted, kFailed };

  explicit SpeechQueue(const Config& config) : config_(config) {}

  /// Any alert, at `now_s` of a clock that never goes back. True when it cancels the one that is
  /// being spoken, which must not go on.
  bool Take(const HazardAlert& alert, double now_s);
  /// The alert to be spoken from now on, with distance and time as they are at `now_s` by the speed
  /// at which it came; none while one is being spoken or none waits.
  std::optional<HazardAlert> Next(double now_s);
  /// The one that Next gave is over.
  void Finish(End end);

  bool speaks() const { return spoken_.has_value(); }
  std::size_t waiting() const { return waiting_.size(); }
  const Counters& counters() const { return counters_; }

 private:
  struct Waiting {
    HazardAlert alert;
    double since_s;

    double ReachedS() const { return since_s + alert.time_s; }
  };

  static bool IsBefore(const Waiting& a, const Waiting& b);
  bool Withdraw(const Uuid& id);

  Config config_;
  std::vector<Waiting> waiting_;  ///< In the order in which they are said.
  std::optional<Uuid> spoken_;
  Counters counters_;
};

}  // namespace livemap::vehicle
