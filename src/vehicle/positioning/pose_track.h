#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "common/stamp_gate.h"
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
    /// How long poses are kept, s.
    double keep_s = 30.0;
    /// Stamps that go back begin the track anew.
    StampGate::Config stamps;
  };

  explicit PoseTrack(const Config& config) : config_(config), stamps_(config.stamps) {}

  /// The pose's position is that of base_link, its course the heading. False when it is refused:
  /// not finite, no position, no covariance, not newer than the newest, or a stamp that fits
  /// neither the others nor the clock `now_ns` (0: not known).
  bool Add(std::int64_t stamp_ns, const geo::TrackPose& pose, std::int64_t now_ns = 0);
  /// Forgets all poses: the clock was set back.
  void Reset();
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
  StampGate stamps_;
  std::deque<Point> points_;  // Ascending stamps.
};

}  // namespace livemap::vehicle
