#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace livemap::receiver {

/// A number that gpsd did not state.
constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();

/// What gpsd says of one moment (its TPV object), as it says it: nothing here is checked, any
/// number may be NaN, infinite or absurd. Error estimates are gpsd's, whose confidence
/// ReceiverConfig::error_sigmas states. Source: gpsd_json(5).
struct ReceiverReport {
  /// gpsd's words for the kind of fix. Others than these are taken as kNone.
  enum Mode { kUnseen = 0, kNone = 1, kPlane = 2, kSpace = 3 };
  /// gpsd's words for how the fix was made.
  enum Status {
    kPlain = 1,
    kDifferential = 2,
    kRtkFixed = 3,
    kRtkFloating = 4,
    kDeadReckoning = 5,
    kSimulated = 8
  };

  std::string device;         ///< gpsd's name of the receiver, such as /dev/ttyACM0.
  int mode = kUnseen;         ///< See Mode.
  int status = 0;             ///< See Status; 0: not stated, which is a plain fix.
  std::int64_t stamp_ns = 0;  ///< Of the measurement, UTC; 0: the receiver knows no time.
  double latitude_deg = kNotStated;
  double longitude_deg = kNotStated;
  double height_m = kNotStated;          ///< Above the ellipsoid.
  double east_error_m = kNotStated;      ///< epx.
  double north_error_m = kNotStated;     ///< epy.
  double radial_error_m = kNotStated;    ///< eph, of the position in the plane.
  double up_error_m = kNotStated;        ///< epv.
  double speed_mps = kNotStated;         ///< Over ground.
  double course_deg = kNotStated;        ///< Clockwise from true north.
  double climb_mps = kNotStated;         ///< Upwards.
  double speed_error_mps = kNotStated;   ///< eps.
  double course_error_deg = kNotStated;  ///< epd.
  double climb_error_mps = kNotStated;   ///< epc.
};

}  // namespace livemap::receiver
