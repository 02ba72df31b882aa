#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include "common/stamp_gate.h"
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
/// arrive: so a replay gives the same poses again. Odometry whose stamps go back is a replay that
/// begins again: everything but the datum is forgotten. One stamp that fits neither the clock nor
/// its neighbours is refused and counted (StampGate); those that prove true are not lost. Not
/// thread-safe.
class LocalizerFeed {
 public:
  struct Config {
    /// An odometry waits at most this long for a fix of its moment or later, and a fix for such an
    /// odometry, s of the steady clock.
    double order_wait_s = 0.15;
    StampGate::Config stamps;
  };
  /// Called when the localizer has taken an odometry.
  using OnOdometry = std::function<void(const OdometrySample&)>;
  /// Called with what became of a fix when it was handed over.
  using OnFix = std::function<void(const geo::Fix&, GeoLocalizer::FixVerdict)>;

  /// The localizer must outlive the feed.
  LocalizerFeed(const Config& config, GeoLocalizer& localizer, OnOdometry on_odometry,
                OnFix on_fix);

  /// `now_ns` is the clock of the stamps; 0: it is not known.
  void AddFix(const geo::Fix& fix, double steady_s, std::int64_t now_ns = 0);
  /// True when the stamps went back and everything was forgotten.
  bool AddOdometry(const OdometrySample& sample, double steady_s, std::int64_t now_ns = 0);
  /// Hands over what has waited long enough.
  void Advance(double steady_s);

  /// Stamp of the newest odometry that was believed; none before the first. One that was refused
  /// does not count: nothing is measured since it.
  const std::optional<std::int64_t>& newest_odometry_ns() const {
    return odometry_.stamps.newest_ns();
  }
  const StampGate::Counters& fix_stamps() const { return fixes_.stamps.counters(); }
  const StampGate::Counters& odometry_stamps() const { return odometry_.stamps.counters(); }

 private:
  template <class T>
  struct Waiting {
    T what;
    double arrival_s;
  };
  /// One of the two inputs.
  template <class T>
  struct Line {
    explicit Line(const StampGate::Config& config) : stamps(config) {}
    /// Takes what has come, and what waited to be confirmed by it.
    void Push(const T& what, double steady_s);

    StampGate stamps;
    std::deque<Waiting<T>> waiting;  ///< Ascending stamps.
    std::vector<T> strays;           ///< That wait to be confirmed.
    std::int64_t newest_ns = 0;      ///< 0: none, or of before time went back.
  };

  template <class T>
  StampGate::Verdict Judge(Line<T>& line, const T& what, std::int64_t now_ns);
  /// Time went back: what the other input has of before does not order anything any more.
  template <class T>
  void LeaveBehind(Line<T>& other, std::int64_t stamp_ns);
  void Hand(const geo::Fix& fix);
  void Hand(const OdometrySample& sample);
  bool HandNext(double steady_s);

  const Config config_;
  GeoLocalizer& localizer_;
  const OnOdometry on_odometry_;
  const OnFix on_fix_;
  Line<geo::Fix> fixes_;
  Line<OdometrySample> odometry_;
};

}  // namespace livemap::localization
