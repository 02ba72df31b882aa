#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/wgs84.h"
#include "protocol/trail.h"
#include "zone/model/hazard_state.h"

namespace livemap::zone {

/// Events say why they happened in valid UTF-8 of at most so many bytes.
constexpr std::size_t kMaxEventReasonBytes = 200;

/// One hazard of the zone.
struct Hazard {
  Uuid uuid;               ///< The zone's own id.
  std::string class_name;  ///< Valid printable UTF-8, at most 64 bytes.
  float confidence = 0;    ///< 0..1, of all sightings together.
  geo::GeoPoint position;  ///< Fused from all sightings.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Identity();  ///< East-north, of `position`.
  std::uint32_t sightings = 1;     ///< Reports merged so far, each uuid once.
  std::int64_t first_seen_ns = 0;  ///< Oldest image stamp, UTC ns since 1970.
  std::int64_t last_seen_ns = 0;   ///< Newest image stamp.
  std::int64_t updated_ns = 0;     ///< Zone clock at the last event.
  std::uint64_t sequence = 0;      ///< Of its last event.
  std::string image_sha256;        ///< 64 hex digits, or empty without a picture.
  std::string image_format;        ///< "jpeg" or "png"; empty without a picture.
  HazardState state = HazardState::kActive;
  float presence = 1;          ///< 0..1, probability at `updated_ns` that it is still there.
  std::uint32_t vehicles = 1;  ///< Distinct vehicles that speak for it.
  /// Of its last event that drivers were told; 0: they never heard of it.
  std::uint64_t announced_sequence = 0;
  /// Of a vehicle that saw it, clockwise from north: how the place is passed. NaN: not known.
  double course_rad = std::numeric_limits<double>::quiet_NaN();
  std::vector<protocol::Trail> trails{};  ///< How vehicles passed it, at most kMaxTrails.
};

/// What happened to the officials' map; as stored: the numbers never change.
enum class HazardAction { kAdded = 0, kUpdated = 1, kRemoved = 2 };

/// What changed. `hazard.sequence` is the event's, `hazard.state` the state afterwards.
struct HazardEvent {
  HazardAction action = HazardAction::kAdded;
  Hazard hazard;
  std::optional<HazardState> from;  ///< State before; none: the hazard is new.
  std::string reason;               ///< Why, valid UTF-8 of at most 200 bytes; an official's text.
  bool announced = false;           ///< Drivers are told: see DriversAction.
  /// Sequence of the newest event before this one that was announced; 0: there is none. Whoever
  /// heard of that one has missed nothing.
  std::uint64_t previous_announced = 0;
};

/// What a driver hears of a step from `from` to `to`: added when it becomes one that drivers are
/// told of, updated while it is one, removed when it no longer is; none when it never was.
inline std::optional<HazardAction> DriversAction(std::optional<HazardState> from, HazardState to) {
  const bool was_told = from && IsTold(*from);
  if (IsTold(to)) return was_told ? HazardAction::kUpdated : HazardAction::kAdded;
  return was_told ? std::optional<HazardAction>(HazardAction::kRemoved) : std::nullopt;
}

/// One line of a hazard's history, as the store keeps it.
struct StoredEvent {
  std::uint64_t sequence = 0;
  Uuid hazard;
  HazardAction action = HazardAction::kAdded;
  std::optional<HazardState> from;  ///< None: the hazard was new.
  HazardState to = HazardState::kCandidate;
  std::string reason;
  bool announced = false;
  std::int64_t at_ns = 0;  ///< Zone clock, UTC ns since 1970.
};

}  // namespace livemap::zone
