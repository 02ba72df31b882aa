#include "common/stamp_gate.h"

#include <cmath>

#include "common/time.h"

namespace livemap {

bool IsSetBack(std::int64_t stamp_ns, std::int64_t newest_ns) {
  return Seconds(newest_ns - stamp_ns) > kMaxLateS;
}

StampGate::Verdict StampGate::Judge(std::int64_t stamp_ns, std::int64_t now_ns) {
  if (stamp_ns <= 0 || !IsStamp(stamp_ns)) {
    ++counters_.invalid;
    return Verdict::kInvalid;
  }
  if (now_ns > 0 && Seconds(stamp_ns - now_ns) > config_.max_ahead_s) {
    ++counters_.ahead;
    return Verdict::kAhead;
  }
  const Verdict verdict = newest_ns_ ? JudgeStep(stamp_ns, now_ns) : Accept(stamp_ns);
  if (verdict == Verdict::kStray) ++counters_.stray;
  if (verdict == Verdict::kRestarted) ++counters_.restarts;
  return verdict;
}

StampGate::Verdict StampGate::JudgeStep(std::int64_t stamp_ns, std::int64_t now_ns) {
  const double step_s = Seconds(stamp_ns - *newest_ns_);
  if (step_s > 0 && step_s <= config_.max_step_s) return Accept(stamp_ns);
  if (step_s <= 0 && step_s >= -config_.set_back_s) return Verdict::kLate;

  const bool near_clock =
      now_ns > 0 && std::abs(Seconds(stamp_ns - now_ns)) <= config_.near_clock_s;
  const bool newest_is_ahead = now_ns > 0 && Seconds(*newest_ns_ - now_ns) > config_.max_ahead_s;
  if (near_clock && (step_s > 0 || newest_is_ahead)) return Accept(stamp_ns);

  const double from_stray_s = Seconds(stamp_ns - stray_ns_);
  const bool agrees = strays_ > 0 && from_stray_s > 0 && from_stray_s <= config_.max_step_s;
  strays_ = agrees ? strays_ + 1 : 1;
  stray_ns_ = stamp_ns;
  return strays_ < config_.confirmations ? Verdict::kStray : Accept(stamp_ns);
}

StampGate::Verdict StampGate::Accept(std::int64_t stamp_ns) {
  const bool goes_back = newest_ns_ && stamp_ns < *newest_ns_;
  newest_ns_ = stamp_ns;
  strays_ = 0;
  return goes_back ? Verdict::kRestarted : Verdict::kAccepted;
}

void StampGate::Reset() {
  newest_ns_.reset();
  strays_ = 0;
}

bool ClockWatch::HasGoneBack(std::int64_t now_ns) {
  if (now_ns <= 0) return false;
  const bool back = IsSetBack(now_ns, last_ns_);
  last_ns_ = now_ns;
  return back;
}

}  // namespace livemap
