#pragma once

#include <string>

#include "recordings/recorded_track.h"

namespace livemap::recordings {

/// The positions of a log of NMEA 0183 sentences, of any talker: RMC (position, speed, course,
/// date), GGA (position, altitude, HDOP), GST (errors), VTG (speed, course) and ZDA (date). The
/// sentences of one time of day are one position. Years of two digits are 1980 to 2079. Positions
/// between two dates belong to the earlier one, or to the day after where the time of day goes
/// back by more than 12 hours. What stands before the "$" of a line, as loggers write it, does not
/// count. Sentences without a valid checksum, positions that the receiver itself calls invalid, and
/// positions before the first date are left out with a note.
/// Source: NMEA 0183 v4.10 as in gpsd's "NMEA Revealed".
///
/// Throws Error naming `name`, the line and what is accepted: no sentence, more corrupt sentences
/// than valid ones, no date, or a field that is none in a sentence whose checksum is valid.
RecordedTrack ParseNmea(const std::string& text, const std::string& name);

/// The same of a file of at most 256 MiB.
RecordedTrack ReadNmea(const std::string& path);

}  // namespace livemap::recordings
