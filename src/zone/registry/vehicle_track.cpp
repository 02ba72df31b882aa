#include "zone/registry/vehicle_track.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>

#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr double kStepM = 5;        // Between looks along a straight piece of way.
constexpr double kMaxSteps = 1000;  // A track from outside may jump.
constexpr double kMinTravelM = 2;   // Less says nothing of the direction.
constexpr double kCourseWindowS = 5;
constexpr double kMinCourseMps = 1.5;  // The course of a slower vehicle is noise.

struct Look {
  Eigen::Vector2d offset_m;  // From the vehicle to the place, east and north.
  double course_rad;         // NaN: it may look anywhere.
};

bool TrackPointSees(const Look& look, const SightRule& rule) {
  const double distance_m = look.offset_m.norm();
  if (distance_m <= rule.position_slack_m) return true;
  if (!(distance_m <= rule.range_m + rule.position_slack_m)) return false;
  if (std::isnan(look.course_rad)) return true;
  const Eigen::Vector2d ahead(std::sin(look.course_rad), std::cos(look.course_rad));
  const double cosine = std::clamp(ahead.dot(look.offset_m) / distance_m, -1.0, 1.0);
  const double slack_rad = std::asin(rule.position_slack_m / distance_m);
  return std::acos(cosine) <= rule.half_angle_rad + slack_rad;
}

/// The way from `a` to `b`, as far as it lies within `from_s` and `to_s` of the track's time.
bool SeesBetweenTrackPoints(const TrackPoint& a, const TrackPoint& b, const Eigen::Vector2d& a_m,
                            const Eigen::Vector2d& b_m, double begin, double end,
                            const SightRule& rule) {
  const Eigen::Vector2d travel_m = b_m - a_m;
  const double length_m = travel_m.norm();
  const bool moved = length_m > kMinTravelM;
  const double course_rad = moved ? std::atan2(travel_m.x(), travel_m.y())
                                  : (std::isnan(a.course_rad) ? b.course_rad : a.course_rad);
  const double steps = std::clamp(std::ceil(length_m * (end - begin) / kStepM), 1.0, kMaxSteps);
  for (double i = 0; i <= steps; i += 1) {
    const Eigen::Vector2d at_m = a_m + travel_m * (begin + (end - begin) * i / steps);
    if (TrackPointSees({-at_m, course_rad}, rule)) return true;
  }
  return false;
}

constexpr double kTrailM = 300;  // Before and behind the place.
constexpr double kShortestTrailM = 30;
constexpr double kHiddenM = 100;  // Where a drive begins or ends.
constexpr double kPassM = 60;     // From where a vehicle sees what it then passes.
constexpr double kPassWindowS = 30;
constexpr double kMaxTrailGapM = 100;  // Between two places of one way.

using Places = std::vector<Eigen::Vector2d>;

/// The first of the places after `length_m` of way.
Places::iterator AfterWay(Places& places, double length_m) {
  double sum_m = 0;
  for (auto place = places.begin(); place != places.end(); ++place) {
    if (place != places.begin()) sum_m += (*place - *std::prev(place)).norm();
    if (sum_m >= length_m) return place;
  }
  return places.end();
}

/// The way from the track's point `from` on, in steps of `step`, up to kTrailM; the first place is
/// that of `from`. `ends`: the track ends before, standing.
Places WayAlong(const std::vector<TrackPoint>& track, const geo::LocalFrame& frame,
                std::size_t from, std::ptrdiff_t step, bool& ends) {
  Places places{frame.ToEnu(track[from].position)};
  double length_m = 0;
  auto at = static_cast<std::ptrdiff_t>(from);
  for (;;) {
    at += step;
    if (at < 0 || at >= static_cast<std::ptrdiff_t>(track.size())) break;
    const TrackPoint& point = track[static_cast<std::size_t>(at)];
    if (!geo::IsValid(point.position)) return places;
    const Eigen::Vector2d place_m = frame.ToEnu(point.position);
    const double way_m = (place_m - places.back()).norm();
    if (!(way_m < kMaxTrailGapM)) return places;
    if (way_m < kMinTravelM) continue;
    places.push_back(place_m);
    length_m += way_m;
    if (length_m >= kTrailM) return places;
  }
  const TrackPoint& last = step < 0 ? track.front() : track.back();
  ends = !(last.speed_mps >= kMinCourseMps);
  return places;
}

}  // namespace

protocol::Trail TrailPast(const std::vector<TrackPoint>& track, std::int64_t stamp_ns,
                          const geo::GeoPoint& place) {
  if (!geo::IsValid(place)) return {};
  const geo::LocalFrame frame(place);
  std::size_t nearest = track.size();
  double nearest_m = kPassM;
  for (std::size_t i = 0; i < track.size(); ++i) {
    const bool counts = geo::IsValid(track[i].position) &&
                        std::abs(Seconds(track[i].stamp_ns - stamp_ns)) <= kPassWindowS;
    const double distance_m = counts ? frame.ToEnu(track[i].position).norm() : kPassM;
    if (distance_m >= nearest_m) continue;
    nearest_m = distance_m;
    nearest = i;
  }
  if (nearest == track.size()) return {};
  bool begins_here = false;
  bool ends_here = false;
  Places places = WayAlong(track, frame, nearest, -1, begins_here);
  std::reverse(places.begin(), places.end());
  const Places after = WayAlong(track, frame, nearest, 1, ends_here);
  places.insert(places.end(), std::next(after.begin()), after.end());
  if (begins_here) places.erase(places.begin(), AfterWay(places, kHiddenM));
  if (ends_here) {
    std::reverse(places.begin(), places.end());
    places.erase(places.begin(), AfterWay(places, kHiddenM));
    std::reverse(places.begin(), places.end());
  }
  if (places.size() < 2 || AfterWay(places, kShortestTrailM) == places.end()) return {};
  protocol::Trail trail;
  for (const Eigen::Vector2d& each_m : places) trail.push_back(frame.ToGeo(each_m));
  trail = protocol::SimplifiedTrail(trail);
  return protocol::ValidTrails({trail}, place).empty() ? protocol::Trail{} : trail;
}

bool CouldSee(const std::vector<TrackPoint>& track, std::int64_t stamp_ns,
              const geo::GeoPoint& place, const SightRule& rule) {
  if (!geo::IsValid(place)) return false;
  const geo::LocalFrame frame(place);
  const auto offset_s = [&](const TrackPoint& point) { return Seconds(point.stamp_ns - stamp_ns); };
  for (std::size_t i = 0; i < track.size(); ++i) {
    const TrackPoint& point = track[i];
    if (!geo::IsValid(point.position)) continue;
    const Eigen::Vector2d at_m = frame.ToEnu(point.position);
    if (std::abs(offset_s(point)) <= rule.window_s &&
        TrackPointSees({-at_m, point.course_rad}, rule)) {
      return true;
    }
    if (i == 0 || !geo::IsValid(track[i - 1].position)) continue;
    const double from_s = offset_s(track[i - 1]);
    const double gap_s = offset_s(point) - from_s;
    if (!(gap_s > 0 && gap_s <= 2 * rule.window_s)) continue;
    // The part of this piece that lies within the window, as shares of its time.
    const double begin = std::max(0.0, (-rule.window_s - from_s) / gap_s);
    const double end = std::min(1.0, (rule.window_s - from_s) / gap_s);
    if (begin > end) continue;
    const Eigen::Vector2d before_m = frame.ToEnu(track[i - 1].position);
    if (SeesBetweenTrackPoints(track[i - 1], point, before_m, at_m, begin, end, rule)) return true;
  }
  return false;
}

double CourseAt(const std::vector<TrackPoint>& track, std::int64_t stamp_ns) {
  const TrackPoint* nearest = nullptr;
  const TrackPoint* first = nullptr;
  const TrackPoint* last = nullptr;
  for (const TrackPoint& point : track) {
    const double off_s = std::abs(Seconds(point.stamp_ns - stamp_ns));
    if (!geo::IsValid(point.position) || off_s > kCourseWindowS) continue;
    if (first == nullptr) first = &point;
    last = &point;
    const bool moves = std::isfinite(point.course_rad) && point.speed_mps >= kMinCourseMps;
    if (!moves) continue;
    if (nearest == nullptr || off_s < std::abs(Seconds(nearest->stamp_ns - stamp_ns))) {
      nearest = &point;
    }
  }
  if (nearest != nullptr) return nearest->course_rad;
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  if (first == nullptr) return kNotKnown;
  const Eigen::Vector2d travel_m = geo::LocalFrame(first->position).ToEnu(last->position);
  return travel_m.norm() > kMinTravelM ? std::atan2(travel_m.x(), travel_m.y()) : kNotKnown;
}

}  // namespace livemap::zone
