#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "zone/admission/report_validation.h"
#include "zone/model/hazard_state.h"
#include "zone/model/map_change.h"
#include "zone/model/store_damage.h"
#include "zone/pictures/picture_allowance.h"

namespace livemap::zone {

/// What became of the reports, vehicle positions and polls since start.
struct ZoneStatistics {
  std::uint64_t added = 0;     ///< Reports that became a new hazard.
  std::uint64_t merged = 0;    ///< Reports counted as a sighting of a known hazard.
  std::uint64_t repeated = 0;  ///< Reports whose uuid was committed before.
  std::uint64_t refused = 0;   ///< For good; all kinds together.
  /// Of those, by RefusalKind.
  std::array<std::uint64_t, kRefusalKinds> refused_by_kind{};
  /// Reports of classes that the catalogue does not name, counted under one heading.
  std::uint64_t of_unknown_class = 0;
  std::uint64_t not_now = 0;  ///< Beyond a vehicle's hourly cap: not answered, sent again later.
  std::uint64_t store_errors = 0;  ///< Batches and decisions that the store could not keep.
  std::uint64_t vehicle_positions = 0;
  std::uint64_t vehicle_positions_refused = 0;
  /// Of those, by RefusalKind.
  std::array<std::uint64_t, kRefusalKinds> positions_refused_by_kind{};
  std::uint64_t polls = 0;    ///< Asked.
  std::uint64_t answers = 0;  ///< Counted.
  std::uint64_t answers_refused =
      0;                           ///< Unknown, expired, another's, or from where nobody sees it.
  std::size_t active_hazards = 0;  ///< On the map: candidate, active or verifying.
  std::array<std::size_t, kHazardStates> hazards_by_state{};  ///< By HazardState.
  std::uint64_t image_bytes = 0;                              ///< On disk.
  /// Pictures of accepted reports and answers that were not kept, by PictureRefusal.
  std::array<std::uint64_t, kPictureRefusals> pictures_refused{};
  std::size_t suspect_vehicles = 0;  ///< Too often contradicted: they do not count as vehicles.
  /// Of vehicles that were heard in the last minute and say it: the age of the oldest report that
  /// waits for a receipt, s, in rising order.
  std::vector<double> outbox_ages_s;
  MapChangeStatistics map_changes;
  StoreDamage store_damage;  ///< What was found broken in the store at start.

  /// Adds what became of some reports: all counts from `added` to `not_now`.
  void Add(const ZoneStatistics& reports) {
    added += reports.added;
    merged += reports.merged;
    repeated += reports.repeated;
    refused += reports.refused;
    not_now += reports.not_now;
    of_unknown_class += reports.of_unknown_class;
    for (std::size_t i = 0; i < kRefusalKinds; ++i) {
      refused_by_kind.at(i) += reports.refused_by_kind.at(i);
    }
  }
};

}  // namespace livemap::zone
