#pragma once

#include <optional>
#include <string>

#include "recordings/recorded_track.h"

namespace livemap::recordings {

/// A table of positions (CSV): a line of column names, then a line per position. Columns are
/// separated by commas, semicolons or tabs, as the first line has it; between semicolons a comma is
/// the decimal mark. Names are read without regard to case. Known are, each by several names: time
/// (ISO 8601, or s, ms, us or ns since 1970), latitude and longitude (degrees), altitude (m), speed
/// with its unit (speed_mps, speed_kmh, speed_mph, speed_knots), course (degrees) and accuracy
/// (sigma_m: per axis; accuracy: 68 % of the radius). Other columns do not count. An empty field is
/// none; a line without time or position is left out with a note.
/// `zone_s` is how far the zone of times that state none is ahead of UTC; without it they are
/// refused. Throws Error naming `name`, the line, the value and what is accepted.
RecordedTrack ParsePositionTable(const std::string& text, std::optional<int> zone_s,
                                 const std::string& name);

/// The same of a file of at most 256 MiB.
RecordedTrack ReadPositionTable(const std::string& path, std::optional<int> zone_s);

}  // namespace livemap::recordings
