#pragma once

#include <cstdint>
#include <vector>

#include "geo/wgs84.h"
#include "protocol/trail.h"

namespace livemap::zone {

/// Where a vehicle was, as the zone heard it.
struct TrackPoint {
  std::int64_t stamp_ns = 0;  ///< UTC, ns since 1970.
  geo::GeoPoint position;
  double course_rad = 0;  ///< Clockwise from true north; NaN when unknown.
  double speed_mps = 0;
};

/// What a camera that looks ahead sees.
struct SightRule {
  double range_m = 60;           ///< Furthest it recognises a hazard.
  double half_angle_rad = 0.61;  ///< Of its horizontal view: 35 degrees.
  double position_slack_m = 15;  ///< Errors of the vehicle's and the hazard's positions together.
  double window_s = 10;          ///< A stamp may be off by this, and a track may have such gaps.
};

/// Whether a vehicle of this track (in order of stamps) could see `place` within `window_s` of
/// `stamp_ns`: somewhere on the track then the place lay within range and within the camera's view.
/// Between two points at most 2 * window_s apart the vehicle drove straight. False for an empty
/// track, or one that says nothing of that time.
bool CouldSee(const std::vector<TrackPoint>& track, std::int64_t stamp_ns,
              const geo::GeoPoint& place, const SightRule& rule = {});

/// In which direction a vehicle of this track drove at `stamp_ns`, clockwise from north: its course
/// at the point nearest in time where it moved, else the direction of its way within 5 s before and
/// after. NaN where the track has no point so near in time, or it stood.
double CourseAt(const std::vector<TrackPoint>& track, std::int64_t stamp_ns);

/// How a vehicle of this track passed `place`, which it saw at `stamp_ns`: up to 300 m of its way
/// before and behind the place, where it is within 60 m of the place at some time within 30 s of
/// the stamp. Where a drive began or ended nearby is nobody's business: of a way that begins or
/// ends standing the last 100 m to that place are left out. Empty where less than 30 m is left.
protocol::Trail TrailPast(const std::vector<TrackPoint>& track, std::int64_t stamp_ns,
                          const geo::GeoPoint& place);

}  // namespace livemap::zone
