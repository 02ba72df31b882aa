#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/map_cell.h"
#include "geo/wgs84.h"
#include "protocol/trail.h"

namespace livemap::protocol {

/// Whether a zone may tell it as the course of a vehicle that passed a hazard: -2 pi to 2 pi
/// radians; NaN where the zone knows none.
inline bool IsCourseOfPass(double course_rad) {
  return std::isnan(course_rad) || std::abs(course_rad) <= 2 * M_PI;
}

/// The zone tells vehicles what changed on its map (HazardNotice.msg without ROS).
struct Notice {
  enum class Action { kAdded, kUpdated, kRemoved, kCaughtUp };
  Action action = Action::kAdded;
  std::uint64_t sequence = 0;  ///< Of the zone's event log, strictly increasing.
  /// To everybody: of the announcement before, in `cell` where there is one; 0: there was none.
  /// With kCaughtUp: where the telling began, see HazardNotice.msg.
  std::uint64_t previous_sequence = 0;
  /// To the vehicles of this cell alone; none: to everybody, or to the addressee.
  std::optional<geo::MapCell> cell;
  std::string vehicle_id;     ///< Addressee; empty: everybody.
  Uuid hazard_uuid;           ///< Nil with kCaughtUp.
  std::int64_t stamp_ns = 0;  ///< When the zone decided, zone clock (UTC).
  std::string class_name;
  float confidence = 0;    ///< 0..1.
  geo::GeoPoint position;  ///< With kCaughtUp: the middle of what was told.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< As in Report.
  std::uint32_t sightings = 0;                              ///< Reports merged so far.
  std::int64_t first_seen_ns = 0;                           ///< Image stamp of the first report.
  std::int64_t last_seen_ns = 0;                            ///< Image stamp of the newest report.
  /// Of a vehicle that passed the hazard, clockwise from true north, as IsCourseOfPass accepts it.
  double course_rad = std::numeric_limits<double>::quiet_NaN();
  std::vector<Trail> trails{};      ///< How vehicles passed it, at most kMaxTrails.
  double radius_m = 0;              ///< kCaughtUp: around `position`.
  std::uint32_t told = 0;           ///< kCaughtUp: hazards told since the kCaughtUp before.
  std::string image_format;         ///< "jpeg", or empty when there is no picture.
  std::vector<std::uint8_t> image;  ///< Small annotated picture; may be empty.
  std::string zone;                 ///< Id of the zone that says so; empty at the zone.
};

}  // namespace livemap::protocol
