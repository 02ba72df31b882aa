#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "imaging/rectifier.h"
#include "recordings/recorded_track.h"
#include "tools/common/command_line.h"

namespace livemap::tools {

/// The flags that recordings of all kinds share: whose positions, which camera, what zone.
std::vector<Flag> RecordingFlags();

/// The zone of times that state none, seconds ahead of UTC: --time-zone.
std::optional<int> ReadTimeZone(const CommandLine& line, const std::string& flag);

/// The track of --gpx, --nmea or --csv; none where none of them is given. Throws Error where
/// several are, and as the readers do.
std::optional<recordings::RecordedTrack> ReadTrackFlags(const CommandLine& line);

/// The track that the videos themselves hold, as exiftool reads it. Throws Error where they hold
/// none.
recordings::RecordedTrack ReadEmbeddedTrack(const std::vector<std::string>& videos,
                                            std::optional<int> zone_s);

/// The calibration of --camera, --fov or --lens for frames of that size. Throws Error where there
/// is not exactly one of them.
imaging::CameraCalibration ReadCalibrationFlags(const CommandLine& line, int width, int height);

/// The mounting of --camera, or of a camera behind a windscreen, with --camera-height-m and the
/// like.
datasets::CameraMounting ReadRecordingMounting(const CommandLine& line);

}  // namespace livemap::tools
