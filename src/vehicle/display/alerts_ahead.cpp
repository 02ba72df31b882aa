#include "vehicle/display/alerts_ahead.h"

#include <algorithm>

namespace livemap::vehicle {

double AlertsAhead::DrivenM(double now_s) const {
  const double since_s = std::clamp(now_s - last_s_, 0.0, config_.stands_after_s);
  return driven_m_ + speed_mps_.value_or(0) * since_s;
}

void AlertsAhead::Take(const HazardAlert& alert, double now_s) {
  standing_.erase(std::remove_if(standing_.begin(), standing_.end(),
                                 [&](const Standing& each) { return each.alert.id == alert.id; }),
                  standing_.end());
  if (alert.state != HazardAlert::State::kApproach) return;
  if (!speed_mps_ && alert.time_s > 0) {
    speed_mps_ = alert.distance_m / alert.time_s;
    last_s_ = now_s;
  }
  standing_.push_back({alert, DrivenM(now_s)});
  if (standing_.size() <= config_.max_alerts) return;
  const auto left_m = [](const Standing& each) { return each.alert.distance_m + each.driven_m; };
  standing_.erase(std::max_element(
      standing_.begin(), standing_.end(),
      [&](const Standing& a, const Standing& b) { return left_m(a) < left_m(b); }));
}

void AlertsAhead::Move(const geo::GeoPoint& position, double now_s) {
  if (!last_place_) {
    driven_m_ = DrivenM(now_s);
    last_place_ = position;
    last_s_ = now_s;
    return;
  }
  const double step_m = geo::GeodesicDistanceM(*last_place_, position);
  const double step_s = now_s - last_s_;
  if (step_m < config_.step_m) {
    if (step_s > config_.stands_after_s) {
      // What the speed carried on since the last step was not driven.
      speed_mps_ = 0;
      last_s_ = now_s;
    }
    return;
  }
  if (step_m <= config_.max_step_m && step_s > 0) {
    driven_m_ += step_m;
    speed_mps_ = step_m / step_s;
  }
  last_place_ = position;
  last_s_ = now_s;
  standing_.erase(std::remove_if(standing_.begin(), standing_.end(),
                                 [&](const Standing& each) {
                                   return driven_m_ - each.driven_m >
                                          each.alert.distance_m + config_.behind_m;
                                 }),
                  standing_.end());
}

std::vector<HazardAlert> AlertsAhead::At(double now_s) const {
  std::vector<HazardAlert> ahead;
  for (const Standing& each : standing_) {
    HazardAlert alert = each.alert;
    alert.distance_m = std::max(0.0, alert.distance_m - (DrivenM(now_s) - each.driven_m));
    const double speed_mps = speed_mps_.value_or(0);
    alert.time_s = speed_mps > 0 ? alert.distance_m / speed_mps : 0;
    ahead.push_back(alert);
  }
  std::sort(ahead.begin(), ahead.end(), [](const HazardAlert& a, const HazardAlert& b) {
    return a.distance_m != b.distance_m ? a.distance_m < b.distance_m : a.id < b.id;
  });
  return ahead;
}

}  // namespace livemap::vehicle
