#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "streets/street_place.h"
#include "zone/model/hazard.h"

namespace livemap::region {

/// Numbers of JSON are exact up to here in every program that may read them (RFC 7493).
constexpr std::uint64_t kMaxZoneSequence = (std::uint64_t{1} << 53) - 1;
/// A region asks a zone for so many hazards at a time.
constexpr std::size_t kHazardsPerAnswer = 1000;
/// An answer with more bytes is none: kHazardsPerAnswer hazards have a quarter of it.
constexpr std::size_t kMaxAnswerBytes = 4 << 20;

/// One hazard as a zone tells it. Id and sequence are the zone's own; there is no picture.
struct ToldHazard {
  zone::Hazard hazard;
  streets::StreetWords words;
  /// Else it has left the map.
  bool IsThere() const { return zone::IsOnMap(hazard.state); }
};

/// What a zone answers who follows its log: `GET /api/v1/hazards?since=SEQUENCE`
/// (docs/reference/http-api.md).
struct ZoneAnswer {
  Uuid log;                         ///< Names the log (zone::MapReader::LogId).
  std::uint64_t sequence = 0;       ///< Everything up to here has been told.
  bool is_truncated = false;        ///< There is more.
  std::vector<ToldHazard> hazards;  ///< In the order of their sequence.
  std::size_t refused = 0;          ///< Hazards that are not acceptable; they are left out.
  std::string refusal;              ///< Why the first of them is not, in one sentence; or empty.
};

/// Reads the answer to the question what came after the sequence `after`. The text may be anything.
/// Throws Error that says what is wrong and what is accepted for a text that is no such answer: too
/// long, no JSON, nested too deep, with more hazards than were asked for, or with a sequence that
/// does not go on. A single hazard that no zone can have is left out and counted: impossible
/// numbers, texts that are not acceptable as a vehicle's would not be, times before 1970 or more
/// than a day after `now_ns` (UTC, ns since 1970).
ZoneAnswer ParseZoneAnswer(const std::string& text, std::uint64_t after, std::int64_t now_ns);

/// Reads a text as JSON that a zone may have written: at most kMaxAnswerBytes, and nested as deep
/// as a zone's answers are. Throws Error that says what is wrong.
nlohmann::json ParseAnswerJson(const std::string& text);

/// Reads one hazard as the GeoJSON Feature that a zone tells, as ParseZoneAnswer does. Throws Error
/// for one that is not acceptable.
ToldHazard ParseToldHazard(const std::string& text, std::int64_t now_ns);

}  // namespace livemap::region
