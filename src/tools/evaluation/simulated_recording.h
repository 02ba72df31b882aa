#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "recordings/clock/image_motion.h"
#include "recordings/recorded_track.h"

namespace livemap::tools {

/// A drive through a simulated street that a recorder films while a receiver of another clock
/// writes a log. A function of its seed.
struct SimulatedRecording {
  std::vector<recordings::ImageMotion> picture;  ///< By the recorder's clock.
  recordings::RecordedTrack track;               ///< By the receiver's clock.
  double offset_s = 0;                           ///< What must be added to the recorder's times.
  bool stops = false;    ///< The vehicle comes to a stand while it is filmed.
  bool turns = false;    ///< It turns by 20 degrees or more within 5 s.
  std::string receiver;  ///< In words: "GPX, 1 Hz".
};

/// `seconds` is the length of the recording. The receiver begins 25 s before the recorder and ends
/// 25 s after it, by the true clock. Drawn by the seed are street, speed, whether the driver waits
/// at crossings, light and weather, the camera's lens (66, 90 or 110 degrees) and mounting, the
/// frames' jitter, the receiver's errors, rate (1, 5 or 10 Hz) and file (NMEA with speed and
/// course, GPX with and without), and the offset within 20 s.
SimulatedRecording SimulateRecording(std::uint64_t seed, double seconds, int threads);

}  // namespace livemap::tools
