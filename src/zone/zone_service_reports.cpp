// Reports on their way into the map: see HandleBatch.
#include <algorithm>
#include <utility>

#include "base/image_header.h"
#include "zone/zone_service_state.h"

namespace livemap {
namespace {

Receipt Committed(const Report& report, const Uuid& hazard_uuid) {
  return {Receipt::Status::kCommitted, report.uuid, hazard_uuid, report.vehicle_id, ""};
}

}  // namespace

std::vector<Receipt> ZoneService::Implementation::HandleBatch(const std::vector<Report>& reports) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Batch batch;
  batch.receipts.resize(reports.size());
  Triage(reports, batch);
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    batch.change = NewChange();
    if (!batch.candidates.empty()) {
      InTransaction(batch.change, [&] { Apply(reports, batch); });
    }
    Count(batch.counted);
  }
  for (auto& [vehicle_id, track] : batch.tracks) tracks_[vehicle_id] = track;
  Settle(batch.change);
  std::vector<Receipt> receipts;
  receipts.reserve(reports.size());
  for (auto& receipt : batch.receipts) {
    if (receipt) receipts.push_back(std::move(*receipt));
  }
  return receipts;
}

/// First pass, without the lock: what needs no change, what is refused, pictures to disk. A picture
/// whose report is never committed is unreferenced and goes first.
void ZoneService::Implementation::Triage(const std::vector<Report>& reports, Batch& batch) {
  const std::int64_t now_ns = now_ns_();
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const Report& report = reports[i];
    // A report that was committed stays committed, whatever the limits are now.
    const auto known = store_.FindReport(report.uuid);
    if (known && known->vehicle_id == report.vehicle_id) {
      batch.receipts[i] = Committed(report, known->hazard);
      ++batch.counted.repeated;
      continue;
    }
    if (known) {
      Refuse(report, {RefusalKind::kReplay, "another vehicle's report has this uuid"}, i, batch);
      continue;
    }
    if (const auto why = WhyNot(report, now_ns, batch)) {
      Refuse(report, *why, i, batch);
      continue;
    }
    Candidate candidate{i, {}};
    if (!report.image.empty()) {
      candidate.picture.format =
          FormatName(ReadImageHeader(report.image.data(), report.image.size())->format);
      candidate.picture.sha256 = images_.Put(report.image, candidate.picture.format);
    }
    batch.candidates.push_back(std::move(candidate));
  }
  images_.Publish();
}

std::optional<Refusal> ZoneService::Implementation::WhyNot(const Report& report,
                                                           std::int64_t now_ns, Batch& batch) {
  if (auto why = WhyRefused(report, config_.limits, now_ns)) return why;
  const auto speed_mps = Challenge(TrackOf(report.vehicle_id, batch), FixOf(report), config_.speed);
  if (!speed_mps) return std::nullopt;
  return Refusal{RefusalKind::kSpeed, "position is " + std::to_string(*speed_mps) +
                                          " m/s away from this vehicle's last report, at most " +
                                          std::to_string(config_.speed.max_speed_mps) +
                                          " m/s are accepted"};
}

/// The batch's own copy, so that a failed commit leaves no trace.
ReportTrack& ZoneService::Implementation::TrackOf(const std::string& vehicle_id, Batch& batch) {
  const auto found = batch.tracks.find(vehicle_id);
  if (found != batch.tracks.end()) return found->second;
  const auto known = tracks_.find(vehicle_id);
  return batch.tracks.emplace(vehicle_id, known == tracks_.end() ? ReportTrack{} : known->second)
      .first->second;
}

void ZoneService::Implementation::Refuse(const Report& report, const Refusal& refusal,
                                         std::size_t index, Batch& batch) {
  batch.receipts[index] = {Receipt::Status::kRefused, report.uuid, Uuid{}, report.vehicle_id,
                           refusal.sentence};
  ++batch.counted.refused;
  ++batch.counted.refused_by_kind[static_cast<std::size_t>(refusal.kind)];
}

void ZoneService::Implementation::Apply(const std::vector<Report>& reports, Batch& batch) {
  for (const Candidate& candidate : batch.candidates) {
    const Report& report = reports[candidate.index];
    const auto earlier = batch.hazard_of_report.find(report.uuid);
    if (earlier != batch.hazard_of_report.end()) {
      batch.receipts[candidate.index] = Committed(report, earlier->second);
      ++batch.counted.repeated;
      continue;
    }
    const auto match = registry_.FindMatch(report.class_name, report.position);
    if (!match && registry_.on_map_count() >= config_.max_hazards) {
      Refuse(report,
             {RefusalKind::kMapFull,
              "the zone holds its maximum of " + std::to_string(config_.max_hazards) + " hazards"},
             candidate.index, batch);
      continue;
    }
    Register(report, candidate.picture, match, batch);
    const Uuid& hazard = batch.change.events.back().hazard.uuid;
    batch.hazard_of_report.emplace(report.uuid, hazard);
    batch.receipts[candidate.index] = Committed(report, hazard);
  }
}

void ZoneService::Implementation::Register(const Report& report, const PictureName& picture,
                                           std::optional<Slot> match, Batch& batch) {
  const std::int64_t now_ns = now_ns_();
  Change& change = batch.change;
  const std::uint64_t sequence = ++change.sequence;
  std::string picture_before;
  Slot slot = 0;
  if (match) {
    slot = *match;
    const HazardState before = registry_.Get(slot).state;
    picture_before = registry_.Get(slot).image_sha256;
    registry_.Merge(slot, report, picture, sequence, now_ns);
    NoteEvent(slot, HazardAction::kUpdated, before, "sighting", change);
    ++batch.counted.merged;
  } else {
    Uuid uuid = Uuid::Random(generator_);
    while (registry_.Find(uuid)) uuid = Uuid::Random(generator_);
    slot = registry_.Add(report, picture, uuid, sequence, now_ns);
    NoteEvent(slot, HazardAction::kAdded, std::nullopt, "report", change);
    ++batch.counted.added;
  }
  const Hazard& hazard = change.events.back().hazard;
  store_.WriteReport(report, hazard.uuid, picture.sha256, now_ns);
  change.pictures.emplace_back(std::move(picture_before), hazard.image_sha256);
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

}  // namespace livemap
