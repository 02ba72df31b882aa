#pragma once

#include <vector>

#include "simulation/world/street.h"

namespace livemap::simulation {

/// How a driver drives.
struct DrivingStyle {
  double speed_mps = 8;  ///< Aimed at on an open road.
  double seconds = 60;   ///< Length of the drive; before 0 and after it the speed stays.
  bool stops = false;    ///< Waits at every second crossing.
};

constexpr double kLateralMps2 = 2.0;       ///< In curves at most.
constexpr double kLongitudinalMps2 = 1.5;  ///< Of braking and pulling away at most.
constexpr double kCrossingShare = 0.8;     ///< Of the speed that is kept over a crossing.
constexpr double kStandstillS = 2.0;       ///< At a stop.
constexpr double kStopBeforeM = 10.0;      ///< The vehicle stands before a crossing's middle.

/// Where along its road a vehicle is at a time: a table that is laid once, 20 entries per second
/// of driving (0.6 MB per hour). Speed is the aim, which breathes by a tenth within 14 s of
/// driving, lower where the lane's curvature or a crossing ask for it, with bounded acceleration
/// before and after; changes of acceleration are spread over a second. Immutable.
class SpeedProfile {
 public:
  /// `start_m` is the place at time 0, with the speed that belongs there; `phase_rad` shifts the
  /// breathing. Crossings before the start do not count.
  SpeedProfile(const Street& street, const DrivingStyle& style, double start_m, double phase_rad);

  /// Metres along the road's middle line; never falls.
  double AlongM(double time_s) const;
  double SpeedMps(double time_s) const;
  /// Along the road, averaged over half a second.
  double AccelerationMps2(double time_s) const;

 private:
  /// Highest squared speed, (m/s)^2, at every step of the road.
  std::vector<double> LimitSpeeds(const Street& street, double phase_rad,
                                  std::vector<std::size_t>& stops) const;
  void LimitAtCrossings(const Street& street, double end_m, std::vector<double>& squared,
                        std::vector<std::size_t>& stops) const;
  /// Distances at equal steps of time.
  std::vector<double> Drive(const std::vector<double>& squared,
                            const std::vector<std::size_t>& stops) const;

  const DrivingStyle style_;
  const double start_m_;
  double first_m_ = 0;   ///< Where the steps of the road begin, before the start.
  double offset_s_ = 0;  ///< Time of the first entry.
  std::vector<double> along_m_;
};

}  // namespace livemap::simulation
