#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/uuid.h"
#include "protocol/map_change_report.h"
#include "protocol/report.h"
#include "zone/admission/vehicle_allowance.h"
#include "zone/model/map_change.h"
#include "zone/places/place_book.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// Takes batches of reported map changes into the map, as ReportIntake does for hazards.
///
/// Not thread-safe. The caller holds the writer's lock; Examine needs no other lock, Apply runs in
/// a transaction.
class MapChangeIntake {
 public:
  /// A batch on its way.
  struct Batch {
    const std::vector<protocol::MapChangeReport>* reports = nullptr;
    std::vector<std::optional<protocol::Receipt>> receipts;  ///< None: not taken now.
    std::vector<std::size_t> pending;                        ///< Indices that may change the map.
    std::unordered_map<Uuid, protocol::Receipt> committed;   ///< By the report's uuid.
    MapChangeStatistics counted;

    /// The receipts that vehicles get, in the order of the reports.
    std::vector<protocol::Receipt> TakeReceipts();
  };

  /// All outlive it.
  MapChangeIntake(const ZoneConfig& config, ZoneState& state, PlaceBook& places);

  /// First pass, which changes nothing: what was committed before, what is refused. `reports`
  /// outlive the batch. Throws StoreError.
  Batch Examine(const std::vector<protocol::MapChangeReport>& reports, std::int64_t now_ns);
  /// Second pass: what is pending speaks for or against features.
  void Apply(Batch& batch, ZoneTransaction& transaction);

 private:
  bool MayChangeMap(std::size_t index, std::int64_t now_ns, Batch& batch);
  void ApplyOne(std::size_t index, Batch& batch, ZoneTransaction& transaction);

  const ZoneConfig& config_;
  ZoneState& state_;
  PlaceBook& places_;
  VehicleAllowance allowance_;  ///< Counted apart from reports of hazards.
};

}  // namespace livemap::zone
