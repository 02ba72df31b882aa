#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>

#include "common/time.h"
#include "geo/wgs84.h"
#include "localization/geo_localizer.h"
#include "localization/planar.h"

namespace livemap::localization {

/// Speed and turn of a simulated vehicle after a time.
struct SimulatedMotion {
  double speed_mps = 0;
  double yaw_rate_rps = 0;
};

struct SimulatedDrive {
  geo::GeoPoint datum{48.1, 11.5};
  double length_s = 40;
  double start_yaw_rad = 0.7;
  std::function<SimulatedMotion(double)> motion = [](double) { return SimulatedMotion{10, 0}; };
  /// What the sensors do; no noise where it is 0.
  double fix_sigma_m = 0.5;
  double latency_s = 0.08;
  Eigen::Vector2d antenna_m = Eigen::Vector2d::Zero();
  double scale = 1;         ///< Reported over true way.
  double yaw_bias_rps = 0;  ///< Reported less true.
  double way_sigma_m = 0.03;
  double yaw_sigma_rad = 0.001;
  /// Error of the fix at a time besides the noise; none: there is no fix.
  std::function<std::optional<Eigen::Vector2d>(double)> fix_error = [](double) {
    return std::optional<Eigen::Vector2d>(Eigen::Vector2d::Zero());
  };
  /// Whether the odometry begins anew at the origin before this time.
  std::function<bool(double)> odometry_resets = [](double) { return false; };
  std::uint64_t seed = 1;
};

/// Normal numbers that are the same everywhere.
class TestNoise {
 public:
  explicit TestNoise(std::uint64_t seed) : state_(seed * 2654435769U + 88172645463325252U) {}
  double Uniform() {
    state_ ^= state_ << 13U;
    state_ ^= state_ >> 7U;
    state_ ^= state_ << 17U;
    return (static_cast<double>(state_ >> 11U) + 0.5) / 9007199254740992.0;
  }
  double Normal() {
    constexpr double kTwoPi = 6.28318530717958647693;
    return std::sqrt(-2 * std::log(Uniform())) * std::cos(kTwoPi * Uniform());
  }
  Eigen::Vector2d Normal2() {
    const double x = Normal();
    return {x, Normal()};
  }

 private:
  std::uint64_t state_;
};

inline Eigen::Isometry3d ToIsometry(const PlanarPose& pose) {
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.linear().topLeftCorner<2, 2>() = Rotation2(pose.yaw_rad);
  isometry.translation().head<2>() = pose.position_m;
  return isometry;
}

/// Odometry at 50 Hz, fixes at 10 Hz; `watch` sees the localizer and the true pose after each
/// odometry.
inline void Simulate(const SimulatedDrive& drive, GeoLocalizer& localizer,
                     const std::function<void(double, std::int64_t, const PlanarPose&)>& watch) {
  constexpr double kStepS = 0.02;
  constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'000;
  const geo::LocalFrame frame(drive.datum);
  TestNoise noise(drive.seed);
  PlanarPose truth;
  truth.yaw_rad = drive.start_yaw_rad;
  PlanarPose odometry;
  std::map<int, PlanarPose> history;  // By steps.
  const int steps = static_cast<int>(std::lround(drive.length_s / kStepS));
  const int lag = static_cast<int>(std::lround(drive.latency_s / kStepS));
  for (int step = 0; step <= steps; ++step) {
    const double time_s = kStepS * step;
    const std::int64_t stamp_ns = kBegin_ns + Nanoseconds(time_s);
    if (step > 0) {
      const SimulatedMotion motion = drive.motion(time_s);
      const double way_m = motion.speed_mps * kStepS;
      truth = truth * PlanarPose{{way_m, 0}, motion.yaw_rate_rps * kStepS};
      const double way_noise_m = drive.way_sigma_m * std::sqrt(std::abs(way_m));
      const double turn_rad = (motion.yaw_rate_rps + drive.yaw_bias_rps) * kStepS +
                              drive.yaw_sigma_rad * std::sqrt(kStepS) * noise.Normal();
      odometry = odometry *
                 PlanarPose{Eigen::Vector2d(way_m * drive.scale, 0) + way_noise_m * noise.Normal2(),
                            turn_rad};
      if (drive.odometry_resets(time_s)) odometry = PlanarPose{};
    }
    history[step] = truth;
    localizer.AddOdometry(stamp_ns, ToIsometry(odometry));
    if (step % 5 == 0 && step >= lag) {
      const Eigen::Vector2d error_m = drive.fix_sigma_m * noise.Normal2();
      const auto more_m = drive.fix_error(time_s);
      if (more_m) {
        const PlanarPose antenna = history[step - lag] * PlanarPose{drive.antenna_m, 0};
        geo::Fix fix;
        fix.stamp_ns = stamp_ns;
        fix.position = frame.ToGeo(antenna.position_m + error_m + *more_m);
        fix.covariance_m2 =
            std::pow(std::max(0.05, drive.fix_sigma_m), 2) * Eigen::Matrix2d::Identity();
        localizer.AddFix(fix);
      }
    }
    watch(time_s, stamp_ns, truth);
  }
}

}  // namespace livemap::localization
