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
};

/// The offset at which the receiver's motion explains the picture's best. Two things are compared:
/// the picture's turn with the receiver's, and how far the vehicle is from standing: the picture's
/// flow and the receiver's speed v, each as v / (v + 1.5 m/s), since flow tells a stop well and a
/// speed badly. Each is taken as a rising linear function of the other with unknown noise, so that
/// -2 log of the likelihood is the sum of n log(1 - r^2) over both, with the correlation r and the
/// number n of independent differences, which comes from how long these stay alike. The offset of
/// the least sum is taken on a grid of 0.05 s, and refined by a parabola, whose curvature gives the
/// standard deviation. There is none where another offset, more than 2 s away, is nearly as likely
/// (by less than 9). Stamps of `picture` are the recorder's and increase. Throws Error for a
/// `config` out of range.
ClockOffsetAnswer FindClockOffset(const std::vector<ImageMotion>& picture,
                                  const RecordedTrack& track,
                                  const ClockOffsetConfig& config = ClockOffsetConfig());

}  // namespace livemap::recordings
