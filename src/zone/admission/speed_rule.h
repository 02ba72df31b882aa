#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "geo/wgs84.h"
#include "protocol/map_change_report.h"
#include "protocol/report.h"

namespace livemap::zone {

/// How fast a vehicle can be.
struct SpeedRule {
  double max_speed_mps = 100.0;  ///< Between two places of one vehicle.
  double slack_m = 100.0;        ///< A hazard lies beside or ahead of the vehicle that reports it.
  /// After so many places in a row that agree among themselves, and more than contradict them, they
  /// are believed and those are not: one wrong fix shuts no vehicle out.
  std::uint32_t recovery_reports = 3;
};

/// A place that a vehicle told.
struct ReportedFix {
  std::int64_t stamp_ns = 0;  ///< Of the image or the fix, vehicle clock (UTC).
  geo::GeoPoint position;
  double sigma_m = 0;  ///< Standard deviation of the position, along the worst direction or more.
};

ReportedFix FixOf(const protocol::Report& report);
ReportedFix FixOf(const protocol::MapChangeReport& report);

/// A place where a vehicle was, as far as the zone believes it.
struct KnownPlace {
  ReportedFix fix;
  std::uint32_t count = 1;  ///< Accepted messages that it stands for, at about this time.
  bool is_kept = false;     ///< It came with what is committed, and is stored with it.
};

/// What the store does not have yet of a kept place.
enum class UnsavedPlace {
  kNew,      ///< The place; the store has none of this vehicle and stamp.
  kChanged,  ///< The place as it is now.
  kCounted,  ///< How many messages it stands for, and nothing else.
  kDropped   ///< That it was dropped.
};

/// Where one vehicle was: a bounded choice of its accepted places, in the order of their stamps, in
/// whatever order they came. Places that lie close together in time are kept once; the older they
/// are the wider apart they stand. A plain value: copied to try, assigned to keep.
struct ReportTrack {
  static constexpr std::size_t kMaxPlaces = 128;

  std::vector<KnownPlace> places;         ///< Ascending by stamp, none twice.
  std::optional<ReportedFix> challenger;  ///< The last one refused since one was accepted.
  std::uint32_t agreeing = 0;             ///< Refused ones in a row that agree with each other.
  std::map<std::int64_t, UnsavedPlace> unsaved;  ///< By stamp.
};

/// The speed between two fixes as far as it cannot be explained by the slack and three standard
/// deviations of each, m/s; 0 when those suffice. Order does not matter: an outbox sends urgent
/// reports before older ones.
double ImpliedSpeed(const ReportedFix& a, const ReportedFix& b, const SpeedRule& rule);

/// Takes in the next place of the vehicle. It is compared with the accepted places before and after
/// it in time, whenever it comes, so that stamps of any order draw one possible way. The implied
/// speed when the rule refuses it; none when it is accepted.
///
/// Places that are refused in a row and agree among themselves are believed in the end, and the
/// accepted ones that contradict them are dropped, when they are SpeedRule::recovery_reports and
/// more than the messages that those stand for. `is_kept`: what it comes with is committed.
std::optional<double> Challenge(ReportTrack& track, const ReportedFix& fix, const SpeedRule& rule,
                                bool is_kept = true);

/// Takes in a place as the store kept it, in any order, while the track has room: the newest are to
/// come first.
void Restore(ReportTrack& track, const KnownPlace& place);

/// Forgets the places before `stamp_ns`, except the newest of all and the newest that is kept.
void ForgetBefore(ReportTrack& track, std::int64_t stamp_ns);

/// The sentence for a sender whose place implies `speed_mps`.
std::string SpeedText(double speed_mps, const SpeedRule& rule);

}  // namespace livemap::zone
