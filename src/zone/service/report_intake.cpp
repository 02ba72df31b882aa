#include "zone/service/report_intake.h"

#include <utility>

#include "imaging/image_header.h"

namespace livemap::zone {
namespace {

protocol::Receipt Committed(const protocol::Report& report, const Uuid& hazard_uuid) {
  return {protocol::Receipt::Status::kCommitted, report.uuid, hazard_uuid, report.vehicle_id, ""};
}

}  // namespace

std::vector<protocol::Receipt> ReportIntake::Batch::TakeReceipts() {
  std::vector<protocol::Receipt> taken;
  taken.reserve(receipts.size());
  for (auto& receipt : receipts) {
    if (receipt) taken.push_back(std::move(*receipt));
  }
  return taken;
}

ReportIntake::ReportIntake(const ZoneConfig& config, ZoneState& state, HazardSteps& steps,
                           ImageStore& images, VehicleAllowance& allowance)
    : config_(config), state_(state), steps_(steps), images_(images), allowance_(allowance) {}

ReportIntake::Batch ReportIntake::Examine(const std::vector<protocol::Report>& reports,
                                          std::int64_t now_ns) {
  Batch batch;
  batch.reports = &reports;
  batch.receipts.resize(reports.size());
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const protocol::Report& report = reports[i];
    if (!MayChangeMap(i, now_ns, batch)) continue;
    PendingReport pending{i, {}};
    if (!report.image.empty()) {
      pending.picture.format = imaging::FormatName(
          imaging::ReadImageHeader(report.image.data(), report.image.size())->format);
      pending.picture.sha256 = images_.Put(report.image, pending.picture.format);
    }
    batch.pending.push_back(std::move(pending));
  }
  images_.Publish();
  return batch;
}

/// The reports that may not are counted, and answered unless they are to be sent again.
bool ReportIntake::MayChangeMap(std::size_t index, std::int64_t now_ns, Batch& batch) {
  const protocol::Report& report = (*batch.reports)[index];
  // A report that was committed stays committed, whatever the limits are now.
  const auto known = state_.store.FindReport(report.uuid);
  if (known && known->vehicle_id == report.vehicle_id) {
    batch.receipts[index] = Committed(report, known->hazard);
    ++batch.counted.repeated;
    return false;
  }
  if (known) {
    Refuse({RefusalKind::kReplay, "another vehicle's report has this uuid"}, index, batch);
    return false;
  }
  if (const auto why = WhyRefused(report, config_.limits, now_ns)) {
    Refuse(*why, index, batch);
    return false;
  }
  if (!allowance_.TakeReport(report.vehicle_id, now_ns)) {
    ++batch.counted.not_now;
    return false;
  }
  if (const auto why = WhyTooFast(report, batch)) {
    Refuse(*why, index, batch);
    return false;
  }
  return true;
}

std::optional<Refusal> ReportIntake::WhyTooFast(const protocol::Report& report, Batch& batch) {
  const auto speed_mps = Challenge(TrackOf(report.vehicle_id, batch), FixOf(report), config_.speed);
  if (!speed_mps) return std::nullopt;
  return Refusal{RefusalKind::kSpeed, "position is reached from this vehicle's last report at " +
                                          std::to_string(*speed_mps) + " m/s only, at most " +
                                          std::to_string(config_.speed.max_speed_mps) +
                                          " m/s are accepted"};
}

/// The batch's own copy, so that a failed commit leaves no trace.
ReportTrack& ReportIntake::TrackOf(const std::string& vehicle_id, Batch& batch) {
  const auto found = batch.tracks.find(vehicle_id);
  if (found != batch.tracks.end()) return found->second;
  const auto known = tracks_.find(vehicle_id);
  ReportTrack track;
  if (known != tracks_.end()) {
    track = known->second;
  } else {
    track.accepted = state_.store.FindLastReport(vehicle_id);
  }
  return batch.tracks.emplace(vehicle_id, track).first->second;
}

void ReportIntake::Refuse(const Refusal& refusal, std::size_t index, Batch& batch) {
  const protocol::Report& report = (*batch.reports)[index];
  batch.receipts[index] = {protocol::Receipt::Status::kRefused, report.uuid, Uuid{},
                           report.vehicle_id, refusal.sentence};
  ++batch.counted.refused;
  ++batch.counted.refused_by_kind[static_cast<std::size_t>(refusal.kind)];
}

void ReportIntake::Apply(Batch& batch, ZoneTransaction& transaction) {
  for (const PendingReport& pending : batch.pending) ApplyOne(pending, batch, transaction);
  for (const auto& [vehicle_id, track] : batch.tracks) {
    if (track.accepted) state_.store.WriteLastReport(vehicle_id, *track.accepted);
  }
}

void ReportIntake::ApplyOne(const PendingReport& pending, Batch& batch,
                            ZoneTransaction& transaction) {
  const protocol::Report& report = (*batch.reports)[pending.index];
  const auto earlier = batch.hazard_of_report.find(report.uuid);
  if (earlier != batch.hazard_of_report.end()) {
    batch.receipts[pending.index] = Committed(report, earlier->second);
    ++batch.counted.repeated;
    return;
  }
  auto slot = steps_.MatchNow(report, transaction);
  if (!slot && state_.hazards.on_map_count() >= config_.max_hazards) {
    Refuse({RefusalKind::kMapFull,
            "the zone holds its maximum of " + std::to_string(config_.max_hazards) + " hazards"},
           pending.index, batch);
    return;
  }
  if (slot) {
    Sight(*slot, report, pending.picture, transaction);
    ++batch.counted.merged;
  } else {
    slot = Register(report, pending.picture, transaction);
    ++batch.counted.added;
  }
  const HazardRecord& record = state_.hazards.Record(*slot);
  transaction.KeepReport(report, record.id, pending.picture.sha256);
  batch.hazard_of_report.emplace(report.uuid, record.uuid);
  batch.receipts[pending.index] = Committed(report, record.uuid);
}

ReportIntake::Slot ReportIntake::Register(const protocol::Report& report,
                                          const PictureName& picture,
                                          ZoneTransaction& transaction) {
  HazardRegistry& hazards = state_.hazards;
  Uuid uuid = Uuid::Random(state_.generator);
  while (hazards.Find(uuid)) uuid = Uuid::Random(state_.generator);
  const std::int64_t now_ns = transaction.now_ns();
  const Slot slot = hazards.Add(report, picture, uuid, transaction.TakeSequence(), now_ns);
  PresenceRecord life;
  const Evidence evidence =
      steps_.EvidenceOf(EvidenceKind::kSighting, report.vehicle_id, report.stamp_ns, now_ns);
  const LifecycleUpdate step =
      steps_.lifecycle().Begin(steps_.ClassOf(slot), evidence, now_ns, life);
  steps_.Keep(slot, life, step, transaction);
  transaction.RecordHazardEvent(slot, std::nullopt,
                                step.transition ? step.transition->reason : "report", true);
  return slot;
}

void ReportIntake::Sight(Slot slot, const protocol::Report& report, const PictureName& picture,
                         ZoneTransaction& transaction) {
  const ZoneTransaction::Before before = transaction.BeforeOf(slot);
  const std::int64_t now_ns = transaction.now_ns();
  state_.hazards.Merge(slot, report, picture, transaction.TakeSequence(), now_ns);
  std::string reason = "sighting that counts for no more: too many from this vehicle";
  if (allowance_.TakeEvidence(report.vehicle_id, now_ns)) {
    PresenceRecord life = state_.hazards.Record(slot).life;
    const Evidence evidence =
        steps_.EvidenceOf(EvidenceKind::kSighting, report.vehicle_id, report.stamp_ns, now_ns);
    const LifecycleUpdate step =
        steps_.lifecycle().Apply(steps_.ClassOf(slot), evidence, now_ns, life);
    steps_.Keep(slot, life, step, transaction);
    reason = step.transition ? step.transition->reason : "sighting";
  }
  transaction.RecordHazardEvent(slot, before, std::move(reason), true);
}

void ReportIntake::KeepTracks(const Batch& batch) {
  // What is forgotten here is read from the store again, but for a vehicle's refused reports.
  if (tracks_.size() > config_.max_vehicles) tracks_.clear();
  for (const auto& [vehicle_id, track] : batch.tracks) tracks_[vehicle_id] = track;
}

bool ReportIntake::HasHeardOf(const std::string& vehicle_id) {
  return tracks_.count(vehicle_id) != 0 || state_.store.FindLastReport(vehicle_id).has_value();
}

}  // namespace livemap::zone
