#include "receiver/receiver_watch.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "common/time.h"
#include "geo/fix_plausibility.h"

namespace livemap::receiver {
namespace {

constexpr double kUnstatedSigmaM = 10;
// GPS counts its weeks modulo 1024: an old receiver is so far, or a multiple of it, in the past.
constexpr double kRolloverS = 1024.0 * 7 * 86400;

std::string SecondsText(double seconds) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f s", seconds);
  return text;
}

geo::ReceiverPoint PointOf(const ReceiverFix& fix) {
  const double sigma_m = fix.plane_sigma_m ? fix.plane_sigma_m->maxCoeff() : kUnstatedSigmaM;
  return {fix.stamp_ns, fix.position, sigma_m};
}

/// Refuses nothing for its distance from the clock that the comparison of the clocks takes.
StampGate::Config GateOf(double max_clock_offset_s) {
  StampGate::Config config;
  config.max_ahead_s = std::max(config.max_ahead_s, max_clock_offset_s);
  config.near_clock_s = std::max(config.near_clock_s, max_clock_offset_s);
  return config;
}

bool IsRollover(double offset_s) {
  const double rounds = std::round(offset_s / kRolloverS);
  return rounds >= 1 && std::abs(offset_s - rounds * kRolloverS) < 2 * 86400.0;
}

}  // namespace

const char* NameOf(ReceiverState state) {
  switch (state) {
    case ReceiverState::kNoGpsd:
      return "no gpsd";
    case ReceiverState::kNoReceiver:
      return "no receiver";
    case ReceiverState::kSilent:
      return "receiver silent";
    case ReceiverState::kNoFix:
      return "no fix";
    case ReceiverState::kClockWrong:
      return "clock wrong";
    case ReceiverState::kFix:
      return "fix";
  }
  return "?";
}

ReceiverWatch::ReceiverWatch(Config config)
    : config_(std::move(config)), gate_(GateOf(config_.max_clock_offset_s)) {}

void ReceiverWatch::OnConnection(bool connected, const std::string& reason, const Now& now) {
  if (connected) ++counters_.connections;
  connected_ = connected;
  reason_ = reason;
  devices_.clear();
  Forget();
  heard_ns_ = now.steady_ns;
}

void ReceiverWatch::Forget() {
  device_.clear();
  present_ = false;
  verdict_ = FixVerdict::kNoFix;
  clock_.Reset();
  satellites_used_ = satellites_visible_ = 0;
}

void ReceiverWatch::OnDevices(const std::vector<GpsdDevice>& devices) {
  devices_ = devices;
  const auto is_open = [this](const std::string& path) {
    return std::any_of(devices_.begin(), devices_.end(), [&](const GpsdDevice& device) {
      return device.is_open && (path.empty() || device.path == path);
    });
  };
  if (!device_.empty() && !is_open(device_)) Forget();
  present_ = is_open(device_.empty() ? config_.device : device_);
}

void ReceiverWatch::OnSatellites(const std::string& device, int used, int visible) {
  if (device != device_) return;
  satellites_used_ = used;
  satellites_visible_ = visible;
}

bool ReceiverWatch::ListensTo(const ReceiverReport& report, FixVerdict verdict,
                              std::int64_t steady_ns) {
  if (!config_.device.empty() && report.device != config_.device) return false;
  if (report.device == device_ && present_) return true;
  const bool is_better = verdict == FixVerdict::kFix && verdict_ != FixVerdict::kFix;
  if (!device_.empty() && !IsSilent(steady_ns) && !is_better) return false;
  Forget();
  device_ = report.device;
  present_ = true;
  return true;
}

ReceiverWatch::Taken ReceiverWatch::OnReport(const ReceiverReport& report, const Now& now) {
  ++counters_.reports;
  const JudgedFix judged = FixOf(report, config_.conversion);
  if (!ListensTo(report, judged.verdict, now.steady_ns)) {
    ++counters_.reports_of_others;
    return {};
  }
  heard_ns_ = now.steady_ns;
  verdict_ = judged.verdict;
  if (judged.fix) return TakeFix(report, *judged.fix, now);
  ++(judged.verdict == FixVerdict::kNoFix ? counters_.no_fix : counters_.refused);
  return {{}, {}, true};
}

ReceiverWatch::Taken ReceiverWatch::TakeFix(const ReceiverReport& report, const ReceiverFix& fix,
                                            const Now& now) {
  clock_.Add(fix.stamp_ns, now.system_ns, now.steady_ns);
  if (IsClockWrong()) {
    ++counters_.withheld;
    return {};
  }
  const StampGate::Verdict verdict = gate_.Judge(fix.stamp_ns, now.system_ns);
  if (verdict == StampGate::Verdict::kLate) {
    ++counters_.repeated;
    return {};
  }
  if (!StampGate::IsUsable(verdict)) {
    ++counters_.strays;
    return {};
  }
  CountJump(fix);
  newest_ = fix;
  ++counters_.fixes;
  JudgedVelocity judged = VelocityOf(report, config_.conversion);
  if (judged.refused) ++counters_.velocities_refused;
  if (judged.velocity) ++counters_.velocities;
  return {fix, judged.velocity, false};
}

void ReceiverWatch::CountJump(const ReceiverFix& fix) {
  if (newest_ &&
      !geo::AreReachable(PointOf(*newest_), PointOf(fix), config_.conversion.max_speed_mps)) {
    ++counters_.jumps;
  }
}

bool ReceiverWatch::IsSilent(std::int64_t steady_ns) const {
  return Seconds(steady_ns - heard_ns_) > config_.silence_s;
}

bool ReceiverWatch::IsClockWrong() const {
  const std::optional<double> offset_s = clock_.offset_s();
  return offset_s && std::abs(*offset_s) > config_.max_clock_offset_s;
}

ReceiverState ReceiverWatch::state(std::int64_t steady_ns) const {
  if (!connected_) return ReceiverState::kNoGpsd;
  if (!present_) return ReceiverState::kNoReceiver;
  if (IsSilent(steady_ns)) return ReceiverState::kSilent;
  if (verdict_ != FixVerdict::kFix) return ReceiverState::kNoFix;
  return IsClockWrong() ? ReceiverState::kClockWrong : ReceiverState::kFix;
}

std::string ReceiverWatch::Describe(std::int64_t steady_ns) const {
  const ReceiverState now = state(steady_ns);
  std::string sentence = NameOf(now);
  switch (now) {
    case ReceiverState::kNoGpsd:
      return sentence + ": " + reason_ + "; is gpsd installed and started (systemctl status gpsd)?";
    case ReceiverState::kNoReceiver:
      return sentence + ": " + DescribeAbsence();
    case ReceiverState::kSilent:
      return sentence + ": nothing that gpsd understands has come from " +
             (device_.empty() ? "it" : device_) + " for " +
             SecondsText(Seconds(steady_ns - heard_ns_)) +
             "; check its cable, and its speed (gpsmon)";
    case ReceiverState::kNoFix:
      if (verdict_ != FixVerdict::kNoFix) return sentence + ": " + ReasonOf(verdict_);
      return sentence + ": " + std::to_string(satellites_used_) + " of " +
             std::to_string(satellites_visible_) +
             " satellites in view are used; the antenna must see the sky";
    case ReceiverState::kClockWrong:
      return sentence + ": " + DescribeClock();
    case ReceiverState::kFix:
      return sentence + " of " + device_;
  }
  return sentence;
}

std::string ReceiverWatch::DescribeAbsence() const {
  if (devices_.empty()) return "gpsd has none; plug it in, or name it to gpsd (/etc/default/gpsd)";
  const auto asked = std::find_if(devices_.begin(), devices_.end(), [this](const GpsdDevice& each) {
    return config_.device.empty() || each.path == config_.device;
  });
  if (asked != devices_.end()) return "gpsd cannot open " + asked->path + "; plug it in";
  return "gpsd has no " + config_.device + " but " + devices_.front().path;
}

std::string ReceiverWatch::DescribeClock() const {
  const double offset_s = clock_.offset_s().value_or(0);
  const std::string apart = "this computer's clock is " + SecondsText(std::abs(offset_s)) +
                            (offset_s > 0 ? " ahead of the receiver's" : " behind the receiver's") +
                            ", accepted is " + SecondsText(config_.max_clock_offset_s) +
                            "; fixes are withheld; ";
  if (IsRollover(offset_s)) {
    return apart +
           "the receiver's date is a multiple of 1024 weeks old: gpsd or the receiver needs "
           "newer software";
  }
  return apart + "set the clock by network or receiver (chrony)";
}

}  // namespace livemap::receiver
