#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>

#include "common/stamp_gate.h"

namespace livemap::nodelets {

/// The stamps of several inputs that share a clock: a StampGate for each, and one word for all of
/// them when time is set back. Inputs do not go back at the same moment: without a clock each needs
/// some stamps that agree, and a slow one gets them late. An input that goes back belongs to those
/// that went back before it, unless stamps of it were believed for longer than `together_s` since.
/// Not thread-safe.
///
/// Typical usage:
///   const StampGates::Judgement judgement = gates.Judge("a fix", stamp_ns, now_ns, steady_s);
///   if (judgement.begins_anew) StartAnew();
///   if (!StampGate::IsUsable(judgement.verdict)) return;
class StampGates {
 public:
  struct Config {
    StampGate::Config gate;  ///< Of every input for which Set was not called.
    /// So long after time was set back an input may still bring stamps of before, s.
    double together_s = 2;
  };

  struct Judgement {
    StampGate::Verdict verdict = StampGate::Verdict::kInvalid;
    bool begins_anew = false;  ///< Time was set back: once for all inputs that go back together.
  };

  explicit StampGates(const Config& config) : config_(config) {}

  /// Gives one input a gate of its own, which has seen no stamp yet.
  void Set(const std::string& input, const StampGate::Config& config);
  /// What becomes of a stamp. `now_ns` is the clock of the stamps, ns since 1970; 0: it is not
  /// known. `steady_s` never goes back.
  Judgement Judge(const std::string& input, std::int64_t stamp_ns, std::int64_t now_ns,
                  double steady_s);
  /// Looks at the clock alone, where inputs may be silent. Whether everything begins anew.
  bool CheckClock(std::int64_t now_ns, double steady_s);

  bool Knows(const std::string& input) const { return inputs_.count(input) != 0; }
  std::size_t size() const { return inputs_.size(); }
  /// Stamps of all inputs that were refused.
  std::uint64_t refused() const;
  /// How often everything began anew.
  std::uint64_t resets() const { return resets_; }

 private:
  struct Input {
    explicit Input(const StampGate::Config& config) : gate(config) {}

    StampGate gate;
    double believed_s = -std::numeric_limits<double>::infinity();  ///< Steady; the last time.
  };

  bool BeginAnew(double steady_s);

  Config config_;
  std::map<std::string, Input> inputs_;
  ClockWatch clock_;
  double reset_s_ = -std::numeric_limits<double>::infinity();  ///< Steady; the last time.
  std::uint64_t resets_ = 0;
};

}  // namespace livemap::nodelets
