#include "nodelets/stamp_checks.h"

#include <ros/console.h>

#include <utility>

#include "nodelets/nodelet_support.h"

namespace livemap::nodelets {
namespace {

StampGate::Config GateConfig(double max_ahead_s) {
  StampGate::Config config;
  config.max_ahead_s = max_ahead_s;
  return config;
}

StampGates::Config GatesConfig(double max_ahead_s) {
  StampGates::Config config;
  config.gate = GateConfig(max_ahead_s);
  return config;
}

}  // namespace

StampChecks::StampChecks(std::string nodelet_name, double max_ahead_s, OnTimeReset on_time_reset)
    : nodelet_name_(std::move(nodelet_name)),
      max_ahead_s_(max_ahead_s),
      on_time_reset_(std::move(on_time_reset)),
      gates_(GatesConfig(max_ahead_s)) {}

void StampChecks::AllowLate(const std::string& input, double set_back_s) {
  StampGate::Config config = GateConfig(max_ahead_s_);
  config.set_back_s = set_back_s;
  const MutexLock lock(mutex_);
  gates_.Set(input, config);
}

bool StampChecks::IsUsable(const std::string& input, const ros::Time& stamp) {
  StampGates::Judgement judgement;
  {
    const MutexLock lock(mutex_);
    judgement =
        gates_.Judge(input, static_cast<std::int64_t>(stamp.toNSec()), RosNowNs(), SteadyS());
  }
  if (judgement.begins_anew) on_time_reset_();
  if (StampGate::IsUsable(judgement.verdict)) return true;
  Warn(input, judgement.verdict, stamp);
  return false;
}

void StampChecks::CheckClock() {
  {
    const MutexLock lock(mutex_);
    if (!gates_.CheckClock(RosNowNs(), SteadyS())) return;
  }
  on_time_reset_();
}

void StampChecks::Warn(const std::string& input, StampGate::Verdict verdict,
                       const ros::Time& stamp) const {
  const double ahead_s = stamp.toSec() - ros::Time::now().toSec();
  switch (verdict) {
    case StampGate::Verdict::kAhead:
      ROS_WARN_THROTTLE(kSayAgainS,
                        "%s: refused %s whose stamp %.3f is %.1f s ahead of the clock, accepted "
                        "are at most %.1f s (max_stamp_ahead_s)",
                        nodelet_name_.c_str(), input.c_str(), stamp.toSec(), ahead_s, max_ahead_s_);
      break;
    case StampGate::Verdict::kStray:
      ROS_WARN_THROTTLE(kSayAgainS,
                        "%s: refused %s whose stamp %.3f fits neither the clock, from which it is "
                        "%.1f s away, nor those before it",
                        nodelet_name_.c_str(), input.c_str(), stamp.toSec(), ahead_s);
      break;
    default:
      ROS_WARN_THROTTLE(kSayAgainS, "%s: refused %s without a stamp", nodelet_name_.c_str(),
                        input.c_str());
  }
}

std::uint64_t StampChecks::refused() const {
  const MutexLock lock(mutex_);
  return gates_.refused();
}

void StampChecks::Diagnose(Diagnostics::Status& status) const {
  const MutexLock lock(mutex_);
  status.add("stamps_refused", gates_.refused());
  status.add("time_resets", gates_.resets());
}

}  // namespace livemap::nodelets
