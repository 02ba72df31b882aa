#include "vehicle/reporting/pass_sights.h"

#include <algorithm>

#include "common/time.h"
#include "placement/hazard_placement.h"

namespace livemap::vehicle {

std::vector<PassSights::Id> PassSights::Add(const std::vector<Seen>& image) {
  std::vector<Id> hazards(image.size(), 0);
  if (image.empty()) return hazards;
  ForgetPassed(image.front().sight.stamp_ns);
  std::vector<Pair> pairs = PossiblePairs(image);
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& a, const Pair& b) { return a.distance2 < b.distance2; });
  std::vector<Id> taken;
  for (const Pair& pair : pairs) {
    if (hazards[pair.sight] != 0) continue;
    if (std::find(taken.begin(), taken.end(), pair.id) != taken.end()) continue;
    hazards[pair.sight] = pair.id;
    taken.push_back(pair.id);
  }
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (hazards[i] == 0) {
      hazards[i] = Begin(image[i]);
      continue;
    }
    Passing& passing = passing_.at(hazards[i]);
    // One that tells nothing new is a sight of the hazard all the same.
    passing.sights.Add(image[i].sight);
    passing.seen_ns = std::max(passing.seen_ns, image[i].sight.stamp_ns);
  }
  return hazards;
}

std::vector<PassSights::Pair> PassSights::PossiblePairs(const std::vector<Seen>& image) const {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const placement::HazardSight& sight = image[i].sight;
    const double reach_m =
        config_.gate_radii * catalogue_.Get(image[i].class_name).duplicate_radius_m;
    for (const auto& [id, passing] : passing_) {
      if (passing.class_name != image[i].class_name) continue;
      const std::optional<double> distance2 = passing.sights.Distance2(sight);
      if (!distance2 || *distance2 > config_.gate) continue;
      const placement::PlacedHazard alone =
          placement::PlaceHazard(sight.base, Eigen::Vector2d::Zero(), sight.foot);
      const geo::GeoPoint place = passing.sights.Place()->place.position;
      if (geo::GeodesicDistanceM(alone.position, place) <= reach_m) {
        pairs.push_back({*distance2, i, id});
      }
    }
  }
  return pairs;
}

PassSights::Id PassSights::Begin(const Seen& seen) {
  Passing passing{seen.class_name, placement::HazardSights(config_.sights), seen.sight.stamp_ns,
                  false};
  if (!passing.sights.Add(seen.sight)) return 0;
  if (passing_.size() >= static_cast<std::size_t>(config_.max_hazards)) {
    passing_.erase(std::min_element(
        passing_.begin(), passing_.end(),
        [](const auto& a, const auto& b) { return a.second.seen_ns < b.second.seen_ns; }));
  }
  passing_.emplace(++last_id_, std::move(passing));
  return last_id_;
}

void PassSights::ForgetPassed(std::int64_t now_ns) {
  for (auto passing = passing_.begin(); passing != passing_.end();) {
    const bool is_passed = Seconds(now_ns - passing->second.seen_ns) > config_.keep_s;
    passing = is_passed ? passing_.erase(passing) : std::next(passing);
  }
}

std::optional<placement::SightsPlace> PassSights::Place(Id id) const {
  const auto found = passing_.find(id);
  return found == passing_.end() ? std::nullopt : found->second.sights.Place();
}

void PassSights::MarkKnown(Id id) {
  const auto found = passing_.find(id);
  if (found != passing_.end()) found->second.is_known = true;
}

bool PassSights::IsKnown(Id id) const {
  const auto found = passing_.find(id);
  return found != passing_.end() && found->second.is_known;
}

}  // namespace livemap::vehicle
