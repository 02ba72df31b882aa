#pragma once

#include <cstdint>
#include <optional>

namespace livemap {

/// A stamp that comes up to this long before the newest one is late, s. One that comes further
/// before it says that time was set back.
constexpr double kMaxLateS = 1;

/// Whether `stamp_ns` comes so far before the newest stamp that time was set back.
bool IsSetBack(std::int64_t stamp_ns, std::int64_t newest_ns);

/// Decides which stamps of one stream of messages are believed. A stamp is measured by the clock
/// and by the stamps of the stream before it. One wrong stamp (a year ahead, of 1970) is refused
/// and changes nothing. Time that truly goes back (a bag that is played again, a clock that was
/// set) begins the stream anew: at once where the clock says so too, else after some stamps that
/// agree with each other. All stamps are nanoseconds since 1970. Not thread-safe.
///
/// Typical usage:
///   switch (gate.Judge(stamp_ns, now_ns)) { ... }
class StampGate {
 public:
  struct Config {
    /// A stamp further ahead of the clock than this is refused, s. Below the 10 s that tf keeps: no
    /// accepted stamp makes tf refuse the next ones as old.
    double max_ahead_s = 5;
    /// A stamp this near the clock needs no neighbour to be believed, s.
    double near_clock_s = 5;
    /// A stamp that is not near the clock and further than this after the one before must be
    /// confirmed by those that follow, s.
    double max_step_s = 60;
    /// A stamp that goes back by no more than this is late; by more, it must be confirmed, s.
    double set_back_s = kMaxLateS;
    /// So many stamps in succession that agree with each other, and not with the stream, are
    /// believed.
    int confirmations = 3;
  };

  enum class Verdict {
    kAccepted,   ///< Newer than the newest.
    kRestarted,  ///< Accepted; time went back: nothing of before can be compared with it.
    kLate,       ///< Not newer than the newest, by set_back_s at most.
    kAhead,      ///< Refused: too far ahead of the clock.
    kStray,      ///< Refused: it fits neither the stream nor the clock. Enough of its kind would.
    kInvalid,    ///< Refused: a stamp of nothing.
  };

  /// All but late and accepted ones.
  struct Counters {
    std::uint64_t ahead = 0;
    std::uint64_t stray = 0;
    std::uint64_t invalid = 0;
    std::uint64_t restarts = 0;
    std::uint64_t refused() const { return ahead + stray + invalid; }
  };

  StampGate() : StampGate(Config{}) {}
  explicit StampGate(const Config& config) : config_(config) {}

  /// `now_ns` is the clock of the stamps; 0: it is not known, and does not count.
  Verdict Judge(std::int64_t stamp_ns, std::int64_t now_ns);
  /// Forgets the stream: the next stamp is the first.
  void Reset();

  /// Whether a message of this verdict is of use, in its order or late.
  static bool IsUsable(Verdict verdict) { return verdict <= Verdict::kLate; }
  /// The newest believed stamp.
  const std::optional<std::int64_t>& newest_ns() const { return newest_ns_; }
  /// How many stamps in succession, up to the last one, agree with each other and not with the
  /// stream.
  int strays() const { return strays_; }
  const Counters& counters() const { return counters_; }

 private:
  Verdict JudgeStep(std::int64_t stamp_ns, std::int64_t now_ns);
  Verdict Accept(std::int64_t stamp_ns);

  Config config_;
  std::optional<std::int64_t> newest_ns_;
  std::int64_t stray_ns_ = 0;  ///< The newest of those that wait to be confirmed.
  int strays_ = 0;
  Counters counters_;
};

/// Tells of a clock when it was set back: a bag that is played again with its clock, or an
/// administrator. Not thread-safe.
class ClockWatch {
 public:
  /// Whether the clock shows a moment more than kMaxLateS before the one of the last call. 0 or
  /// less: the clock has not begun; false.
  bool HasGoneBack(std::int64_t now_ns);

 private:
  std::int64_t last_ns_ = 0;
};

}  // namespace livemap
