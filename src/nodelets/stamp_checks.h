#pragma once

#include <ros/time.h>

#include <cstdint>
#include <functional>
#include <string>

#include "common/mutex.h"
#include "common/stamp_gate.h"
#include "nodelets/diagnostics.h"
#include "nodelets/stamp_gates.h"

namespace livemap::nodelets {

/// The stamps of all inputs of a nodelet: StampGates by ROS's clock, with a warning and a counter
/// for what is refused. When the clock or an input's stamps go back, as those of a bag that is
/// played again, it says so once, and the nodelet begins anew. Thread-safe.
///
/// Typical usage: the first line of each callback is
///   if (!stamps_.IsUsable("a fix", message.header.stamp)) return;
class StampChecks {
 public:
  /// Called from within IsUsable and CheckClock, on their thread.
  using OnTimeReset = std::function<void()>;

  /// `max_ahead_s` is the parameter of that name: see StampGate::Config.
  StampChecks(std::string nodelet_name, double max_ahead_s, OnTimeReset on_time_reset);

  /// An input whose stamps may go back this far in their normal order, s. The others: kMaxLateS.
  void AllowLate(const std::string& input, double set_back_s);
  /// Whether the message of this stamp is of use. `input` names it in the warning: "an image".
  bool IsUsable(const std::string& input, const ros::Time& stamp);
  /// Looks at the clock alone: for a timer, where inputs may be silent.
  void CheckClock();
  /// Messages whose stamp was refused.
  std::uint64_t refused() const;
  /// Adds `stamps_refused` and `time_resets`.
  void Diagnose(Diagnostics::Status& status) const;

 private:
  void Warn(const std::string& input, StampGate::Verdict verdict, const ros::Time& stamp) const;

  const std::string nodelet_name_;
  const double max_ahead_s_;
  const OnTimeReset on_time_reset_;
  mutable Mutex mutex_;
  StampGates gates_ GUARDED_BY(mutex_);
};

}  // namespace livemap::nodelets
