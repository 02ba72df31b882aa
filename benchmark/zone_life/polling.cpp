#include "zone_life/polling.h"

#include "common/time.h"

namespace livemap::bench {

Polling::Polling(const PollingRule& rule) : rule_(rule) {
  config_.picture_bytes = 0;
  config_.bytes_per_hour = rule.bytes_per_hour;
  if (rule.kind != PollingRule::Kind::kWorth) return;
  config_.price_s = rule.value;
  scheduler_ = std::make_unique<zone::PollScheduler>(config_, 1);
}

void Polling::SetHazard(std::uint64_t hazard, const geo::GeoPoint& place,
                        const zone::ClassModel& entry, const zone::PresenceRecord& life,
                        bool denied, std::int64_t now_ns) {
  if (scheduler_) return scheduler_->SetHazard(hazard, place, entry, life, now_ns, now_ns);
  if (rule_.kind == PollingRule::Kind::kNobody) return;
  if (!zone::IsOnMap(life.state)) {
    timers_.erase(hazard);
    return;
  }
  const auto [found, is_new] = timers_.try_emplace(hazard);
  Timer& timer = found->second;
  timer.interval_s = rule_.value;
  if (rule_.kind == PollingRule::Kind::kLife) timer.interval_s *= entry.survival.MeanLifeS();
  if (is_new) timer.settled_ns = now_ns;
  if (denied && rule_.kind == PollingRule::Kind::kInsist) timer.settled_ns = 0;
}

std::vector<Polling::Question> Polling::Approach(std::uint64_t hazard, const std::string& vehicle,
                                                 const zone::TrackPoint& point) {
  const std::int64_t now_ns = point.stamp_ns;
  std::vector<Question> questions;
  if (scheduler_) {
    scheduler_->SetVehicle(vehicle, point);
    for (const zone::PollChoice& choice : scheduler_->TakeDue(now_ns)) {
      open_[{choice.hazard, choice.vehicle_id}] = choice.poll;
      questions.push_back({choice.hazard, choice.vehicle_id});
    }
    polls_ += questions.size();
    return questions;
  }
  const auto found = timers_.find(hazard);
  if (found == timers_.end()) return questions;
  Timer& timer = found->second;
  if (timer.open || Seconds(now_ns - timer.settled_ns) < timer.interval_s) return questions;
  const auto asked = timer.asked_ns.find(vehicle);
  if (asked != timer.asked_ns.end() &&
      Seconds(now_ns - asked->second) < config_.same_vehicle_gap_s) {
    return questions;
  }
  timer.open = true;
  timer.settled_ns = now_ns;
  timer.asked_ns[vehicle] = now_ns;
  ++polls_;
  questions.push_back({hazard, vehicle});
  return questions;
}

void Polling::Answered(std::uint64_t hazard, const std::string& vehicle, std::int64_t now_ns) {
  if (scheduler_) {
    const auto asked = open_.find({hazard, vehicle});
    if (asked == open_.end()) return;
    scheduler_->Answered(asked->second, config_.poll_bytes, now_ns);
    open_.erase(asked);
    return;
  }
  const auto found = timers_.find(hazard);
  if (found != timers_.end()) found->second.open = false;
}

double Polling::bytes() const { return static_cast<double>(polls_) * config_.poll_bytes; }

}  // namespace livemap::bench
