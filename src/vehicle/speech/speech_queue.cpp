#include "vehicle/speech/speech_queue.h"

#include <algorithm>
#include <tuple>

namespace livemap::vehicle {

bool SpeechQueue::IsBefore(const Waiting& a, const Waiting& b) {
  return std::make_tuple(a.alert.urgency, a.ReachedS(), a.alert.id) <
         std::make_tuple(b.alert.urgency, b.ReachedS(), b.alert.id);
}

bool SpeechQueue::Withdraw(const Uuid& id) {
  const auto found = std::find_if(waiting_.begin(), waiting_.end(),
                                  [&id](const Waiting& each) { return each.alert.id == id; });
  if (found == waiting_.end()) return false;
  waiting_.erase(found);
  return true;
}

bool SpeechQueue::Take(const HazardAlert& alert, double now_s) {
  const bool waited = Withdraw(alert.id);
  if (alert.state != HazardAlert::State::kApproach) {
    if (waited) ++counters_.withdrawn;
    return alert.state == HazardAlert::State::kCancelled && spoken_ == alert.id;
  }
  const Waiting newcomer{alert, now_s};
  waiting_.insert(std::upper_bound(waiting_.begin(), waiting_.end(), newcomer, IsBefore), newcomer);
  if (waiting_.size() > config_.max_waiting) {
    waiting_.pop_back();
    ++counters_.refused;
  }
  return false;
}

std::optional<HazardAlert> SpeechQueue::Next(double now_s) {
  if (spoken_) return std::nullopt;
  const auto is_late = [&](const Waiting& each) {
    return now_s - each.since_s > config_.max_wait_s ||
           (each.alert.time_s > 0 && each.ReachedS() - now_s < config_.min_left_s);
  };
  const auto late = std::remove_if(waiting_.begin(), waiting_.end(), is_late);
  counters_.late += static_cast<std::uint64_t>(waiting_.end() - late);
  waiting_.erase(late, waiting_.end());
  if (waiting_.empty()) return std::nullopt;
  const Waiting next = waiting_.front();
  waiting_.erase(waiting_.begin());
  HazardAlert alert = next.alert;
  if (alert.time_s > 0) {
    const double left = 1 - (now_s - next.since_s) / alert.time_s;
    alert.distance_m *= left;
    alert.time_s *= left;
  }
  spoken_ = alert.id;
  return alert;
}

void SpeechQueue::Finish(End end) {
  spoken_.reset();
  if (end == End::kSaid) ++counters_.said;
  if (end == End::kInterrupted) ++counters_.interrupted;
  if (end == End::kFailed) ++counters_.failed;
}

}  // namespace livemap::vehicle
