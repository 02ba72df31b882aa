// Reports on their way into the map: see HandleBatch.
#include <algorithm>
#include <utility>

#include "imaging/image_header.h"
#include "zone/service/zone_service_state.h"

namespace livemap::zone {
namespace {

protocol::Receipt Committed(const protocol::Report& report, const Uuid& hazard_uuid) {
  return {protocol::Receipt::Status::kCommitted, report.uuid, hazard_uuid, report.vehicle_id, ""};
}

}  // namespace

std::vector<protocol::Receipt> ZoneService::Implementation::HandleBatch(
    const std::vector<protocol::Report>& reports) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Batch batch;
  batch.change = NewChange();
  batch.receipts.resize(reports.size());
  Triage(reports, batch);
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    if (!batch.candidates.empty()) {
      InTransaction(batch.change, [&] { Apply(reports, batch); });
    }
    Count(batch.counted);
  }
  KeepTracks(batch);
  Settle(batch.change);
  std::vector<protocol::Receipt> receipts;
  receipts.reserve(reports.size());
  for (auto& receipt : batch.receipts) {
    if (receipt) receipts.push_back(std::move(*receipt));
  }
  return receipts;
}

/// First pass, without the lock: what needs no change, what is refused, pictures to disk. A picture
/// whose report is never committed is unreferenced and goes first.
void ZoneService::Implementation::Triage(const std::vector<protocol::Report>& reports,
                                         Batch& batch) {
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const protocol::Report& report = reports[i];
    if (!Examine(report, i, batch)) continue;
    PendingReport candidate{i, {}};
    if (!report.image.empty()) {
      candidate.picture.format = imaging::FormatName(
          imaging::ReadImageHeader(report.image.data(), report.image.size())->format);
      candidate.picture.sha256 = images_.Put(report.image, candidate.picture.format);
    }
    batch.candidates.push_back(std::move(candidate));
  }
  images_.Publish();
}

/// Whether the report may change the map; the others are counted, and answered unless they are to
/// be sent again.
bool ZoneService::Implementation::Examine(const protocol::Report& report, std::size_t index,
                                          Batch& batch) {
  // A report that was committed stays committed, whatever the limits are now.
  const auto known = store_.FindReport(report.uuid);
  if (known && known->vehicle_id == report.vehicle_id) {
    batch.receipts[index] = Committed(report, known->hazard);
    ++batch.counted.repeated;
    return false;
  }
  if (known) {
    Refuse(report, {RefusalKind::kReplay, "another vehicle's report has this uuid"}, index, batch);
    return false;
  }
  if (const auto why = WhyRefused(report, config_.limits, batch.change.now_ns)) {
    Refuse(report, *why, index, batch);
    return false;
  }
  if (!allowance_.TakeReport(report.vehicle_id, batch.change.now_ns)) {
    ++batch.counted.not_now;
    return false;
  }
  if (const auto why = WhyTooFast(report, batch)) {
    Refuse(report, *why, index, batch);
    return false;
  }
  return true;
}

std::optional<Refusal> ZoneService::Implementation::WhyTooFast(const protocol::Report& report,
                                                               Batch& batch) {
  const auto speed_mps = Challenge(TrackOf(report.vehicle_id, batch), FixOf(report), config_.speed);
  if (!speed_mps) return std::nullopt;
  return Refusal{RefusalKind::kSpeed, "position is reached from this vehicle's last report at " +
                                          std::to_string(*speed_mps) + " m/s only, at most " +
                                          std::to_string(config_.speed.max_speed_mps) +
                                          " m/s are accepted"};
}

/// The batch's own copy, so that a failed commit leaves no trace.
ReportTrack& ZoneService::Implementation::TrackOf(const std::string& vehicle_id, Batch& batch) {
  const auto found = batch.tracks.find(vehicle_id);
  if (found != batch.tracks.end()) return found->second;
  const auto known = tracks_.find(vehicle_id);
  ReportTrack track;
  if (known != tracks_.end()) {
    track = known->second;
  } else {
    track.accepted = store_.FindLastReport(vehicle_id);
  }
  return batch.tracks.emplace(vehicle_id, track).first->second;
}

void ZoneService::Implementation::KeepTracks(const Batch& batch) {
  // What is forgotten here is read from the store again, but for a vehicle's refused reports.
  if (tracks_.size() > config_.max_vehicles) tracks_.clear();
  for (const auto& [vehicle_id, track] : batch.tracks) tracks_[vehicle_id] = track;
}

void ZoneService::Implementation::Refuse(const protocol::Report& report, const Refusal& refusal,
                                         std::size_t index, Batch& batch) {
  batch.receipts[index] = {protocol::Receipt::Status::kRefused, report.uuid, Uuid{},
                           report.vehicle_id, refusal.sentence};
  ++batch.counted.refused;
  ++batch.counted.refused_by_kind[static_cast<std::size_t>(refusal.kind)];
}

void ZoneService::Implementation::Apply(const std::vector<protocol::Report>& reports,
                                        Batch& batch) {
  for (const PendingReport& candidate : batch.candidates) {
    const protocol::Report& report = reports[candidate.index];
    const auto earlier = batch.hazard_of_report.find(report.uuid);
    if (earlier != batch.hazard_of_report.end()) {
      batch.receipts[candidate.index] = Committed(report, earlier->second);
      ++batch.counted.repeated;
      continue;
    }
    auto slot = MatchNow(report, batch.change);
    if (!slot && registry_.on_map_count() >= config_.max_hazards) {
      Refuse(report,
             {RefusalKind::kMapFull,
              "the zone holds its maximum of " + std::to_string(config_.max_hazards) + " hazards"},
             candidate.index, batch);
      continue;
    }
    if (slot) {
      Sight(*slot, report, candidate.picture, batch.change);
      ++batch.counted.merged;
    } else {
      slot = Register(report, candidate.picture, batch.change);
      ++batch.counted.added;
    }
    const HazardRecord& record = registry_.Record(*slot);
    batch.change.reports.push_back({&report, record.id, candidate.picture.sha256});
    batch.hazard_of_report.emplace(report.uuid, record.uuid);
    batch.receipts[candidate.index] = Committed(report, record.uuid);
  }
  for (const auto& [vehicle_id, track] : batch.tracks) {
    if (track.accepted) store_.WriteLastReport(vehicle_id, *track.accepted);
  }
}

ZoneService::Implementation::Slot ZoneService::Implementation::Register(
    const protocol::Report& report, const PictureName& picture, Change& change) {
  Uuid uuid = Uuid::Random(generator_);
  while (registry_.Find(uuid)) uuid = Uuid::Random(generator_);
  const Slot slot = registry_.Add(report, picture, uuid, ++change.sequence, change.now_ns);
  const ClassModel entry = ClassOf(slot);
  PresenceRecord life;
  const Evidence evidence =
      EvidenceOf(EvidenceKind::kSighting, report.vehicle_id, report.stamp_ns, change.now_ns);
  const LifecycleUpdate step = life_.Begin(entry, evidence, change.now_ns, life);
  Learn(report.class_name, step.lesson, change);
  Judge(step, change);
  registry_.SetLife(slot, life, life_.Presence(entry, life, change.now_ns), change.sequence,
                    change.now_ns);
  RecordEvent(slot, std::nullopt, step.transition ? step.transition->reason : "report", true,
              change);
  return slot;
}

void ZoneService::Implementation::Sight(Slot slot, const protocol::Report& report,
                                        const PictureName& picture, Change& change) {
  const Before before = BeforeOf(slot);
  registry_.Merge(slot, report, picture, ++change.sequence, change.now_ns);
  std::string reason = "sighting that counts for no more: too many from this vehicle";
  if (allowance_.TakeEvidence(report.vehicle_id, change.now_ns)) {
    const ClassModel entry = ClassOf(slot);
    PresenceRecord life = registry_.Record(slot).life;
    const Evidence evidence =
        EvidenceOf(EvidenceKind::kSighting, report.vehicle_id, report.stamp_ns, change.now_ns);
    const LifecycleUpdate step = life_.Apply(entry, evidence, change.now_ns, life);
    Learn(report.class_name, step.lesson, change);
    Judge(step, change);
    registry_.SetLife(slot, life, life_.Presence(entry, life, change.now_ns), change.sequence,
                      change.now_ns);
    reason = step.transition ? step.transition->reason : "sighting";
  }
  RecordEvent(slot, before, std::move(reason), true, change);
}

void ZoneService::Implementation::Count(const ZoneStatistics& counted) {
  statistics_.added += counted.added;
  statistics_.merged += counted.merged;
  statistics_.repeated += counted.repeated;
  statistics_.refused += counted.refused;
  statistics_.not_now += counted.not_now;
  for (std::size_t i = 0; i < kRefusalKinds; ++i) {
    statistics_.refused_by_kind[i] += counted.refused_by_kind[i];
  }
}

}  // namespace livemap::zone
