#pragma once

#include <cstdint>

#include "vehicle/positioning/fix_track.h"
#include "vehicle/positioning/pose_track.h"

namespace livemap::vehicle {

/// Where base_link was at the moment of an image, with patience for positions that come after the
/// image: the fused pose, else the fixes. Fixes are carried on only when none comes after the
/// image. Everything on the vehicle that places images asks this class. Not thread-safe.
///
/// Typical usage: AddFix and AddPose as they arrive; At for each waiting image in turn, until the
/// answer is not kWait.
class VehiclePoseLookup {
 public:
  /// How long an image waits, s.
  struct Patience {
    /// For its fused pose; then the fixes count. Not at all while no fused poses come: before the
    /// localisation has found its heading, or without it.
    double fused_wait_s = 1.0;
    double bracket_wait_s = 0.3;  ///< For a fix after it; then the fixes before it are carried on.
    double max_wait_s = 5.0;      ///< For any position.
  };

  struct Config : Patience {
    bool use_fused = false;    ///< Fused poses count; the fixes where those do not come.
    double antenna_x_m = 0.0;  ///< Antenna forward of base_link's origin, m.
    double antenna_y_m = 0.0;  ///< And left of it, m.
    FixTrack::Config fixes;
    PoseTrack::Config poses;
  };

  enum class Answer {
    kReady,
    kWait,      ///< Ask again later.
    kHopeless,  ///< Never known, or waited for long enough.
  };

  struct Lookup {
    Answer answer = Answer::kWait;
    geo::TrackPose base;  ///< Valid for kReady: of base_link.
    bool fused = false;   ///< Valid for kReady.
    /// Valid unless kReady: neither fix nor fused pose tells the position, nor is a fused pose due.
    bool unknown = false;
  };

  explicit VehiclePoseLookup(const Config& config);

  /// `now_ns` is the clock of the stamps; 0: it is not known.
  FixTrack::Verdict AddFix(const geo::Fix& fix, std::int64_t now_ns = 0) {
    return fixes_.Add(fix, now_ns);
  }
  /// A fused pose of base_link; false when it is refused.
  bool AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose, std::int64_t now_ns = 0) {
    return poses_.Add(stamp_ns, pose, now_ns);
  }
  /// Forgets all of both: the clock was set back.
  void Reset() {
    fixes_.Reset();
    poses_.Reset();
  }

  /// For an image of `stamp_ns` that has waited `waited_s`.
  Lookup At(std::int64_t stamp_ns, double waited_s) const {
    return At(stamp_ns, waited_s, config_);
  }
  /// The same with another patience than the configured one.
  Lookup At(std::int64_t stamp_ns, double waited_s, const Patience& patience) const;

  const FixTrack& fixes() const { return fixes_; }
  const PoseTrack& poses() const { return poses_; }

 private:
  /// Whether fused poses have come lately, so that one for this moment may be on its way.
  bool IsFusedPoseDue(std::int64_t stamp_ns) const;
  /// The antenna's pose as that of base_link.
  geo::TrackPose BaseOf(const geo::TrackPose& antenna) const;

  Config config_;
  FixTrack fixes_;
  PoseTrack poses_;
};

}  // namespace livemap::vehicle
