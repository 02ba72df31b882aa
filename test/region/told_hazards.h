#pragma once

#include <cstdint>
#include <string>

#include "common/uuid.h"
#include "region/zone_answer.h"

namespace livemap::region {

constexpr std::int64_t kNowNs = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z

inline Uuid IdOf(std::uint8_t number) {
  Uuid id;
  id.bytes[0] = 1;
  id.bytes[15] = number;
  return id;
}

/// A pothole that drivers are told of.
inline ToldHazard Told(std::uint8_t number, std::uint64_t sequence,
                       const geo::GeoPoint& position = {40.44, -79.94}) {
  ToldHazard told;
  told.hazard.uuid = IdOf(number);
  told.hazard.class_name = "pothole";
  told.hazard.confidence = 0.5F;
  told.hazard.position = position;
  told.hazard.first_seen_ns = told.hazard.last_seen_ns = told.hazard.updated_ns = kNowNs;
  told.hazard.sequence = sequence;
  told.words.street = "Forbes Ave";
  return told;
}

/// One that drivers are not told of yet.
inline ToldHazard ToldCandidate(std::uint8_t number, std::uint64_t sequence,
                                const geo::GeoPoint& position = {40.44, -79.94}) {
  ToldHazard told = Told(number, sequence, position);
  told.hazard.state = zone::HazardState::kCandidate;
  return told;
}

/// One that has left the map.
inline ToldHazard ToldGone(std::uint8_t number, std::uint64_t sequence) {
  ToldHazard told = Told(number, sequence);
  told.hazard.state = zone::HazardState::kGone;
  return told;
}

}  // namespace livemap::region
