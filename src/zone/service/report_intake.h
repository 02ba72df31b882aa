#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/uuid.h"
#include "protocol/report.h"
#include "zone/admission/report_validation.h"
#include "zone/admission/vehicle_allowance.h"
#include "zone/pictures/image_store.h"
#include "zone/pictures/picture_allowance.h"
#include "zone/places/place_book.h"
#include "zone/registry/vehicle_table.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/trail_collector.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_statistics.h"
#include "zone/service/zone_transaction.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// Takes batches of hazard reports into the map: which of them count, which hazards they are
/// sightings of, and what their vehicles are answered.
///
/// Not thread-safe. The caller holds the writer's lock; Examine needs no other lock, Apply runs in
/// a transaction.
class ReportIntake {
 public:
  /// A report that may change the map.
  struct PendingReport {
    std::size_t index = 0;  ///< In the batch.
    PictureName picture;
    PictureCost picture_cost;
  };
  /// A batch on its way.
  struct Batch {
    const std::vector<protocol::Report>* reports = nullptr;
    std::vector<std::optional<protocol::Receipt>> receipts;  ///< None: not taken now.
    std::vector<PendingReport> pending;
    std::unordered_map<Uuid, Uuid> hazard_of_report;
    std::map<std::string, PictureCost> asked;  ///< For pictures, by vehicle.
    std::map<std::string, PictureCost> spent;  ///< Of these, for what is committed.
    ZoneStatistics counted;

    /// The receipts that vehicles get, in the order of the reports.
    std::vector<protocol::Receipt> TakeReceipts();
  };

  /// All outlive it.
  ReportIntake(const ZoneConfig& config, ZoneState& state, HazardSteps& steps, ImageStore& images,
               PictureAllowance& pictures, VehicleAllowance& allowance, PlaceBook& places,
               const VehicleTable& vehicles, TrailCollector& trails);

  /// First pass, which changes nothing: what was committed before, what is refused, pictures to
  /// disk. A picture whose report is never committed is unreferenced and goes first. `reports`
  /// outlive the batch. Throws StoreError.
  Batch Examine(const std::vector<protocol::Report>& reports, std::int64_t now_ns);
  /// Second pass: registers or merges what is pending.
  void Apply(Batch& batch, ZoneTransaction& transaction);
  /// After the commit: what the batch cost is taken from its vehicles, and where they were is
  /// known. Also where nothing was pending.
  void Close(const Batch& batch, std::int64_t now_ns);

 private:
  using Slot = HazardRegistry::Slot;

  bool MayChangeMap(std::size_t index, const std::optional<ZoneStore::KnownReport>& known,
                    std::int64_t now_ns, Batch& batch);
  std::optional<Refusal> WhyNoNewHazard(const protocol::Report& report, std::int64_t now_ns) const;
  static void Refuse(const Refusal& refusal, std::size_t index, Batch& batch);
  void ApplyOne(const PendingReport& pending, Batch& batch, ZoneTransaction& transaction);
  double CourseOfPass(const protocol::Report& report, std::int64_t now_ns) const;
  Slot Register(const protocol::Report& report, double course_rad, const PictureName& picture,
                ZoneTransaction& transaction);
  void Sight(Slot slot, const protocol::Report& report, double course_rad,
             const PictureName& picture, ZoneTransaction& transaction);
  SightingSays WhatItSays(Slot slot, const protocol::Report& report, const Evidence& evidence,
                          bool counted, const PresenceRecord& earlier) const;

  const ZoneConfig& config_;
  ZoneState& state_;
  HazardSteps& steps_;
  ImageStore& images_;
  PictureAllowance& pictures_;
  VehicleAllowance& allowance_;
  PlaceBook& places_;
  const VehicleTable& vehicles_;
  TrailCollector& trails_;
};

}  // namespace livemap::zone
