#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "geo/wgs84.h"

namespace livemap::zone {

/// Where a vehicle was last. Never handed to other vehicles.
struct VehicleState {
  std::string vehicle_id;
  std::string drive_id;
  geo::GeoPoint position;
  double course_rad = 0;  ///< Clockwise from true north; NaN when standing.
  double speed_mps = 0;
  std::int64_t stamp_ns = 0;  ///< Of the fix, vehicle clock (UTC).
  std::int64_t heard_ns = 0;  ///< Zone clock (UTC), set by UpdateVehicle.
  double sigma_m = 0;         ///< Standard deviation of the position per axis.
  /// Age of its oldest report that waits for a receipt, s; 0: none waits. None: the vehicle does
  /// not say it.
  std::optional<double> outbox_age_s = std::nullopt;
};

}  // namespace livemap::zone
