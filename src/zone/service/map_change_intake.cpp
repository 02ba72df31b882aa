#include "zone/service/map_change_intake.h"

#include <utility>

#include "zone/admission/map_change_validation.h"

namespace livemap::zone {
namespace {

constexpr char kReplayed[] = "another vehicle's map change has this uuid";

VehicleAllowance::Config AllowanceOf(const ZoneConfig& config) {
  VehicleAllowance::Config allowance;
  allowance.reports_per_hour = config.map_changes_per_hour;
  allowance.max_vehicles = config.allowance.max_vehicles;
  return allowance;
}

protocol::Receipt Kept(const protocol::MapChangeReport& report, const Uuid& feature) {
  return {protocol::Receipt::Status::kCommitted, report.uuid, feature, report.vehicle_id, "", ""};
}

protocol::Receipt Rejected(const protocol::MapChangeReport& report, std::string sentence) {
  return {protocol::Receipt::Status::kRefused,
          report.uuid,
          Uuid{},
          report.vehicle_id,
          std::move(sentence),
          ""};
}

std::uint64_t& CountOf(MapChangeRegistry::Outcome outcome, MapChangeStatistics& counted) {
  switch (outcome) {
    case MapChangeRegistry::Outcome::kAdded:
      return counted.added;
    case MapChangeRegistry::Outcome::kMerged:
      return counted.merged;
    case MapChangeRegistry::Outcome::kDenied:
      return counted.denied;
    case MapChangeRegistry::Outcome::kKnown:
      return counted.known;
  }
  return counted.known;
}

}  // namespace

std::vector<protocol::Receipt> MapChangeIntake::Batch::TakeReceipts() {
  std::vector<protocol::Receipt> taken;
  taken.reserve(receipts.size());
  for (auto& receipt : receipts) {
    if (receipt) taken.push_back(*std::move(receipt));
  }
  return taken;
}

MapChangeIntake::MapChangeIntake(const ZoneConfig& config, ZoneState& state, PlaceBook& places)
    : config_(config), state_(state), places_(places), allowance_(AllowanceOf(config)) {}

MapChangeIntake::Batch MapChangeIntake::Examine(
    const std::vector<protocol::MapChangeReport>& reports, std::int64_t now_ns) {
  Batch batch;
  batch.reports = &reports;
  batch.receipts.resize(reports.size());
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (MayChangeMap(i, now_ns, batch)) batch.pending.push_back(i);
  }
  return batch;
}

/// The reports that may not are counted, and answered unless they are to be sent again.
bool MapChangeIntake::MayChangeMap(std::size_t index, std::int64_t now_ns, Batch& batch) {
  const protocol::MapChangeReport& report = (*batch.reports)[index];
  // What was committed stays committed, whatever the limits are now.
  const auto known = state_.store.FindMapChangeReport(report.uuid);
  if (known && known->vehicle_id == report.vehicle_id) {
    batch.receipts[index] = Kept(report, known->change);
    ++batch.counted.repeated;
    return false;
  }
  std::optional<Refusal> why;
  if (known) {
    why = Refusal{RefusalKind::kReplay, kReplayed};
  } else {
    why = WhyMapChangeRefused(report, config_.limits, now_ns);
  }
  if (why) {
    batch.receipts[index] = Rejected(report, std::move(why->sentence));
    ++batch.counted.refused;
    return false;
  }
  if (!allowance_.TakeReport(report.vehicle_id, now_ns)) {
    ++batch.counted.not_now;
    return false;
  }
  why = places_.Challenge(report.vehicle_id, FixOf(report));
  if (!why) return true;
  batch.receipts[index] = Rejected(report, std::move(why->sentence));
  ++batch.counted.refused;
  ++batch.counted.too_fast;
  return false;
}

void MapChangeIntake::Apply(Batch& batch, ZoneTransaction& transaction) {
  for (const std::size_t index : batch.pending) ApplyOne(index, batch, transaction);
  places_.Save(transaction.now_ns());
}

void MapChangeIntake::ApplyOne(std::size_t index, Batch& batch, ZoneTransaction& transaction) {
  const protocol::MapChangeReport& report = (*batch.reports)[index];
  const auto earlier = batch.committed.find(report.uuid);
  if (earlier != batch.committed.end()) {
    const bool own = earlier->second.vehicle_id == report.vehicle_id;
    batch.receipts[index] = own ? earlier->second : Rejected(report, kReplayed);
    ++(own ? batch.counted.repeated : batch.counted.refused);
    return;
  }
  Uuid fresh = Uuid::Random(state_.generator);
  while (state_.map_changes.Find(fresh) != nullptr) fresh = Uuid::Random(state_.generator);
  const std::int64_t now_ns = transaction.now_ns();
  const std::uint64_t vehicle = VehicleKey(report.vehicle_id);
  const bool counts =
      state_.trust.MaliciousProbability(vehicle, now_ns) < config_.life.suspect_above;
  auto effect =
      state_.map_changes.Tell(report, counts, {fresh, transaction.sequence() + 1, now_ns});
  if (!effect) {
    batch.receipts[index] =
        Rejected(report, "the zone holds its maximum of " +
                             std::to_string(config_.map_changes.max_features) + " map changes");
    ++batch.counted.refused;
    return;
  }
  const Uuid feature = state_.map_changes.Get(effect->id).uuid;
  ++CountOf(effect->outcome, batch.counted);
  if (effect->outcome != MapChangeRegistry::Outcome::kKnown) {
    transaction.RecordMapChangeEvent(std::move(effect->event));
  }
  transaction.KeepMapChangeReport(report, feature);
  const protocol::Receipt receipt = Kept(report, feature);
  batch.receipts[index] = receipt;
  batch.committed.emplace(report.uuid, receipt);
}

}  // namespace livemap::zone
