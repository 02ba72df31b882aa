#include "zone/admission/speed_rule.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace livemap::zone {
namespace {

/// Two places nearer in time than this are kept as one: at the greatest speed a vehicle gets 500 m
/// away meanwhile.
constexpr std::int64_t kSameTimeNs = 5'000'000'000;
/// Places stand the wider apart the older they are; what is younger than this is all the same.
constexpr double kRecentS = 60;

using Places = std::vector<KnownPlace>;

/// The first place after `stamp_ns`.
Places::iterator After(Places& places, std::int64_t stamp_ns) {
  return std::upper_bound(
      places.begin(), places.end(), stamp_ns,
      [](std::int64_t stamp, const KnownPlace& place) { return stamp < place.fix.stamp_ns; });
}

double SecondsBetween(const KnownPlace& a, const KnownPlace& b) {
  return 1e-9 * (static_cast<double>(b.fix.stamp_ns) - static_cast<double>(a.fix.stamp_ns));
}

/// The place at this stamp is not in the store as it is now.
void MarkChanged(ReportTrack& track, std::int64_t stamp_ns) {
  const auto unsaved = track.unsaved.find(stamp_ns);
  if (unsaved == track.unsaved.end()) {
    track.unsaved[stamp_ns] = UnsavedPlace::kNew;
  } else if (unsaved->second != UnsavedPlace::kNew) {
    unsaved->second = UnsavedPlace::kChanged;
  }
}

void Erase(ReportTrack& track, Places::iterator place) {
  const std::int64_t stamp_ns = place->fix.stamp_ns;
  const auto unsaved = track.unsaved.find(stamp_ns);
  if (unsaved != track.unsaved.end() && unsaved->second == UnsavedPlace::kNew) {
    track.unsaved.erase(unsaved);
  } else if (place->is_kept) {
    track.unsaved[stamp_ns] = UnsavedPlace::kDropped;
  }
  track.places.erase(place);
}

void Count(ReportTrack& track, KnownPlace& place, std::uint32_t count, bool is_kept) {
  constexpr std::uint32_t kMost = 1'000'000;
  place.count = std::min(kMost, place.count + std::min(count, kMost));
  // One that is new or changed is saved with its count.
  if (is_kept) track.unsaved.emplace(place.fix.stamp_ns, UnsavedPlace::kCounted);
}

/// Drops the place that says least: whose neighbours stand closest to each other, for its age.
void DropLeast(ReportTrack& track) {
  Places& places = track.places;
  std::size_t least = 1;
  double least_gap = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i + 1 < places.size(); ++i) {
    const double age_s = SecondsBetween(places[i], places.back());
    const double gap = SecondsBetween(places[i - 1], places[i + 1]) / (age_s + kRecentS);
    if (gap < least_gap) {
      least_gap = gap;
      least = i;
    }
  }
  const bool earlier_is_nearer = SecondsBetween(places[least - 1], places[least]) <
                                 SecondsBetween(places[least], places[least + 1]);
  const KnownPlace dropped = places[least];
  KnownPlace& heir = places[earlier_is_nearer ? least - 1 : least + 1];
  Count(track, heir, dropped.count, heir.is_kept && dropped.is_kept);
  Erase(track, places.begin() + static_cast<std::ptrdiff_t>(least));
}

/// Takes `place` in with one of about the same time. What is stored is a place that something
/// committed came with: where one of those meets another, its fix stands for both.
void Join(ReportTrack& track, KnownPlace& known, const KnownPlace& place) {
  if (place.is_kept && !known.is_kept) {
    known.fix = place.fix;
    known.is_kept = true;
    MarkChanged(track, known.fix.stamp_ns);
  }
  Count(track, known, place.count, place.is_kept);
}

void Insert(ReportTrack& track, const KnownPlace& place) {
  Places& places = track.places;
  const auto next = After(places, place.fix.stamp_ns);
  const auto is_near = [&](const KnownPlace& other) {
    return std::abs(SecondsBetween(place, other)) * 1e9 <= static_cast<double>(kSameTimeNs);
  };
  if (next != places.begin() && is_near(*std::prev(next))) {
    return Join(track, *std::prev(next), place);
  }
  if (next != places.end() && is_near(*next)) {
    return Join(track, *next, place);
  }
  if (place.is_kept) MarkChanged(track, place.fix.stamp_ns);
  places.insert(next, place);
  if (places.size() > ReportTrack::kMaxPlaces) DropLeast(track);
}

/// The greatest speed to the places before and after it.
double SpeedToNeighbours(Places& places, const ReportedFix& fix, const SpeedRule& rule) {
  const auto next = After(places, fix.stamp_ns);
  double speed_mps = 0;
  if (next != places.end()) speed_mps = ImpliedSpeed(next->fix, fix, rule);
  if (next == places.begin()) return speed_mps;
  return std::max(speed_mps, ImpliedSpeed(std::prev(next)->fix, fix, rule));
}

}  // namespace

ReportedFix FixOf(const protocol::Report& report) {
  // The root of the trace is never below the worst direction's standard deviation.
  return {report.stamp_ns, report.position, std::sqrt(report.covariance_m2.trace())};
}

ReportedFix FixOf(const protocol::MapChangeReport& report) {
  return {report.stamp_ns, report.position, std::sqrt(report.covariance_m2.trace())};
}

double ImpliedSpeed(const ReportedFix& a, const ReportedFix& b, const SpeedRule& rule) {
  const double explained_m = rule.slack_m + 3.0 * (a.sigma_m + b.sigma_m);
  const double unexplained_m = geo::GeodesicDistanceM(a.position, b.position) - explained_m;
  if (unexplained_m <= 0) return 0;
  const double seconds =
      std::abs(static_cast<double>(a.stamp_ns) - static_cast<double>(b.stamp_ns)) * 1e-9;
  // Half a second at least: stamps of one image may differ by rounding on the way.
  return unexplained_m / std::max(0.5, seconds);
}

std::optional<double> Challenge(ReportTrack& track, const ReportedFix& fix, const SpeedRule& rule,
                                bool is_kept) {
  const double speed_mps = SpeedToNeighbours(track.places, fix, rule);
  if (speed_mps <= rule.max_speed_mps) {
    Insert(track, {fix, 1, is_kept});
    track.challenger.reset();
    track.agreeing = 0;
    return std::nullopt;
  }
  const bool agrees =
      track.challenger && ImpliedSpeed(*track.challenger, fix, rule) <= rule.max_speed_mps;
  track.agreeing = agrees ? track.agreeing + 1 : 1;
  track.challenger = fix;
  const auto contradicts = [&](const KnownPlace& place) {
    return ImpliedSpeed(place.fix, fix, rule) > rule.max_speed_mps;
  };
  std::uint64_t against = 0;
  for (const KnownPlace& place : track.places) against += contradicts(place) ? place.count : 0U;
  if (track.agreeing < rule.recovery_reports || track.agreeing <= against) return speed_mps;
  for (std::size_t i = track.places.size(); i-- > 0;) {
    const auto place = track.places.begin() + static_cast<std::ptrdiff_t>(i);
    if (contradicts(*place)) Erase(track, place);
  }
  Insert(track, {fix, track.agreeing, is_kept});
  track.challenger.reset();
  track.agreeing = 0;
  return std::nullopt;
}

void Restore(ReportTrack& track, const KnownPlace& place) {
  const auto next = After(track.places, place.fix.stamp_ns);
  const bool is_known =
      next != track.places.begin() && std::prev(next)->fix.stamp_ns == place.fix.stamp_ns;
  if (is_known || track.places.size() >= ReportTrack::kMaxPlaces) return;
  track.places.insert(next, place);
}

void ForgetBefore(ReportTrack& track, std::int64_t stamp_ns) {
  if (track.places.empty() || track.places.front().fix.stamp_ns >= stamp_ns) return;
  const auto newest_kept = std::find_if(track.places.rbegin(), track.places.rend(),
                                        [](const KnownPlace& place) { return place.is_kept; });
  const std::int64_t kept_ns =
      newest_kept != track.places.rend() ? newest_kept->fix.stamp_ns : INT64_MAX;
  for (std::size_t i = track.places.size() - 1; i-- > 0;) {
    const auto place = track.places.begin() + static_cast<std::ptrdiff_t>(i);
    if (place->fix.stamp_ns < stamp_ns && place->fix.stamp_ns != kept_ns) Erase(track, place);
  }
}

std::string SpeedText(double speed_mps, const SpeedRule& rule) {
  return "position is reached from this vehicle's accepted places before and after it at " +
         std::to_string(speed_mps) + " m/s only, at most " + std::to_string(rule.max_speed_mps) +
         " m/s are accepted";
}

}  // namespace livemap::zone
