#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::recordings {

/// One position of a receiver as a file states it; what the file does not state is none.
struct RecordedPosition {
  std::int64_t stamp_ns = 0;  ///< UTC.
  geo::GeoPoint position;
  std::optional<double> altitude_m;  ///< Above the sea or the ellipsoid, as the file has it.
  std::optional<double> speed_mps;   ///< Over ground; 0 to kMaxRecordedSpeedMps.
  std::optional<double> course_deg;  ///< Over ground, clockwise from true north; 0 to 360.
  std::optional<double> sigma_m;     ///< Standard deviation along each horizontal axis; above 0.
  std::size_t line = 0;              ///< Of the file, from 1.
};

/// Faster receivers are in no vehicle on a road: what states more is refused or left out.
constexpr double kMaxRecordedSpeedMps = 150;

/// Where a receiver was and when.
struct RecordedTrack {
  std::vector<RecordedPosition> positions;  ///< At least two; their stamps increase.
  std::vector<std::string> notes;           ///< What was mended or left out, a sentence each.

  std::int64_t begin_ns() const { return positions.front().stamp_ns; }
  std::int64_t end_ns() const { return positions.back().stamp_ns; }
};

/// How many of one kind of fault a reader left out, and where the first was.
class LeftOut {
 public:
  /// `what` completes "3 ...", such as "points without a time".
  explicit LeftOut(std::string what) : what_(std::move(what)) {}
  void Count(std::size_t line) {
    if (count_++ == 0) first_line_ = line;
  }
  std::size_t count() const { return count_; }
  std::size_t first_line() const { return first_line_; }
  /// Adds a note where there was any.
  void Tell(const std::string& name, std::vector<std::string>& notes) const;

 private:
  std::string what_;
  std::size_t count_ = 0;
  std::size_t first_line_ = 0;
};

/// Puts what was read from `name` into the order of its stamps. A position that repeats the stamp
/// of another is left out when it lies within 25 m of it, and refused by both lines otherwise. A
/// note tells of lines out of order, repeated stamps, and gaps of more than 10 s. Throws Error
/// where fewer than two positions are left.
RecordedTrack OrderTrack(std::vector<RecordedPosition> positions, std::vector<std::string> notes,
                         const std::string& name);

}  // namespace livemap::recordings
