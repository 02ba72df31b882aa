#include "tools/evaluation/alert_traffic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "common/error.h"
#include "datasets/seeded_random.h"

namespace livemap::tools {
namespace {

constexpr double kLaneM = 3.5;
constexpr double kDegree = M_PI / 180;
constexpr double kPace = 1 / 3.6;  // From km/h to m/s.

using datasets::SeededRandom;
using Line = std::vector<Eigen::Vector2d>;

double Between(SeededRandom& random, double least, double most) {
  return least + (most - least) * random.Uniform();
}

bool Happens(SeededRandom& random, double probability) { return random.Uniform() < probability; }

/// Draws a lane metre by metre.
class Pen {
 public:
  Pen() = default;
  Pen(Eigen::Vector2d place_m, double heading_rad)
      : place_m_(std::move(place_m)), heading_rad_(heading_rad) {}

  void Straight(double length_m) { Arc(length_m, 0, 0); }

  /// A bend by `angle_rad` (counterclockwise), whose curvature comes and goes over a share of its
  /// length, as on roads that are built so.
  void Bend(double angle_rad, double radius_m, double easing = 0.5) {
    // Trapezoid of curvature: its area is the angle.
    const double length_m = std::abs(angle_rad) * radius_m / (1 - easing / 2);
    const double curvature = std::copysign(1 / radius_m, angle_rad);
    const double ease_m = easing * length_m / 2;
    Arc(ease_m, 0, curvature);
    Arc(length_m - 2 * ease_m, curvature, curvature);
    Arc(ease_m, curvature, 0);
  }

  void Arc(double length_m, double from, double to) {
    const int steps = std::max(1, static_cast<int>(std::lround(length_m)));
    const double step_m = length_m / steps;
    for (int i = 0; i < steps; ++i) {
      const double curvature = from + (to - from) * (i + 0.5) / steps;
      heading_rad_ += 0.5 * curvature * step_m;
      place_m_ += step_m * Ahead();
      heading_rad_ += 0.5 * curvature * step_m;
      line_.push_back(place_m_);
      curvatures_.push_back(curvature);
      headings_rad_.push_back(heading_rad_);
      steps_m_.push_back(step_m);
    }
  }

  /// A pen at this one's place that has drawn nothing.
  Pen Branch() const { return {place_m_, heading_rad_}; }
  /// What lies `left_m` beside what has been drawn since point `from`.
  Line Beside(double left_m, std::size_t from = 0) const {
    Line beside;
    for (std::size_t i = from; i < line_.size(); ++i) {
      beside.push_back(line_[i] + left_m * Eigen::Vector2d(-std::sin(headings_rad_[i]),
                                                           std::cos(headings_rad_[i])));
    }
    return beside;
  }

  Eigen::Vector2d Ahead() const { return {std::cos(heading_rad_), std::sin(heading_rad_)}; }
  Eigen::Vector2d Left() const { return {-std::sin(heading_rad_), std::cos(heading_rad_)}; }
  const Eigen::Vector2d& place_m() const { return place_m_; }
  double heading_rad() const { return heading_rad_; }
  const Line& line() const { return line_; }
  const std::vector<double>& curvatures() const { return curvatures_; }
  const std::vector<double>& steps_m() const { return steps_m_; }
  std::size_t size() const { return line_.size(); }
  double length_m() const {
    double sum = 0;
    for (const double step_m : steps_m_) sum += step_m;
    return sum;
  }

 private:
  Eigen::Vector2d place_m_ = Eigen::Vector2d::Zero();
  double heading_rad_ = 0;
  Line line_;
  std::vector<double> curvatures_, headings_rad_, steps_m_;
};

/// How a lane is driven, seen in the order of its points.
enum class Driven { kAlong, kAgainst };

struct Lane {
  Line line;
  Driven driven;
  bool one_way;  // No vehicle comes the other way on the lane beside it.
  bool other_level = false;
  std::vector<std::size_t> junctions{};  // Points at which vehicles also come in from the sides.
  Line before{};  // One way by which vehicles come to its first point; empty: it is not drawn.
};

struct Stop {
  std::size_t at;  // Point of the way.
  double stands_s;
};

/// Streets, the vehicle's way through them, and how it may drive.
struct Streets {
  Pen way;
  double limit_mps = 50 * kPace;
  double sideways_mps2 = 2.2;  // In bends.
  std::vector<Lane> lanes;     // All that hazards lie on, the vehicle's own included.
  std::vector<Stop> stops;
  std::vector<std::size_t> way_junctions;    // Points of the way, behind each junction.
  std::vector<TrafficStreet> mapped;         // What a map has: middles of carriageways.
  std::vector<Eigen::Vector2d> junctions_m;  // Where those meet.

  /// Of a street that is driven in both directions.
  void AddLane(Line line, Driven driven, bool other_level = false) {
    lanes.push_back({std::move(line), driven, false, other_level});
  }
  void AddOneWayLane(Line line, Driven driven) {
    lanes.push_back({std::move(line), driven, true, false});
  }
};

/// A street that goes on straight for a while, then bends a little.
void GoOn(Streets& streets, SeededRandom& random, double length_m) {
  double left_m = length_m;
  while (left_m > 0) {
    const double straight_m = std::min(left_m, Between(random, 100, 600));
    streets.way.Straight(straight_m);
    left_m -= straight_m;
    if (left_m < 150) continue;
    const double angle_rad = Between(random, -20, 20) * kDegree;
    const double radius_m = Between(random, 200, 800);
    streets.way.Bend(angle_rad, radius_m);
    left_m -= std::abs(angle_rad) * radius_m;
  }
}

void AddOwnLanes(Streets& streets) {
  streets.AddLane(streets.way.line(), Driven::kAlong);
  streets.lanes.back().junctions = streets.way_junctions;
  streets.AddLane(streets.way.Beside(kLaneM), Driven::kAgainst);
  streets.lanes.back().junctions = streets.way_junctions;
}

/// The own street as one of the map, too.
void AddOwnStreet(Streets& streets) {
  AddOwnLanes(streets);
  streets.mapped.push_back({streets.way.Beside(0.5 * kLaneM)});
}

/// A street across the way where the pen stands now, both lanes.
void AddAcross(Streets& streets, double angle_rad, double half_m, bool other_level) {
  const double heading_rad = streets.way.heading_rad() + angle_rad;
  const Eigen::Vector2d along(std::cos(heading_rad), std::sin(heading_rad));
  const Eigen::Vector2d middle_m = streets.way.place_m() + 0.5 * kLaneM * streets.way.Left();
  Pen pen(middle_m - half_m * along, heading_rad);
  pen.Straight(2 * half_m);
  streets.AddLane(pen.Beside(0.5 * kLaneM), Driven::kAgainst, other_level);
  streets.AddLane(pen.Beside(-0.5 * kLaneM), Driven::kAlong, other_level);
  if (!other_level) {
    for (std::size_t i = streets.lanes.size() - 2; i < streets.lanes.size(); ++i) {
      streets.lanes[i].junctions = {streets.lanes[i].line.size() / 2};
    }
    streets.way_junctions.push_back(streets.way.size() - 1);
  }
  TrafficStreet across{pen.line()};
  across.bridge = other_level;
  streets.mapped.push_back(std::move(across));
  if (!other_level) streets.junctions_m.push_back(middle_m);
}

Streets MakeParallelStreets(SeededRandom& random) {
  Streets streets;
  GoOn(streets, random, 6000);
  AddOwnStreet(streets);
  streets.AddLane(streets.way.Beside(15), Driven::kAlong);
  streets.AddLane(streets.way.Beside(15 + kLaneM), Driven::kAgainst);
  streets.AddLane(streets.way.Beside(-15), Driven::kAgainst);
  streets.AddLane(streets.way.Beside(-15 - kLaneM), Driven::kAlong);
  for (const double middle_m : {15.0 + 0.5 * kLaneM, -15.0 - 0.5 * kLaneM}) {
    streets.mapped.push_back({streets.way.Beside(middle_m)});
  }
  return streets;
}

Streets MakeOppositeCarriageways(SeededRandom& random) {
  Streets streets;
  streets.limit_mps = Between(random, 80, 130) * kPace;
  while (streets.way.length_m() < 15000) {
    streets.way.Straight(Between(random, 100, 1500));
    streets.way.Bend(Between(random, -40, 40) * kDegree, Between(random, 500, 1500));
  }
  streets.AddOneWayLane(streets.way.line(), Driven::kAlong);
  streets.AddOneWayLane(streets.way.Beside(kLaneM), Driven::kAlong);
  streets.mapped.push_back({streets.way.Beside(0.5 * kLaneM)});
  const double median_m = Between(random, 9, 16);
  streets.AddOneWayLane(streets.way.Beside(median_m + kLaneM), Driven::kAgainst);
  streets.AddOneWayLane(streets.way.Beside(median_m + 2 * kLaneM), Driven::kAgainst);
  Line opposite = streets.way.Beside(median_m + 1.5 * kLaneM);
  std::reverse(opposite.begin(), opposite.end());
  streets.mapped.back().one_way = true;
  streets.mapped.push_back({std::move(opposite), true});
  return streets;
}

Streets MakeCrossings(SeededRandom& random) {
  Streets streets;
  while (streets.way.length_m() < 5000) {
    GoOn(streets, random, Between(random, 60, 200));
    AddAcross(streets, Between(random, 60, 120) * kDegree, 150, false);
  }
  AddOwnStreet(streets);
  return streets;
}

Streets MakeBridges(SeededRandom& random) {
  Streets streets;
  while (streets.way.length_m() < 6000) {
    GoOn(streets, random, Between(random, 150, 500));
    AddAcross(streets, Between(random, 30, 150) * kDegree, 200, true);
  }
  AddOwnStreet(streets);
  return streets;
}

Streets MakeCurves(SeededRandom& random) {
  Streets streets;
  streets.limit_mps = 80 * kPace;
  while (streets.way.length_m() < 8000) {
    streets.way.Straight(Between(random, 20, 250));
    const double angle_rad = Between(random, 20, 90) * kDegree;
    streets.way.Bend(Happens(random, 0.5) ? angle_rad : -angle_rad, Between(random, 60, 300));
  }
  AddOwnStreet(streets);
  return streets;
}

constexpr double kRoundaboutInto = 50 * kDegree;

/// From where the pen is to the arm of a roundabout that leads `turn_rad` to the left: a bend into
/// the ring, around it, out of it.
void DriveRoundabout(Pen& pen, double turn_rad, double ring_m) {
  pen.Bend(-kRoundaboutInto, 15);
  pen.Arc((turn_rad + 2 * kRoundaboutInto) * ring_m, 1 / ring_m, 1 / ring_m);
  pen.Bend(-kRoundaboutInto, 15);
}

/// Points of a line from one to another, which comes after the last.
Line PartOf(const Line& line, std::size_t from, std::size_t to) {
  return {line.begin() + static_cast<std::ptrdiff_t>(from),
          line.begin() + static_cast<std::ptrdiff_t>(to)};
}

Line Joined(Line first, const Line& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

constexpr std::array<double, 3> kRoundaboutArmsRad{-80 * kDegree, 0, 90 * kDegree};

/// The middle of the street from one point of the pen to its end, after `start`.
Line MiddleSince(const Pen& pen, std::size_t from, const Line& start) {
  Line middle = start;
  const Line rest = pen.Beside(0.5 * kLaneM, from);
  middle.insert(middle.end(), rest.begin(), rest.end());
  return middle;
}

/// The ring as a map has it, and how one comes into it from where the pen stood; the places of its
/// exits.
std::vector<Eigen::Vector2d> MapRing(Streets& streets, const Pen& before, double ring_m) {
  Pen pen = before;
  const Eigen::Vector2d gate_m = before.place_m() + 0.5 * kLaneM * before.Left();
  pen.Bend(-kRoundaboutInto, 15);
  Line entry{gate_m};
  entry.insert(entry.end(), pen.line().begin(), pen.line().end());
  Line ring{pen.place_m()};
  std::vector<Eigen::Vector2d> exits_m;
  streets.junctions_m.push_back(gate_m);
  streets.junctions_m.push_back(pen.place_m());
  double driven_rad = 0;
  const auto drive_to = [&](double angle_rad) {
    const std::size_t from = pen.size();
    pen.Arc((angle_rad - driven_rad) * ring_m, 1 / ring_m, 1 / ring_m);
    driven_rad = angle_rad;
    ring.insert(ring.end(), pen.line().begin() + static_cast<std::ptrdiff_t>(from),
                pen.line().end());
  };
  for (const double arm_rad : kRoundaboutArmsRad) {
    drive_to(arm_rad + 2 * kRoundaboutInto);
    exits_m.push_back(pen.place_m());
    streets.junctions_m.push_back(pen.place_m());
  }
  drive_to(2 * M_PI);
  streets.mapped.push_back({std::move(entry), true, 1});
  streets.mapped.push_back({std::move(ring), true, 1, false, true});
  return exits_m;
}

/// From the ring to the arm whose bend out of the ring the pen has drawn since `from`; the gate of
/// the arm.
Eigen::Vector2d MapExit(Streets& streets, const Eigen::Vector2d& exit_m, const Pen& pen,
                        std::size_t from) {
  Eigen::Vector2d gate_m = pen.place_m() + 0.5 * kLaneM * pen.Left();
  Line exit{exit_m};
  // The ring's last points and the bend out of it.
  const Line bend = PartOf(pen.line(), from, pen.size());
  exit.insert(exit.end(), bend.begin(), bend.end());
  exit.back() = gate_m;
  streets.junctions_m.push_back(gate_m);
  streets.mapped.push_back({std::move(exit), true, 1});
  return gate_m;
}

/// Where the pen, which has driven the roundabout, began to bend out of the ring.
std::size_t BeginOfExit(const Pen& pen) {
  std::size_t at = pen.size();
  while (at > 0 && pen.curvatures()[at - 1] <= 0) --at;
  return at;
}

Streets MakeRoundabouts(SeededRandom& random) {
  Streets streets;
  Line start;
  std::size_t street_from = 0;  // Where the way's present street begins.
  while (streets.way.length_m() < 5000) {
    streets.way.Straight(Between(random, 150, 400));
    const double ring_m = Between(random, 12, 22);
    const auto taken = static_cast<std::size_t>(3 * random.Uniform());
    const Pen before = streets.way.Branch();
    streets.mapped.push_back({MiddleSince(streets.way, street_from, start)});
    const std::vector<Eigen::Vector2d> exits_m = MapRing(streets, before, ring_m);
    for (std::size_t arm = 0; arm < kRoundaboutArmsRad.size(); ++arm) {
      Pen pen = before;
      if (arm == taken) continue;
      DriveRoundabout(pen, kRoundaboutArmsRad[arm], ring_m);
      const Eigen::Vector2d gate_m = MapExit(streets, exits_m[arm], pen, BeginOfExit(pen));
      const std::size_t from = pen.size();
      pen.Straight(200);
      streets.AddLane(PartOf(pen.line(), from, pen.size()), Driven::kAlong);
      streets.lanes.back().before = Joined(streets.way.line(), PartOf(pen.line(), 0, from));
      streets.AddLane(pen.Beside(kLaneM, from), Driven::kAgainst);
      streets.mapped.push_back({MiddleSince(pen, from, {gate_m})});
    }
    DriveRoundabout(streets.way, kRoundaboutArmsRad[taken], ring_m);
    const std::size_t exit_from = BeginOfExit(streets.way);
    start = {MapExit(streets, exits_m[taken], streets.way, exit_from)};
    street_from = streets.way.size();
    streets.way_junctions.push_back(street_from - 1);
  }
  streets.way.Straight(150);
  streets.mapped.push_back({MiddleSince(streets.way, street_from, start)});
  AddOwnLanes(streets);
  return streets;
}

void TurnAtJunction(Pen& pen, double turn_rad) {
  if (turn_rad == 0) {
    pen.Straight(16);
  } else {
    pen.Bend(turn_rad, turn_rad > 0 ? 12 : 8);
  }
}

Streets MakeTurns(SeededRandom& random) {
  constexpr double kToMiddleM = 13;  // Of the junction, from where turns begin.
  Streets streets;
  const std::array<double, 3> turns_rad{0, 90 * kDegree, -90 * kDegree};
  Line start;
  std::size_t street_from = 0;  // Where the way's present street begins.
  while (streets.way.length_m() < 4000) {
    GoOn(streets, random, Between(random, 80, 250));
    const double draw = random.Uniform();
    const std::size_t taken = draw < 0.5 ? 0 : draw < 0.75 ? 1 : 2;
    const Pen before = streets.way.Branch();
    const Eigen::Vector2d middle_m =
        before.place_m() + kToMiddleM * before.Ahead() + 0.5 * kLaneM * before.Left();
    streets.junctions_m.push_back(middle_m);
    Line until = MiddleSince(streets.way, street_from, start);
    until.push_back(middle_m);
    streets.mapped.push_back({std::move(until)});
    for (std::size_t turn = 0; turn < turns_rad.size(); ++turn) {
      if (turn == taken) continue;
      Pen pen = before;
      TurnAtJunction(pen, turns_rad[turn]);
      const std::size_t from = pen.size();
      pen.Straight(200);
      streets.AddLane(pen.line(), Driven::kAlong);
      streets.lanes.back().before = streets.way.line();
      streets.AddLane(pen.Beside(kLaneM), Driven::kAgainst);
      streets.mapped.push_back({MiddleSince(pen, from, {middle_m})});
    }
    TurnAtJunction(streets.way, turns_rad[taken]);
    start = {middle_m};
    street_from = streets.way.size();
    streets.way_junctions.push_back(street_from - 1);
  }
  streets.way.Straight(100);
  streets.mapped.push_back({MiddleSince(streets.way, street_from, start)});
  AddOwnLanes(streets);
  return streets;
}

Streets MakeStops(SeededRandom& random) {
  Streets streets;
  while (streets.way.length_m() < 4000) {
    GoOn(streets, random, Between(random, 80, 300));
    if (Happens(random, 0.5)) {
      streets.stops.push_back({streets.way.size() - 9, Between(random, 5, 40)});
    }
    AddAcross(streets, Between(random, 60, 120) * kDegree, 150, false);
  }
  AddOwnStreet(streets);
  return streets;
}

using MakeStreets = std::function<Streets(SeededRandom&)>;

const std::vector<std::pair<std::string, MakeStreets>>& Makers() {
  static const std::vector<std::pair<std::string, MakeStreets>> makers{
      {"parallel", MakeParallelStreets},
      {"opposite", MakeOppositeCarriageways},
      {"crossings", MakeCrossings},
      {"bridges", MakeBridges},
      {"curves", MakeCurves},
      {"roundabouts", MakeRoundabouts},
      {"turns", MakeTurns},
      {"stops", MakeStops}};
  return makers;
}

/// Highest speeds along the way: the limit, what the bends allow, and what speeding up and braking
/// reach.
std::vector<double> SpeedsAlong(const Streets& streets, SeededRandom& random) {
  const double speeding_up = Between(random, 1.0, 2.2);
  const double braking = Between(random, 1.5, 2.8);
  const double manner = Between(random, 0.85, 1.08);  // How this driver takes limits.
  const std::vector<double>& curvatures = streets.way.curvatures();
  const std::vector<double>& steps_m = streets.way.steps_m();
  std::vector<double> speeds;
  for (const double curvature : curvatures) {
    const double bend = std::sqrt(streets.sideways_mps2 / std::max(1e-6, std::abs(curvature)));
    speeds.push_back(manner * std::min(streets.limit_mps, bend));
  }
  for (const Stop& stop : streets.stops) speeds[stop.at] = 0;
  speeds.front() = 0;
  for (std::size_t i = 1; i < speeds.size(); ++i) {
    const double before = speeds[i - 1];
    speeds[i] = std::min(speeds[i], std::sqrt(before * before + 2 * speeding_up * steps_m[i]));
  }
  for (std::size_t i = speeds.size() - 1; i-- > 0;) {
    const double after = speeds[i + 1];
    speeds[i] = std::min(speeds[i], std::sqrt(after * after + 2 * braking * steps_m[i + 1]));
  }
  return speeds;
}

/// The drive in steps of time.
std::vector<TrafficMoment> DriveAlong(const Streets& streets, SeededRandom& random) {
  const std::vector<double> speeds = SpeedsAlong(streets, random);
  const Line& line = streets.way.line();
  std::vector<TrafficMoment> moments;
  TrafficMoment at;
  double next_s = 0;
  const auto note_until = [&](double time_s, double moving_s, double speed_mps, double way_m,
                              const Eigen::Vector2d& place_m) {
    while (next_s <= time_s) {
      const double span_s = time_s - at.time_s;
      const double share = span_s > 0 ? (next_s - at.time_s) / span_s : 1;
      moments.push_back({next_s, at.moving_s + share * (moving_s - at.moving_s),
                         at.way_m + share * (way_m - at.way_m),
                         at.speed_mps + share * (speed_mps - at.speed_mps),
                         at.place_m + share * (place_m - at.place_m)});
      next_s += kTrafficStepS;
    }
    at = {time_s, moving_s, way_m, speed_mps, place_m};
  };
  at.place_m = line.front();
  auto stop = streets.stops.begin();
  note_until(3, 0, 0, 0, line.front());
  for (std::size_t i = 1; i < line.size(); ++i) {
    const double step_m = streets.way.steps_m()[i];
    const double step_s = step_m / std::max(0.3, 0.5 * (speeds[i - 1] + speeds[i]));
    note_until(at.time_s + step_s, at.moving_s + step_s, speeds[i], at.way_m + step_m, line[i]);
    if (stop != streets.stops.end() && stop->at == i) {
      note_until(at.time_s + stop->stands_s, at.moving_s, 0, at.way_m, line[i]);
      ++stop;
    }
  }
  return moments;
}

double CourseAlong(const Eigen::Vector2d& ahead) { return std::atan2(ahead.x(), ahead.y()); }

/// The course of a vehicle on the lane, driven along or against its points, that is `before_m` from
/// the place at point `at`; at the lane's end where the lane is not so long.
double CourseBefore(const Line& line, std::size_t at, Driven driven, double before_m) {
  const auto before = static_cast<std::size_t>(std::lround(before_m));
  const std::size_t last = line.size() - 1;
  if (driven == Driven::kAlong) {
    const std::size_t seen_from = std::max<std::size_t>(1, at > before ? at - before : 1);
    return CourseAlong(line[seen_from] - line[seen_from - 1]);
  }
  const std::size_t seen_from = std::min(last - 1, at + before);
  return CourseAlong(line[seen_from] - line[seen_from + 1]);
}

/// How a vehicle came to a place on a lane: points of its way in driving order. At each junction it
/// may have come from another side than the lane does.
Line TrailTo(const Lane& lane, std::size_t at, Driven driven, SeededRandom& random) {
  constexpr double kTrailM = 300;
  constexpr double kFromAsideShare = 0.3;  // At a junction.
  constexpr double kSideStreetM = 150;
  const bool along = driven == Driven::kAlong;
  const auto step = [&](std::size_t i) { return along ? i - 1 : i + 1; };
  const std::size_t end = along ? 0 : lane.line.size() - 1;
  Line backwards;
  double length_m = 0;
  const auto go_to = [&](const Eigen::Vector2d& place_m) {
    if (!backwards.empty()) length_m += (place_m - backwards.back()).norm();
    backwards.push_back(place_m);
    return length_m < kTrailM;
  };
  const auto come_from = [&](const Eigen::Vector2d& ahead, double turned_rad) {
    const double cosine = std::cos(turned_rad);
    const double sine = std::sin(turned_rad);
    const Eigen::Vector2d side(cosine * ahead.x() - sine * ahead.y(),
                               sine * ahead.x() + cosine * ahead.y());
    const Eigen::Vector2d corner_m = backwards.back();
    for (double m = 5; m < kSideStreetM && go_to(corner_m - m * side); m += 5) continue;
  };
  const auto any_side = [&](int sides) {
    return (static_cast<int>(sides * random.Uniform()) - 1) * M_PI / 2;  // -90, 90 or 0 degrees.
  };
  for (std::size_t i = at;; i = step(i)) {
    if (!go_to(lane.line[i]) || i == end) break;
    const bool is_junction =
        std::find(lane.junctions.begin(), lane.junctions.end(), i) != lane.junctions.end();
    if (is_junction && Happens(random, kFromAsideShare)) {
      const Eigen::Vector2d ahead = (lane.line[i] - lane.line[step(i)]).normalized();
      come_from(ahead, Happens(random, 0.5) ? M_PI / 2 : -M_PI / 2);
      length_m = kTrailM;
      break;
    }
  }
  if (length_m < kTrailM && along && !lane.before.empty()) {
    if (Happens(random, 1 / 3.0)) {
      for (auto place = lane.before.rbegin(); place != lane.before.rend(); ++place) {
        if (!go_to(*place)) break;
      }
    } else {
      come_from((lane.line[1] - lane.line[0]).normalized(), any_side(3));
    }
  }
  return {backwards.rbegin(), backwards.rend()};
}

/// How vehicles that see the hazards drive.
void AddCourses(const Lane& lane, std::size_t at, TrafficHazard& hazard, SeededRandom& random) {
  constexpr double kSeenFromLeastM = 8;
  constexpr double kSeenFromMostM = 25;
  const double before_m = Between(random, kSeenFromLeastM, kSeenFromMostM);
  const Driven oncoming = lane.driven == Driven::kAlong ? Driven::kAgainst : Driven::kAlong;
  hazard.course_rad = CourseBefore(lane.line, at, lane.driven, before_m);
  hazard.oncoming_course_rad = lane.one_way ? std::numeric_limits<double>::quiet_NaN()
                                            : CourseBefore(lane.line, at, oncoming, before_m);
}

/// How a vehicle that drives the lane along or against its points passes the place.
Line TrailPast(const Lane& lane, std::size_t at, Driven driven, SeededRandom& random) {
  const Driven back = driven == Driven::kAlong ? Driven::kAgainst : Driven::kAlong;
  Line trail = TrailTo(lane, at, driven, random);
  const Line after = TrailTo(lane, at, back, random);
  trail.insert(trail.end(), std::next(after.rbegin()), after.rend());
  return trail;
}

void AddTrails(const Lane& lane, std::size_t at, TrafficHazard& hazard, SeededRandom& random) {
  constexpr std::size_t kVehicles = 3;
  const Driven oncoming = lane.driven == Driven::kAlong ? Driven::kAgainst : Driven::kAlong;
  for (std::size_t i = 0; i < kVehicles; ++i) {
    hazard.trails_m.push_back(TrailPast(lane, at, lane.driven, random));
    if (!lane.one_way) hazard.oncoming_trails_m.push_back(TrailPast(lane, at, oncoming, random));
  }
}

std::vector<TrafficHazard> ScatterHazards(const Streets& streets, double per_km,
                                          SeededRandom& random, SeededRandom& sights,
                                          SeededRandom& trails) {
  constexpr double kAsideM = 0.4;
  const std::array<const char*, 3> classes{"pothole", "traffic_cone", "debris"};
  std::vector<TrafficHazard> hazards;
  for (const Lane& lane : streets.lanes) {
    double next_m = random.Exponential(1000 / per_km);
    double at_m = 0;
    for (std::size_t i = 1; i < lane.line.size(); ++i) {
      at_m += (lane.line[i] - lane.line[i - 1]).norm();
      while (next_m < at_m) {
        const auto chosen = static_cast<std::size_t>(3 * random.Uniform());
        hazards.push_back(
            {lane.line[i] + kAsideM * random.Normal(), lane.other_level, classes.at(chosen)});
        AddCourses(lane, i, hazards.back(), sights);
        AddTrails(lane, i, hazards.back(), trails);
        next_m += random.Exponential(1000 / per_km);
      }
    }
  }
  return hazards;
}

}  // namespace

const std::vector<std::string>& TrafficScenarios() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& maker : Makers()) all.push_back(maker.first);
    return all;
  }();
  return names;
}

TrafficDrive MakeTrafficDrive(const std::string& scenario, double per_km, std::uint64_t seed) {
  const auto& makers = Makers();
  const auto maker = std::find_if(makers.begin(), makers.end(),
                                  [&](const auto& each) { return each.first == scenario; });
  if (maker == makers.end()) throw Error("there is no scenario '" + scenario + "'");
  const auto number = static_cast<std::uint64_t>(std::distance(makers.begin(), maker));
  SeededRandom random(seed * 1000003 + number);
  const Streets streets = maker->second(random);
  TrafficDrive drive;
  drive.way_m = streets.way.line();
  drive.moments = DriveAlong(streets, random);
  SeededRandom sights(seed * 1000003 + number + 1000);  // So that all else stays as it was.
  SeededRandom trails(seed * 1000003 + number + 2000);
  drive.hazards = ScatterHazards(streets, per_km, random, sights, trails);
  drive.streets = streets.mapped;
  drive.junctions_m = streets.junctions_m;
  return drive;
}

}  // namespace livemap::tools
