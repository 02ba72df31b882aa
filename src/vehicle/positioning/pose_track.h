#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "vehicle/positioning/fix_track.h"

namespace livemap::vehicle {

/// The recent poses of base_link as the fusion of fixes and odometry has them: answers where the
/// vehicle was and which way it looked at the moment of an image. A pose is interpolated between
/// two, never carried on. Not thread-safe.
class PoseTrack {
 public:
  struct Config {
    /// Two poses further apart are not interpolated, s.
    double max_gap_s = 0.5;
    /// A stamp that goes back by more than this begins the track anew, s.
    double set_back_s = 1.0;
    /// How long poses are kept, s.
    double keep_s = 30.0;
  };

  explicit PoseTrack(const Config& config) : config_(config) {}

  /// The pose's position is that of base_link, its course the heading. False when it is refused:
  /// not finite, no position, no covariance, or not newer than the newest.
  bool Add(std::int64_t stamp_ns, const geo::TrackPose& pose);
  /// kReady, kWait (a later pose may tell) or kHopeless. Once kReady, poses that come later do not
  /// change it.
  FixTrack::Lookup At(std::int64_t stamp_ns) const;
  /// The newest pose's moment; nothing before the first.
  std::optional<std::int64_t> newest_ns() const;

 private:
  struct Point {
    std::int64_t stamp_ns;
    geo::TrackPose pose;
  };

  Config config_;
  std::deque<Point> points_;  // Ascending stamps.
};

}  // namespace livemap::vehicle
