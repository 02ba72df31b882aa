#include "nodelets/stamp_gates.h"

namespace livemap::nodelets {

void StampGates::Set(const std::string& input, const StampGate::Config& config) {
  inputs_.insert_or_assign(input, Input(config));
}

StampGates::Judgement StampGates::Judge(const std::string& input, std::int64_t stamp_ns,
                                        std::int64_t now_ns, double steady_s) {
  Judgement judgement;
  judgement.begins_anew = CheckClock(now_ns, steady_s);
  Input& judged = inputs_.try_emplace(input, config_.gate).first->second;
  judgement.verdict = judged.gate.Judge(stamp_ns, now_ns);
  if (judgement.verdict == StampGate::Verdict::kRestarted &&
      judged.believed_s > reset_s_ + config_.together_s) {
    judgement.begins_anew = BeginAnew(steady_s);
  }
  if (StampGate::IsUsable(judgement.verdict)) judged.believed_s = steady_s;
  return judgement;
}

bool StampGates::CheckClock(std::int64_t now_ns, double steady_s) {
  if (!clock_.HasGoneBack(now_ns)) return false;
  for (auto& [input, judged] : inputs_) judged.gate.Reset();
  // The clock may follow the stamps.
  return steady_s > reset_s_ + config_.together_s && BeginAnew(steady_s);
}

bool StampGates::BeginAnew(double steady_s) {
  reset_s_ = steady_s;
  ++resets_;
  return true;
}

std::uint64_t StampGates::refused() const {
  std::uint64_t refused = 0;
  for (const auto& [input, judged] : inputs_) refused += judged.gate.counters().refused();
  return refused;
}

}  // namespace livemap::nodelets
