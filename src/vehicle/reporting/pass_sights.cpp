#include "vehicle/reporting/pass_sights.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/time.h"
#include "placement/hazard_placement.h"

namespace livemap::vehicle {
namespace {

// What noise of a box makes of a distance from image to image.
constexpr double kMostFurther = 1.25;
constexpr double kMostFurtherM = 1.0;

}  // namespace

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
    passing.range_m = image[i].sight.foot.position_m.norm();
    passing.seen_ns = std::max(passing.seen_ns, image[i].sight.stamp_ns);
  }
  return hazards;
}

std::vector<PassSights::Pair> PassSights::PossiblePairs(const std::vector<Seen>& image) const {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const placement::HazardSight& sight = image[i].sight;
    const bool is_lone = IsLone(image[i], image);
    const double gate = is_lone ? config_.lone_gate : config_.gate;
    const double reach_m = (is_lone ? config_.lone_radii : config_.gate_radii) *
                           catalogue_.Get(image[i].class_name).duplicate_radius_m;
    for (const auto& [id, passing] : passing_) {
      if (passing.class_name != image[i].class_name) continue;
      const std::optional<double> distance2 = passing.sights.Distance2(sight);
      if (!distance2 || *distance2 > gate) continue;
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

/// The vehicle drives towards what it passes: the next thing of a class, which comes into view when
/// the one before has left it, is further away.
bool PassSights::IsLone(const Seen& seen, const std::vector<Seen>& image) const {
  const auto in_image = std::count_if(image.begin(), image.end(), [&](const Seen& other) {
    return other.class_name == seen.class_name;
  });
  const double range_m = seen.sight.foot.position_m.norm();
  int lately = 0;
  bool comes_nearer = true;
  for (const auto& [id, passing] : passing_) {
    if (passing.class_name != seen.class_name) continue;
    if (std::abs(Seconds(seen.sight.stamp_ns - passing.seen_ns)) > config_.lone_s) continue;
    ++lately;
    comes_nearer = range_m <= kMostFurther * passing.range_m + kMostFurtherM;
  }
  return in_image == 1 && lately == 1 && comes_nearer;
}

PassSights::Id PassSights::Begin(const Seen& seen) {
  Passing passing{seen.class_name, placement::HazardSights(config_.sights), seen.sight.stamp_ns,
                  seen.sight.foot.position_m.norm(), false};
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
