#include "zone_life/town.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace livemap::bench {
namespace {

constexpr double kHourS = 3600;
constexpr std::size_t kJunctions = Town::kSide * Town::kSide;
constexpr double kMetresPerDegree = 111320;
const geo::GeoPoint kCorner{40.42, -79.98};

std::size_t AnyJunction(datasets::SeededRandom& random) {
  return std::min(kJunctions - 1, static_cast<std::size_t>(random.Uniform() * kJunctions));
}

/// When people drive who need not be at work: most around noon and in the evening.
double LeisureHour(datasets::SeededRandom& random) {
  return std::clamp(14.5 + 3.5 * random.Normal().x(), 6.0, 23.5);
}

}  // namespace

Town::Town() : roads_at_(kJunctions) {
  const auto add = [this](std::size_t x, std::size_t y, bool north) {
    const std::size_t from = y * kSide + x;
    const bool artery = (north ? x : y) % 4 == 0;
    roads_at_[from].push_back(roads_.size());
    roads_at_[north ? from + kSide : from + 1].push_back(roads_.size());
    roads_.push_back({from, north ? from + kSide : from + 1, north, artery});
  };
  for (std::size_t y = 0; y < kSide; ++y) {
    for (std::size_t x = 0; x < kSide; ++x) {
      if (x + 1 < kSide) add(x, y, false);
      if (y + 1 < kSide) add(x, y, true);
    }
  }
  // Floyd and Warshall, keeping the first step of each fastest way.
  std::vector<double> seconds(kJunctions * kJunctions, 1e9);
  next_.assign(kJunctions * kJunctions, 0);
  for (const Road& road : roads_) {
    const double cost = kBlockM / (road.artery ? kArteryMps : kStreetMps);
    seconds[road.from * kJunctions + road.to] = seconds[road.to * kJunctions + road.from] = cost;
    next_[road.from * kJunctions + road.to] = road.to;
    next_[road.to * kJunctions + road.from] = road.from;
  }
  for (std::size_t via = 0; via < kJunctions; ++via) {
    for (std::size_t a = 0; a < kJunctions; ++a) {
      for (std::size_t b = 0; b < kJunctions; ++b) {
        const double cost = seconds[a * kJunctions + via] + seconds[via * kJunctions + b];
        if (cost >= seconds[a * kJunctions + b] - 1e-9) continue;
        seconds[a * kJunctions + b] = cost;
        next_[a * kJunctions + b] = next_[a * kJunctions + via];
      }
    }
  }
}

std::vector<Town::Lane> Town::Route(std::size_t from, std::size_t to) const {
  std::vector<Lane> route;
  while (from != to) {
    const std::size_t step = next_[from * kJunctions + to];
    for (const std::size_t road : roads_at_[from]) {
      if (roads_[road].from == from && roads_[road].to == step) route.push_back({road, true});
      if (roads_[road].to == from && roads_[road].from == step) route.push_back({road, false});
    }
    from = step;
  }
  return route;
}

geo::GeoPoint Town::At(std::size_t road, double offset_m) const {
  const Road& r = roads_[road];
  const std::size_t column = r.from % kSide;
  const std::size_t row = r.from / kSide;
  const double east_m = kBlockM * static_cast<double>(column) + (r.north ? 0 : offset_m);
  const double north_m = kBlockM * static_cast<double>(row) + (r.north ? offset_m : 0);
  return {kCorner.latitude_deg + north_m / kMetresPerDegree,
          kCorner.longitude_deg + east_m / (kMetresPerDegree * std::cos(kCorner.latitude_deg *
                                                                        geo::kRadiansPerDegree))};
}

double Town::CourseRad(const Lane& lane) const {
  const double course_deg = roads_[lane.road].north ? 0 : 90;
  return (course_deg + (lane.forward ? 0 : 180)) * geo::kRadiansPerDegree;
}

Fleet::Fleet(const Town& town, std::size_t vehicles, datasets::SeededRandom& random)
    : town_(town), members_(vehicles) {
  for (Member& member : members_) {
    const double kind = random.Uniform();
    member.habit =
        kind < 0.7 ? Habit::kCommuter : (kind < 0.8 ? Habit::kProfessional : Habit::kOccasional);
    member.home = AnyJunction(random);
    member.work = AnyJunction(random);
  }
}

std::vector<Traversal> Fleet::Day(int day, datasets::SeededRandom& random) const {
  std::vector<Traversal> traversals;
  for (std::size_t vehicle = 0; vehicle < members_.size(); ++vehicle) {
    DriveMember(vehicle, day % 7, day * kDayS, random, traversals);
  }
  std::sort(traversals.begin(), traversals.end(),
            [](const Traversal& a, const Traversal& b) { return a.at_s < b.at_s; });
  return traversals;
}

void Fleet::DriveMember(std::size_t vehicle, int day_of_week, double midnight_s,
                        datasets::SeededRandom& random, std::vector<Traversal>& day) const {
  const Member& member = members_[vehicle];
  const auto at = [&](double hour) { return midnight_s + hour * kHourS; };
  if (member.habit == Habit::kProfessional) {
    std::size_t place = member.home;
    for (double hour = 6 + random.Uniform(); hour < 22; hour += 0.3 + 0.6 * random.Uniform()) {
      const std::size_t next = AnyJunction(random);
      Drive(vehicle, place, next, at(hour), day);
      place = next;
    }
    return;
  }
  if (member.habit == Habit::kCommuter && day_of_week < 5) {
    const double leaves = 7.6 + 0.8 * random.Normal().x();
    Drive(vehicle, member.home, member.work, at(std::clamp(leaves, 5.0, 11.0)), day);
    const double returns = 17 + 1.1 * random.Normal().x();
    Drive(vehicle, member.work, member.home, at(std::clamp(returns, 12.0, 22.0)), day);
  }
  const double outings = member.habit == Habit::kCommuter && day_of_week < 5 ? 0.4 : 1.0;
  if (random.Uniform() > outings) return;
  const std::size_t goal = AnyJunction(random);
  const double hour = LeisureHour(random);
  Drive(vehicle, member.home, goal, at(hour), day);
  Drive(vehicle, goal, member.home, at(hour + 0.7 + random.Uniform()), day);
}

void Fleet::Drive(std::size_t vehicle, std::size_t from, std::size_t to, double at_s,
                  std::vector<Traversal>& day) const {
  for (const Town::Lane& lane : town_.Route(from, to)) {
    day.push_back({at_s, vehicle, lane});
    at_s += Town::kBlockM / town_.SpeedMps(lane.road);
  }
}

}  // namespace livemap::bench
