#include "recordings/recorded_track.h"

#include <algorithm>
#include <sstream>

#include "common/error.h"
#include "common/time.h"
#include "common/utc_text.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

constexpr double kSamePlaceM = 25;
constexpr double kGapS = 10;

/// Whether they stand in order, before they are put so.
void SortByStamp(std::vector<RecordedPosition>& positions, const std::string& name,
                 std::vector<std::string>& notes) {
  LeftOut unordered("lines with an earlier time than the line before, put in order");
  for (std::size_t i = 1; i < positions.size(); ++i) {
    if (positions[i].stamp_ns < positions[i - 1].stamp_ns) unordered.Count(positions[i].line);
  }
  unordered.Tell(name, notes);
  std::stable_sort(
      positions.begin(), positions.end(),
      [](const RecordedPosition& a, const RecordedPosition& b) { return a.stamp_ns < b.stamp_ns; });
}

void TellGaps(const RecordedTrack& track, const std::string& name,
              std::vector<std::string>& notes) {
  std::size_t gaps = 0, longest = 0;
  double longest_s = 0;
  for (std::size_t i = 1; i < track.positions.size(); ++i) {
    const double gap_s = Seconds(track.positions[i].stamp_ns - track.positions[i - 1].stamp_ns);
    if (gap_s <= kGapS) continue;
    ++gaps;
    if (gap_s > longest_s) {
      longest_s = gap_s;
      longest = i;
    }
  }
  if (gaps == 0) return;
  std::ostringstream note;
  note << "'" << name << "' has " << gaps << (gaps == 1 ? " gap" : " gaps") << " of more than "
       << kGapS << " s, the longest of " << static_cast<std::int64_t>(longest_s)
       << " s before line " << track.positions[longest].line;
  notes.push_back(note.str());
}

}  // namespace

void LeftOut::Tell(const std::string& name, std::vector<std::string>& notes) const {
  if (count_ == 0) return;
  notes.push_back("'" + name + "' has " + std::to_string(count_) + " " + what_ +
                  "; the first is line " + std::to_string(first_line_));
}

RecordedTrack OrderTrack(std::vector<RecordedPosition> positions, std::vector<std::string> notes,
                         const std::string& name) {
  RecordedTrack track;
  track.notes = std::move(notes);
  SortByStamp(positions, name, track.notes);
  LeftOut repeated("positions of a time that another has, left out");
  LeftOut nowhere(
      "positions at 0 degrees north and east, where receivers without one are, left out");
  for (const RecordedPosition& position : positions) {
    if (position.position.latitude_deg == 0 && position.position.longitude_deg == 0) {
      nowhere.Count(position.line);
      continue;
    }
    if (track.positions.empty() || position.stamp_ns != track.end_ns()) {
      track.positions.push_back(position);
      continue;
    }
    const RecordedPosition& other = track.positions.back();
    if (geo::GeodesicDistanceM(position.position, other.position) > kSamePlaceM) {
      throw Error("lines " + std::to_string(other.line) + " and " + std::to_string(position.line) +
                  " of '" + name + "' state two places at " + Rfc3339(position.stamp_ns) +
                  ", accepted is the track of one receiver");
    }
    repeated.Count(position.line);
  }
  nowhere.Tell(name, track.notes);
  repeated.Tell(name, track.notes);
  if (track.positions.size() < 2) {
    throw Error("'" + name + "' has " + std::to_string(track.positions.size()) +
                " positions with a time, accepted are two or more");
  }
  TellGaps(track, name, track.notes);
  return track;
}

}  // namespace livemap::recordings
