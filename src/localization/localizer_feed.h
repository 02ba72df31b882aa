#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>

#include "localization/geo_localizer.h"

namespace livemap::localization {

/// One answer of the odometry.
struct OdometrySample {
  std::int64_t stamp_ns = 0;
  Eigen::Isometry3d odom_from_base = Eigen::Isometry3d::Identity();
  /// Of the motion since the sample before, see OdometryTrack::Add.
  std::optional<Eigen::Matrix3d> increment_covariance;
  bool lost = false;  ///< The pose is held: it says nothing about the motion.
};

/// Hands fixes and odometry to a GeoLocalizer in the order of their stamps, in whatever order they
/// arrive: so a replay gives the same poses again. Odometry whose stamp goes back is a replay that
/// begins again: everything but the datum is forgotten. (A fix alone is not believed so much: a
/// receiver may stamp one wrongly.) Not thread-safe.
class LocalizerFeed {
 public:
  struct Config {
    /// An odometry waits at most this long for a fix of its moment or later, and a fix for such an
    /// odometry, s of the steady clock.
    double order_wait_s = 0.15;
    /// A stamp that goes back by more than this begins anew, s.
    double set_back_s = 1.0;
  };
  /// Called when the localizer has taken an odometry.
  using OnOdometry = std::function<void(const OdometrySample&)>;
  /// Called with what became of a fix when it was handed over.
  using OnFix = std::function<void(const geo::Fix&, GeoLocalizer::FixVerdict)>;

  /// The localizer must outlive the feed.
  LocalizerFeed(const Config& config, GeoLocalizer& localizer, OnOdometry on_odometry,
                OnFix on_fix);

  void AddFix(const geo::Fix& fix, double steady_s);
  /// True when the stamp went back and everything was forgotten.
  bool AddOdometry(const OdometrySample& sample, double steady_s);
  /// Hands over what has waited long enough.
  void Advance(double steady_s);

 private:
  template <class T>
  struct Waiting {
    T what;
    double arrival_s;
  };

  bool IsSetBack(std::int64_t stamp_ns, std::int64_t newest_ns) const;
  void Hand(const geo::Fix& fix);
  void Hand(const OdometrySample& sample);
  bool HandNext(double steady_s);

  const Config config_;
  GeoLocalizer& localizer_;
  const OnOdometry on_odometry_;
  const OnFix on_fix_;
  std::deque<Waiting<geo::Fix>> fixes_;  // Ascending stamps, as the odometry.
  std::deque<Waiting<OdometrySample>> odometry_;
  std::int64_t newest_fix_ns_ = 0;
  std::int64_t newest_odometry_ns_ = 0;
};

}  // namespace livemap::localization
