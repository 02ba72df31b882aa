#pragma once

#include <string>

#include "recordings/recorded_track.h"

namespace livemap::recordings {

/// The track points of a GPX text, version 1.0 or 1.1: all segments of all tracks. Speed (m/s) and
/// course (degrees) are taken from GPX 1.0's elements, or from extensions of any namespace whose
/// elements have these names (Garmin's TrackPointExtension 2 and those of phones). A time without
/// zone is UTC, as GPX has it. Points without a time are left out with a note; of a file whose
/// points all lack it, an Error says so. Way points and routes have no times and do not count.
/// `name` stands for the file in messages.
/// Source: topografix.com/GPX/1/0/gpx.xsd and GPX/1/1/gpx.xsd.
///
/// Throws Error naming `name`, the line, the value and what is accepted: XML that is none or
/// declares a DOCTYPE, another root than gpx, a coordinate, time, speed or course that is none.
RecordedTrack ParseGpx(const std::string& text, const std::string& name);

/// The same of a file of at most 256 MiB.
RecordedTrack ReadGpx(const std::string& path);

}  // namespace livemap::recordings
