#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "geo/vehicle_pose.h"

namespace livemap::odometry {

/// What tells metres on board, the best first.
enum class MetresSource { kWheels, kReceiver, kFixes, kHeight, kNone };
/// "wheels", "receiver", "fixes", "height", "none".
const char* MetresSourceName(MetresSource source);

/// The speed of a vehicle at the moments of its images, from the best of what came lately: speeds
/// of its wheels, speeds of its satellite receiver, successive fixes. Stamps are nanoseconds of one
/// clock. Not thread-safe.
class VehicleSpeed {
 public:
  struct Config {
    /// A speed further than this from the asked moment says nothing of it, s.
    double max_age_s = 0.6;
    /// How much a vehicle speeds up or brakes, m/s^2, standard deviation.
    double acceleration_mps2 = 1.0;
    /// Fixes tell a speed over so long a time, s.
    double fix_span_s = 2.0;
    /// Of a fix whose receiver states no covariance, standard deviation per axis, m.
    double default_fix_sigma_m = 3.0;
    /// A speed above this is none, m/s.
    double max_speed_mps = 100.0;
    /// A speed is never stated as more certain than this: the vehicle's camera and the antenna move
    /// a little differently, m/s.
    double min_sigma_mps = 0.05;
  };

  struct Speed {
    double mps = 0;
    double sigma_mps = 0;
    MetresSource source = MetresSource::kNone;
  };

  explicit VehicleSpeed(const Config& config) : config_(config) {}

  /// Speeds over ground, forwards or backwards, of kWheels or kReceiver. False, and nothing
  /// changed, when a number is not finite or not possible, or the stamp is not later than the last
  /// one's.
  bool AddSpeed(MetresSource source, std::int64_t stamp_ns, double mps, double sigma_mps);
  /// The same of a plausible fix (geo::IsPlausible) that the receiver has.
  bool AddFix(const geo::Fix& fix);
  void Reset();

  /// None when nothing came lately.
  std::optional<Speed> At(std::int64_t stamp_ns) const;

 private:
  struct Sample {
    std::int64_t stamp_ns;
    double mps, sigma_mps;
  };
  using Samples = std::deque<Sample>;

  std::optional<Speed> Of(const Samples& samples, MetresSource source, std::int64_t stamp_ns) const;
  void AddSpeedOfFixes();

  Config config_;
  Samples wheels_, receiver_, by_fixes_;  // Ascending stamps.
  std::deque<geo::Fix> fixes_;            // Ascending stamps, of the last fix_span_s.
};

}  // namespace livemap::odometry
