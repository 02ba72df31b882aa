#pragma once

#include <functional>
#include <vector>

#include "recordings/clock/image_motion.h"
#include "recordings/video/clip_sequence.h"

namespace livemap::recordings {

/// The motion of the picture through a whole recording, decoded clip by clip. `progress` is called
/// with the seconds of recording that were looked at. Throws Error as VideoFile does.
std::vector<ImageMotion> MeasureMotion(const std::vector<Clip>& clips,
                                       const std::function<void(double seconds)>& progress);

}  // namespace livemap::recordings
