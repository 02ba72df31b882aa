#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "recordings/clock/image_motion.h"
#include "recordings/recorded_track.h"

namespace livemap::recordings {

/// How far apart the clocks of a recorder and a receiver are.
struct ClockOffset {
  double seconds = 0;  ///< To be added to the recorder's times.
  double sigma_s = 0;  ///< Standard deviation.
  /// Correlation of the picture's turn with the receiver's, and of the picture's motion with its
  /// speed, at that offset; 0 where one of the two does not vary.
  double turn_correlation = 0;
  double speed_correlation = 0;
};

/// An offset, or why none can be told.
struct ClockOffsetAnswer {
  std::optional<ClockOffset> offset;
  std::string reason;  ///< A sentence's end, such as "the vehicle neither stops nor turns".
};

struct ClockOffsetConfig {
  double search_s = 30;       ///< To both sides of no offset; 1 to 300.
  double max_sigma_s = 0.25;  ///< A less certain offset is none.
  std::uint64_t seed = 1;     ///< Of the bootstrap.
};

/// The offset at which the receiver's motion explains the picture's best: the picture's turn is
/// taken as a multiple of the receiver's turn, and its flow as a linear function of the speed, both
/// rising, and the offset is that of the largest likelihood of the two with unknown noise:
/// it minimises log(1 - r_turn^2) + log(1 - r_speed^2) over a grid of 0.05 s, refined by a
/// parabola. Its standard deviation is that of the offsets of 200 recordings drawn from pieces of
/// this one (block bootstrap; Kuensch 1989), so that it grows when another offset is nearly as
/// good. Stamps of `picture` are the recorder's and increase. Throws Error for a `config` out of
/// range.
ClockOffsetAnswer FindClockOffset(const std::vector<ImageMotion>& picture,
                                  const RecordedTrack& track,
                                  const ClockOffsetConfig& config = ClockOffsetConfig());

}  // namespace livemap::recordings
