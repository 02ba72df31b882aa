#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/wgs84.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change_state.h"

namespace livemap::zone {

/// So many of its newest drives are known of each vehicle, and so many vehicles on each side.
constexpr std::size_t kMaxWitnessDrives = 4;
constexpr std::size_t kMaxWitnesses = 16;

/// One vehicle that spoke of a map change.
struct MapChangeWitness {
  std::uint64_t vehicle = 0;                              ///< VehicleKey; never 0.
  bool against = false;                                   ///< It told the opposite.
  std::uint32_t drives = 0;                               ///< Of that vehicle, each counted once.
  std::array<std::uint64_t, kMaxWitnessDrives> newest{};  ///< VehicleKey of drive ids; 0: none.
};

/// An object that came or went, fused from what vehicles told.
struct MapChangeFeature {
  Uuid uuid;               ///< The zone's own id.
  std::string class_name;  ///< As ChangeClassName has it, never "no_change".
  bool vanished = false;   ///< Else it appeared.
  MapChangeState state = MapChangeState::kProposed;
  float confidence = 0;                                         ///< 0..1, of all words together.
  geo::GeoPoint position;                                       ///< Of its foot on the road.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Identity();  ///< East-north, of `position`.
  std::uint32_t reports = 1;                                    ///< For it, each uuid once.
  std::uint32_t drives = 1;                                     ///< Distinct ones for it.
  std::int64_t first_seen_ns = 0;  ///< Oldest image stamp, UTC ns since 1970.
  std::int64_t last_seen_ns = 0;   ///< Newest image stamp of a word for it.
  std::int64_t denied_ns = 0;      ///< Newest image stamp of a word against it; 0: there is none.
  std::int64_t updated_ns = 0;     ///< Zone clock at the last event.
  std::uint64_t sequence = 0;      ///< Of its last event.
  std::vector<MapChangeWitness> witnesses;  ///< At most kMaxWitnesses on each side.

  /// Distinct vehicles for it (against it); more than kMaxWitnesses are not counted.
  std::uint32_t Vehicles(bool against = false) const {
    std::uint32_t count = 0;
    for (const MapChangeWitness& witness : witnesses) count += witness.against == against ? 1 : 0;
    return count;
  }
};

/// What happened to a map change. `feature.sequence` is the event's, `feature.state` the state
/// afterwards.
struct MapChangeEvent {
  MapChangeFeature feature;
  std::optional<MapChangeState> from;   ///< None: it is new.
  std::string reason;                   ///< Valid UTF-8 of at most 200 bytes; an official's text.
  std::uint64_t previous_sequence = 0;  ///< Of its event before; 0: there is none.

  /// What became of the map by it.
  HazardAction Action() const {
    if (!IsOpen(feature.state)) return HazardAction::kRemoved;
    return from && IsOpen(*from) ? HazardAction::kUpdated : HazardAction::kAdded;
  }
};

/// One line of a map change's history, as the store keeps it.
struct StoredMapChangeEvent {
  std::uint64_t sequence = 0;
  std::optional<MapChangeState> from;  ///< None: it was new.
  MapChangeState to = MapChangeState::kProposed;
  std::string reason;
  std::int64_t at_ns = 0;  ///< Zone clock, UTC ns since 1970.
};

/// What became of the vehicles' words since start.
struct MapChangeStatistics {
  std::uint64_t added = 0;     ///< Became a new feature.
  std::uint64_t merged = 0;    ///< Spoke for a known one.
  std::uint64_t denied = 0;    ///< Spoke against a known one.
  std::uint64_t known = 0;     ///< Committed, but nothing new: see MapChangeRegistry::Tell.
  std::uint64_t repeated = 0;  ///< Their uuid was committed before.
  std::uint64_t refused = 0;   ///< For good.
  std::uint64_t too_fast = 0;  ///< Of those, for the speed that their places would need.
  std::uint64_t not_now = 0;   ///< Beyond a vehicle's hourly cap: not answered, sent again later.
  std::array<std::size_t, kMapChangeStates> by_state{};  ///< Features, by MapChangeState.

  /// Adds what became of some reports: all counts but `by_state`.
  void Add(const MapChangeStatistics& reports) {
    added += reports.added;
    merged += reports.merged;
    denied += reports.denied;
    known += reports.known;
    repeated += reports.repeated;
    refused += reports.refused;
    too_fast += reports.too_fast;
    not_now += reports.not_now;
  }
};

}  // namespace livemap::zone
