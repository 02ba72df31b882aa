#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "common/stamp_gate.h"
#include "geo/vehicle_pose.h"
#include "geo/wgs84.h"

namespace livemap::vehicle {

/// The recent fixes of one vehicle: answers where it was and which way it drove at the moment of an
/// image. A position is interpolated between two fixes or carried on a bounded time beyond the
/// newest; what is not known is not invented. The first fix alone is not believed: a track begins
/// with fixes that agree. Not thread-safe.
class FixTrack {
 public:
  struct Config {
    /// A position is carried on beyond the newest fix for at most this long, s.
    double max_extrapolation_s = 1.0;
    /// Two fixes further apart are not interpolated, s.
    double max_gap_s = 2.5;
    /// The course needs at least this much way between fixes, m.
    double min_baseline_m = 2.0;
    /// Fixes further than this from the asked moment say nothing about the course, s.
    double course_window_s = 2.0;
    /// How much one fix scatters against its neighbours at least, standard deviation per axis, m.
    /// Where the fixes themselves scatter more, that counts. The error that neighbouring fixes
    /// share does not harm the course.
    double course_noise_m = 0.5;
    /// How fast the course of a driving vehicle changes, standard deviation, rad/s.
    double turn_rate_rps = 0.15;
    /// A course less certain than this (standard deviation, rad) counts as unknown.
    double max_course_sigma_rad = 0.35;
    /// How much a driving vehicle speeds up or brakes, standard deviation, m/s^2.
    double acceleration_mps2 = 1.5;
    /// Standard deviation per axis of a fix whose receiver gives no covariance, m.
    double default_sigma_m = 3.0;
    /// A fix that would need a higher speed than this is a jump and not believed, m/s.
    double max_speed_mps = 80.0;
    /// This many fixes that agree with each other but not with the track start it anew.
    int jumps_to_restart = 3;
    /// So many fixes in succession that agree with each other begin a track.
    int fixes_to_start = 2;
    /// How long fixes are kept, s.
    double keep_s = 30.0;
    StampGate::Config stamps;
  };

  enum class Verdict {
    kAccepted,    ///< The first ones count once they agree.
    kNoFix,       ///< The receiver says that it has no fix.
    kInvalid,     ///< NaN, out of range, null island, or a covariance that is none.
    kOutOfOrder,  ///< Not newer than the newest fix.
    kJump,        ///< Impossible speed.
    kRestarted,   ///< Accepted; time went back or a jump proved true: older fixes are forgotten.
    kBadStamp,    ///< Its stamp fits neither the clock nor the other fixes.
  };

  enum class Answer {
    kReady,
    kExtrapolated,  ///< The pose is there, but a later fix would make it better.
    kWait,          ///< Not known now; a later fix may tell.
    kHopeless,      ///< No later fix can tell.
  };

  struct Lookup {
    Answer answer = Answer::kWait;
    geo::TrackPose pose;  ///< Valid for kReady and kExtrapolated.
  };

  explicit FixTrack(const Config& config);

  /// `now_ns` is the clock of the stamps; 0: it is not known.
  Verdict Add(const geo::Fix& fix, std::int64_t now_ns = 0);
  /// Forgets all fixes: the clock was set back.
  void Reset();
  /// Pose at a moment (ns, the fixes' clock). Once kReady, fixes that come later do not change it.
  Lookup At(std::int64_t stamp_ns) const;
  /// The newest accepted fix's moment; nothing before the first.
  std::optional<std::int64_t> newest_ns() const;
  /// Where the vehicle was then; course NaN when it is not known or the vehicle stands.
  std::optional<geo::TrackPose> Newest() const;
  /// The same of the oldest fix that is kept.
  std::optional<std::int64_t> oldest_ns() const;
  std::optional<geo::TrackPose> Oldest() const;

 private:
  struct Motion {
    Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  // East, north.
    double variance = 0;                                     // Per axis, m^2/s^2.
    double span_s = 0;                                       // Time between the fixes used.
  };
  struct Sample {
    double time_s;  // After the asked moment.
    Eigen::Vector2d place_m;
  };
  struct Course {
    double course_rad;
    double variance_rad2;
  };
  struct Point {
    std::int64_t stamp_ns;
    geo::GeoPoint position;
    Eigen::Matrix2d covariance_m2;
    std::optional<Course> course;  // Of the last motion up to here: a standing vehicle keeps it.
    /// Squared distance of the fix before from the line between its neighbours, per axis and as
    /// one fix's variance, m^2; none where they lie too far apart in time to tell.
    std::optional<double> scatter_m2;
  };
  using Points = std::deque<Point>;

  std::optional<Point> ToPoint(const geo::Fix& fix) const;
  geo::TrackPose PoseOf(const Point& point) const;
  bool Reachable(const Point& from, const Point& to) const;
  bool JoinSuspects(const Point& point, int wanted);
  Verdict Begin(const Point& point, bool time_went_back);
  void Append(const Point& point);
  geo::TrackPose Interpolate(const Point& before, const Point& after, std::int64_t stamp_ns) const;
  geo::TrackPose Extrapolate(const Point& last, const Motion& motion, std::int64_t stamp_ns) const;
  /// Motion at a moment by the fixes before `end`.
  std::optional<Motion> MotionAt(std::int64_t stamp_ns, const Points::const_iterator& end) const;
  std::optional<Course> StandingCourse(const Points::const_iterator& after) const;
  std::optional<double> NewestScatter() const;
  double ScatterM(const Points::const_iterator& end) const;
  double FirstScatterM(const Points::const_iterator& end) const;
  std::optional<Motion> BestLineFit(const std::vector<Sample>& samples, double noise_m) const;
  std::optional<Course> CourseOf(const Motion& motion) const;

  Config config_;
  StampGate stamps_;
  Points points_;                // Ascending stamps.
  std::vector<Point> suspects_;  // First fixes, or jumps, that agree with each other.
};

}  // namespace livemap::vehicle
