#include "zone/desk/redirects.h"

#include <algorithm>
#include <cmath>

namespace livemap::zone {

void Redirects::Drop(std::uint64_t decision) {
  redirects_.erase(
      std::remove_if(redirects_.begin(), redirects_.end(),
                     [&](const Redirect& redirect) { return redirect.decision == decision; }),
      redirects_.end());
}

bool Redirects::IsPlaced(const Uuid& hazard) const {
  return std::any_of(redirects_.begin(), redirects_.end(), [&](const Redirect& redirect) {
    return redirect.kind == DecisionKind::kMoveHazard && redirect.hazard == hazard;
  });
}

bool Redirects::IsMergedAway(const Uuid& hazard) const {
  return std::any_of(redirects_.begin(), redirects_.end(), [&](const Redirect& redirect) {
    return redirect.kind == DecisionKind::kMergeHazard && redirect.from == hazard;
  });
}

std::optional<Uuid> Redirects::Follow(Uuid hazard,
                                      const std::function<bool(const Uuid&)>& is_there) const {
  // Each step goes to another hazard, unless the store was written by hand.
  for (std::size_t step = 0; step <= redirects_.size(); ++step) {
    if (is_there(hazard)) return hazard;
    const auto next =
        std::find_if(redirects_.begin(), redirects_.end(), [&](const Redirect& redirect) {
          return redirect.kind == DecisionKind::kMergeHazard && redirect.from == hazard;
        });
    if (next == redirects_.end()) return std::nullopt;
    hazard = next->hazard;
  }
  return std::nullopt;
}

std::optional<Uuid> Redirects::Find(const std::string& class_name, const geo::GeoPoint& position,
                                    double radius_m,
                                    const std::function<bool(const Uuid&)>& is_there) const {
  constexpr double kLeastMPerDegree = 110'000;
  std::optional<Uuid> found;
  double nearest_m = radius_m;
  for (const Redirect& redirect : redirects_) {
    const double north_deg = redirect.position.latitude_deg - position.latitude_deg;
    if (std::abs(north_deg) * kLeastMPerDegree > nearest_m) continue;
    if (redirect.class_name != class_name) continue;
    const double distance_m = geo::GeodesicDistanceM(redirect.position, position);
    if (distance_m > nearest_m) continue;
    const auto hazard = Follow(redirect.hazard, is_there);
    if (!hazard) continue;
    found = hazard;
    nearest_m = distance_m;
  }
  return found;
}

}  // namespace livemap::zone
