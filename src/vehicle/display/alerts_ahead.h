#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "geo/wgs84.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::vehicle {

/// The alerts that stand, with how far ahead each is now. An alert comes once per approach; from
/// then on its distance falls by the way that the vehicle drives. Between two positions the speed
/// carries it on. Deterministic. Not thread-safe.
///
/// Typical usage: Take alerts and Move as they come; At for what to show.
class AlertsAhead {
 public:
  struct Config {
    std::size_t max_alerts = 100;  ///< Kept; beyond it the furthest is dropped.
    double step_m = 3;             ///< Shorter ways are the receiver's scatter.
    double max_step_m = 150;       ///< Longer ones are jumps: they are no way.
    double stands_after_s = 1.5;   ///< Without a step for so long it stands.
    double behind_m = 30;          ///< An alert that nobody ended is dropped so far behind.
  };

  explicit AlertsAhead(const Config& config) : config_(config) {}

  /// Any alert, at `now_s` of a clock that never goes back.
  void Take(const HazardAlert& alert, double now_s);
  /// Where the vehicle is.
  void Move(const geo::GeoPoint& position, double now_s);
  /// What is ahead at `now_s`, with distance and time as they are then, the nearest first.
  std::vector<HazardAlert> At(double now_s) const;
  /// None before the vehicle's speed is known.
  std::optional<double> speed_mps() const { return speed_mps_; }

 private:
  struct Standing {
    HazardAlert alert;
    double driven_m;  ///< When it came.
  };

  /// The way since the start, at `now_s`.
  double DrivenM(double now_s) const;

  Config config_;
  std::vector<Standing> standing_;
  std::optional<geo::GeoPoint> last_place_;
  double last_s_ = 0;    ///< When it was there.
  double driven_m_ = 0;  ///< Until there.
  std::optional<double> speed_mps_;
};

}  // namespace livemap::vehicle
