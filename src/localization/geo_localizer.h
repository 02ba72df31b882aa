#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <optional>

#include "geo/vehicle_pose.h"
#include "geo/wgs84.h"
#include "localization/datum_election.h"
#include "localization/fix_measurement.h"
#include "localization/localizer_config.h"
#include "localization/odometry_track.h"

namespace livemap::localization {

class SlidingWindow;

enum class LocalizerState {
  kUninitialised,  ///< The heading is not known yet: the vehicle has not moved enough.
  kOk,             ///< Fixes and odometry agree.
  kDeadReckoning,  ///< Odometry alone, for want of fixes that are believed.
};

/// Where the vehicle is and which way it looks.
struct FusedPose {
  LocalizerState state = LocalizerState::kUninitialised;
  geo::GeoPoint position;  ///< Of base_link; of the antenna while uninitialised.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Identity();  ///< East-north axes there.
  /// Clockwise from true north; NaN while uninitialised.
  double heading_rad = std::numeric_limits<double>::quiet_NaN();
  double heading_variance_rad2 = std::numeric_limits<double>::infinity();
  /// On the map: metres east and north of the datum, yaw from the map's x axis.
  PlanarPose map_from_base;
  /// Of map_from_base (x, y, yaw), map axes; not set while uninitialised.
  Eigen::Matrix3d map_covariance = Eigen::Matrix3d::Zero();
};

struct LatencyEstimate {
  double value_s = 0;
  double sigma_s = 0;
  /// The drive has told at least as much about it as the parameter: changes of speed.
  bool observed = false;
};

struct LocalizerCounters {
  std::uint64_t fixes_used = 0;
  std::uint64_t fixes_refused = 0;       ///< Outliers.
  std::uint64_t fixes_absent = 0;        ///< The receiver said that it has none.
  std::uint64_t fixes_invalid = 0;       ///< NaN, out of range, null island, or no covariance.
  std::uint64_t fixes_out_of_order = 0;  ///< Not newer than the newest, or older than the window.
  std::uint64_t fixes_without_odometry = 0;  ///< From a time that the odometry does not cover.
  std::uint64_t odometry_invalid = 0;
  std::uint64_t odometry_out_of_order = 0;
  std::uint64_t odometry_resets = 0;
  std::uint64_t restarts = 0;       ///< The map was fixed anew by fixes refused for long.
  std::uint64_t clock_resets = 0;   ///< Time went back by more than the window: all forgotten.
  std::uint64_t datum_changes = 0;  ///< All fixes agreed that the datum was wrong.
};

/// Fuses fixes and odometry to the vehicle's pose on the map. docs/explanation/localization.md has
/// the model. The same calls give the same answers. Not thread-safe.
class GeoLocalizer {
 public:
  enum class FixVerdict {
    kUsed,
    kRefused,
    kKept,     ///< Stored until the vehicle has moved enough to know its heading.
    kWaiting,  ///< Until the odometry reaches its moment, or until fixes agree on the datum.
    kAbsent,
    kInvalid,
    kOutOfOrder,
    kWithoutOdometry,
  };

  /// Throws Error when a parameter is out of its range.
  explicit GeoLocalizer(const LocalizerConfig& config);
  ~GeoLocalizer();
  GeoLocalizer(const GeoLocalizer&) = delete;
  GeoLocalizer& operator=(const GeoLocalizer&) = delete;

  /// See OdometryTrack::Add.
  OdometryTrack::Verdict AddOdometry(
      std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base,
      const std::optional<Eigen::Matrix3d>& increment_covariance = std::nullopt);
  /// While the odometry is lost: see OdometryTrack::AddLost. Counts as a reset.
  OdometryTrack::Verdict AddLostOdometry(std::int64_t stamp_ns,
                                         const Eigen::Isometry3d& odom_from_base);
  FixVerdict AddFix(const geo::Fix& fix);
  /// Forgets everything but the datum: the clock was set back, as by a bag that starts again.
  void Forget();

  /// The vehicle at a moment that the window or the odometry covers; none before the first fix and
  /// for other moments.
  std::optional<FusedPose> Fused(std::int64_t stamp_ns) const;
  /// Where the odometry's frame lies on the map, planar; none while uninitialised.
  std::optional<Eigen::Isometry3d> MapFromOdom() const;
  /// Of the newest odometry.
  LocalizerState state() const;
  std::optional<geo::GeoPoint> datum() const;
  LatencyEstimate latency() const;
  /// True over reported way, as estimated.
  double odometry_scale() const;
  double yaw_bias_rps() const;
  const LocalizerCounters& counters() const { return counters_; }
  /// Poses in the window.
  std::size_t window_nodes() const;
  /// How much wider than stated the fixes scatter, at least 1.
  double widening() const;

 private:
  OdometryTrack::Verdict Advance(std::int64_t stamp_ns,
                                 const std::function<OdometryTrack::Verdict()>& add);
  FixVerdict Count(FixVerdict verdict);
  void CountSecondThoughts(std::uint64_t reinstated, std::uint64_t refused);
  FixMeasurement ToMeasurement(const geo::Fix& fix) const;
  geo::ReceiverPoint ToPoint(const geo::Fix& fix) const;
  void ElectDatum(const geo::Fix& fix);
  bool IsOffMap(const geo::Fix& fix);
  FixVerdict AddWithDatum(const geo::Fix& fix);
  FixVerdict AddFirstFixes();
  std::int64_t MomentOf(const FixMeasurement& fix) const;
  FixVerdict Process(FixMeasurement fix);
  void Keep(const FixMeasurement& fix, double keep_s);
  FixVerdict Refuse(const FixMeasurement& fix);
  FixVerdict Use(const FixMeasurement& fix);
  bool TryStart();
  void ProcessWaiting();
  void KeepTrackOfTime(std::int64_t stamp_ns);
  LocalizerState StateAt(std::int64_t stamp_ns) const;
  std::optional<FusedPose> PositionOnly(std::int64_t stamp_ns) const;

  const LocalizerConfig config_;
  std::optional<geo::LocalFrame> frame_;
  OdometryTrack track_;
  const std::unique_ptr<SlidingWindow> window_;
  DatumElection first_datum_;           // Among the first fixes...
  DatumElection other_datum_;           // ...and among those too far from the datum.
  std::deque<geo::Fix> first_fixes_;    // They wait for the datum.
  std::deque<FixMeasurement> waiting_;  // For odometry.
  std::deque<FixMeasurement> kept_;     // The latest, for a start.
  std::int64_t newest_fix_ns_ = 0;
  std::int64_t last_used_ns_ = 0;
  LocalizerCounters counters_;
};

}  // namespace livemap::localization
