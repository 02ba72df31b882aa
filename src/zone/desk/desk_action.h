#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/uuid.h"
#include "geo/wgs84.h"
#include "zone/model/decision.h"

namespace livemap::zone {

/// Bounds of what an official may do at the desk.
constexpr std::size_t kMaxTeamBytes = 64;
constexpr std::size_t kMaxOrderBytes = 200;
constexpr double kMaxMoveM = 200;
constexpr double kMaxMergeM = 100;

/// What an official does with a hazard beside saying whether it is there.
struct DeskAction {
  DecisionKind kind = DecisionKind::kComment;  ///< One of those that IsOfDesk.
  std::string text;          ///< The comment, or why; empty only where it is no comment.
  std::string team;          ///< Of an assignment; empty: nobody's any more.
  std::int64_t due_ns = 0;   ///< Of an assignment: begin of the day, UTC; 0: none.
  std::string class_name;    ///< Of a new class.
  geo::GeoPoint position{};  ///< Of a move.
  Uuid other;                ///< Of a merge: the hazard that is gone afterwards.
  std::string order;         ///< Where it IsOfOrder: which order, to whom, in words.
};

/// Who mends a hazard until when.
struct Assignment {
  Uuid hazard;
  std::string team;            ///< Acceptable text of at most kMaxTeamBytes.
  std::int64_t due_ns = 0;     ///< Begin of the day, UTC; 0: none.
  std::int64_t since_ns = 0;   ///< Zone clock.
  std::uint64_t decision = 0;  ///< Id of the decision that made it.

  /// The day is over.
  bool IsOverdue(std::int64_t now_ns) const {
    constexpr std::int64_t kDayNs = 86'400'000'000'000;
    return due_ns != 0 && now_ns >= due_ns + kDayNs;
  }
};

/// One report that was merged into a hazard, as the store keeps it; of whom is not told.
struct SightingRecord {
  std::int64_t stamp_ns = 0;  ///< Of the image.
  double confidence = 0;      ///< 0..1.
  geo::GeoPoint position{};
  std::string image_sha256;  ///< 64 hex digits, or empty without a picture.
  Uuid hazard;               ///< Into which it was merged at first.
};

}  // namespace livemap::zone
