// Map changes on their way from vehicles and officials to the store.
#include <utility>

#include "zone/admission/map_change_validation.h"
#include "zone/service/zone_service_state.h"

namespace livemap::zone {

/// Words of map changes on their way.
struct ZoneService::Implementation::MapChangeBatch {
  Change change;
  std::vector<std::optional<protocol::Receipt>> receipts;  ///< None: not taken now.
  std::vector<std::size_t> acceptable;                     ///< In the batch.
  std::unordered_map<Uuid, protocol::Receipt> committed;   ///< By the report's uuid.
  MapChangeStatistics counted;
};

namespace {

constexpr char kReplayed[] = "another vehicle's map change has this uuid";

protocol::Receipt Kept(const protocol::MapChangeReport& report, const Uuid& change) {
  return {protocol::Receipt::Status::kCommitted, report.uuid, change, report.vehicle_id, ""};
}

protocol::Receipt Rejected(const protocol::MapChangeReport& report, std::string sentence) {
  return {protocol::Receipt::Status::kRefused, report.uuid, Uuid{}, report.vehicle_id,
          std::move(sentence)};
}

}  // namespace

std::vector<protocol::Receipt> ZoneService::Implementation::HandleMapChanges(
    const std::vector<protocol::MapChangeReport>& reports) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  MapChangeBatch batch;
  batch.change = NewChange();
  batch.receipts.resize(reports.size());
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (ExamineMapChange(reports[i], i, batch)) batch.acceptable.push_back(i);
  }
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    if (!batch.acceptable.empty()) {
      InTransaction(batch.change, [&] {
        for (const std::size_t i : batch.acceptable) ApplyMapChange(reports[i], i, batch);
      });
    }
    CountMapChanges(batch.counted);
  }
  Settle(batch.change);
  std::vector<protocol::Receipt> receipts;
  receipts.reserve(reports.size());
  for (auto& receipt : batch.receipts) {
    if (receipt) receipts.push_back(*std::move(receipt));
  }
  return receipts;
}

/// Whether the word may change the map; the others are counted, and answered unless they are to be
/// sent again.
bool ZoneService::Implementation::ExamineMapChange(const protocol::MapChangeReport& report,
                                                   std::size_t index, MapChangeBatch& batch) {
  // What was committed stays committed, whatever the limits are now.
  const auto known = store_.FindMapChangeReport(report.uuid);
  if (known && known->vehicle_id == report.vehicle_id) {
    batch.receipts[index] = Kept(report, known->change);
    ++batch.counted.repeated;
    return false;
  }
  std::optional<Refusal> why;
  if (known) {
    why = Refusal{RefusalKind::kReplay, kReplayed};
  } else {
    why = WhyMapChangeRefused(report, config_.limits, batch.change.now_ns);
  }
  if (why) {
    batch.receipts[index] = Rejected(report, std::move(why->sentence));
    ++batch.counted.refused;
    return false;
  }
  if (map_change_allowance_.TakeReport(report.vehicle_id, batch.change.now_ns)) return true;
  ++batch.counted.not_now;
  return false;
}

void ZoneService::Implementation::ApplyMapChange(const protocol::MapChangeReport& report,
                                                 std::size_t index, MapChangeBatch& batch) {
  Change& change = batch.change;
  const auto earlier = batch.committed.find(report.uuid);
  if (earlier != batch.committed.end()) {
    const bool own = earlier->second.vehicle_id == report.vehicle_id;
    batch.receipts[index] = own ? earlier->second : Rejected(report, kReplayed);
    ++(own ? batch.counted.repeated : batch.counted.refused);
    return;
  }
  Uuid fresh = Uuid::Random(generator_);
  while (map_changes_.Find(fresh) != nullptr) fresh = Uuid::Random(generator_);
  const std::uint64_t vehicle = VehicleKey(report.vehicle_id);
  const bool counts = trust_.Hostile(vehicle, change.now_ns) < config_.life.suspect_above;
  auto effect = map_changes_.Tell(report, counts, {fresh, change.sequence + 1, change.now_ns});
  if (!effect) {
    batch.receipts[index] =
        Rejected(report, "the zone holds its maximum of " +
                             std::to_string(config_.map_changes.max_features) + " map changes");
    ++batch.counted.refused;
    return;
  }
  const Uuid feature = map_changes_.Get(effect->id).uuid;
  switch (effect->outcome) {
    case MapChangeRegistry::Outcome::kAdded:
      ++batch.counted.added;
      break;
    case MapChangeRegistry::Outcome::kMerged:
      ++batch.counted.merged;
      break;
    case MapChangeRegistry::Outcome::kDenied:
      ++batch.counted.denied;
      break;
    case MapChangeRegistry::Outcome::kKnown:
      ++batch.counted.known;
      break;
  }
  if (effect->outcome != MapChangeRegistry::Outcome::kKnown) {
    ++change.sequence;
    change.map_change_events.push_back(std::move(effect->event));
  }
  change.map_change_reports.emplace_back(&report, feature);
  const protocol::Receipt receipt = Kept(report, feature);
  batch.receipts[index] = receipt;
  batch.committed.emplace(report.uuid, receipt);
}

bool ZoneService::Implementation::DecideMapChange(const Uuid& uuid, MapChangeState to,
                                                  const std::string& official,
                                                  const std::string& reason) {
  const std::string given = CheckedReason(official, reason, config_.limits.max_text_bytes);
  const bool confirms = to == MapChangeState::kConfirmed;
  const std::string why = DecisionText(confirms ? "confirmed" : "dismissed", official, given);
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Change change = NewChange();
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    InTransaction(change, [&] {
      auto event = map_changes_.Decide(uuid, to, why, {Uuid{}, change.sequence + 1, change.now_ns});
      if (!event) return;
      ++change.sequence;
      change.map_change_events.push_back(*std::move(event));
    });
  }
  Settle(change);
  return !change.map_change_events.empty();
}

/// Features once, as they are in the end; those that made room for others go.
void ZoneService::Implementation::WriteMapChanges(const Change& change) {
  const MapChangeRegistry::Touched touched = map_changes_.TouchedSinceBegin();
  for (const MapChangeRegistry::Id id : touched.written) {
    store_.WriteMapChange({id, map_changes_.Get(id)});
  }
  for (const MapChangeEvent& event : change.map_change_events) {
    const auto id = map_changes_.IdOf(event.feature.uuid);
    if (id) store_.WriteMapChangeEvent(event, *id);
  }
  for (const MapChangeRegistry::Id id : touched.dropped) store_.DropMapChange(id);
  for (const auto& [report, feature] : change.map_change_reports) {
    store_.WriteMapChangeReport(*report, feature, change.now_ns);
  }
}

std::vector<StoredMapChangeEvent> ZoneService::Implementation::MapChangeEvents(const Uuid& uuid,
                                                                               std::size_t limit) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  const MapChangeFeature* feature = map_changes_.Find(uuid);
  if (feature == nullptr) return {};
  return store_.LoadMapChangeEvents(feature->sequence, limit);
}

void ZoneService::Implementation::CountMapChanges(const MapChangeStatistics& counted) {
  MapChangeStatistics& all = statistics_.map_changes;
  all.added += counted.added;
  all.merged += counted.merged;
  all.denied += counted.denied;
  all.known += counted.known;
  all.repeated += counted.repeated;
  all.refused += counted.refused;
  all.not_now += counted.not_now;
}

}  // namespace livemap::zone
