#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "recordings/recorded_track.h"

namespace livemap::recordings {

/// What a receiver says of the vehicle's motion at evenly spaced times.
struct ReceiverMotion {
  /// NaN in both where the track has a gap.
  struct Sample {
    double speed_mps = 0;
    double turn_radps = 0;  ///< Of the course, positive to the right; 0 while the vehicle stands.
  };
  static constexpr double kStepS = 0.1;

  std::int64_t begin_ns = 0;
  std::vector<Sample> samples;
  /// Standard deviations of the Gaussian weights by which they are smoothed.
  double speed_smoothing_s = 0;
  double turn_smoothing_s = 0;

  /// Between two samples; none outside and in gaps.
  std::optional<Sample> At(std::int64_t stamp_ns) const;
};

/// The motion of a track, by the velocities that the receiver states where it states all of them,
/// and else by its positions, which err more. Both are smoothed by polynomials that are fitted
/// around each time with weights symmetric in time, which move nothing in time: parabolas through
/// positions, lines through velocities.
ReceiverMotion MotionOf(const RecordedTrack& track);

}  // namespace livemap::recordings
