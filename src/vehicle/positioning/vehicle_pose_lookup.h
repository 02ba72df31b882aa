#pragma once

#include <cstdint>

#include "vehicle/positioning/fix_track.h"
#include "vehicle/positioning/pose_track.h"

namespace livemap::vehicle {

/// Where base_link was at the moment of an image, by the tracks that HazardReporter uses and with
/// its patience: the fused pose, else the fixes, which are carried on only when none comes after
/// the image. Not thread-safe.
class VehiclePoseLookup {
 public:
  struct Config {
    bool use_fused = false;       ///< Fused poses count; the fixes where those do not come.
    double fused_wait_s = 1.0;    ///< An image waits at most this long for its fused pose, s.
    double bracket_wait_s = 0.3;  ///< And this long for a fix after it, s.
    double max_wait_s = 5.0;      ///< And for any position, s.
    double antenna_x_m = 0.0;     ///< Antenna forward of base_link's origin, m.
    double antenna_y_m = 0.0;     ///< And left of it, m.
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
  };

  explicit VehiclePoseLookup(const Config& config);

  FixTrack::Verdict AddFix(const geo::Fix& fix) { return fixes_.Add(fix); }
  /// A fused pose of base_link; false when it is refused.
  bool AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose) {
    return poses_.Add(stamp_ns, pose);
  }

  /// For an image of `stamp_ns` that has waited `waited_s`.
  Lookup At(std::int64_t stamp_ns, double waited_s) const;

 private:
  /// The antenna's pose as that of base_link.
  geo::TrackPose BaseOf(const geo::TrackPose& antenna) const;

  Config config_;
  FixTrack fixes_;
  PoseTrack poses_;
};

}  // namespace livemap::vehicle
