#include "zone/service/report_intake.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "imaging/image_header.h"

namespace livemap::zone {
namespace {

protocol::Receipt Committed(const protocol::Report& report, const Uuid& hazard_uuid) {
  return {
      protocol::Receipt::Status::kCommitted, report.uuid, hazard_uuid, report.vehicle_id, "", ""};
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
                           ImageStore& images, PictureAllowance& pictures,
                           VehicleAllowance& allowance, PlaceBook& places,
                           const VehicleTable& vehicles, TrailCollector& trails)
    : config_(config),
      state_(state),
      steps_(steps),
      images_(images),
      pictures_(pictures),
      allowance_(allowance),
      places_(places),
      vehicles_(vehicles),
      trails_(trails) {}

ReportIntake::Batch ReportIntake::Examine(const std::vector<protocol::Report>& reports,
                                          std::int64_t now_ns) {
  Batch batch;
  batch.reports = &reports;
  batch.receipts.resize(reports.size());
  std::vector<Uuid> uuids;
  uuids.reserve(reports.size());
  for (const protocol::Report& report : reports) uuids.push_back(report.uuid);
  // All at once: each question to a server costs as much as many answers.
  const auto known = state_.store.FindReports(uuids);
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const protocol::Report& report = reports[i];
    if (!MayChangeMap(i, known[i], now_ns, batch)) continue;
    PendingReport pending{i, {}, {}};
    PictureCost& asked = batch.asked[report.vehicle_id];
    // A report counts without a picture that is not kept.
    const auto cost = report.image.empty()
                          ? std::nullopt
                          : pictures_.Ask(report.vehicle_id, report.image, asked, now_ns);
    if (cost) {
      pending.picture_cost = *cost;
      asked += *cost;
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
bool ReportIntake::MayChangeMap(std::size_t index,
                                const std::optional<ZoneStore::KnownReport>& known,
                                std::int64_t now_ns, Batch& batch) {
  const protocol::Report& report = (*batch.reports)[index];
  // A report that was committed stays committed, whatever the limits are now.
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
  const bool is_known_class = config_.catalogue.Names(report.class_name);
  if (!is_known_class && config_.unknown_classes == UnknownClasses::kRefuse) {
    Refuse({RefusalKind::kUnknownClass,
            "class name is '" + report.class_name + "', which this zone's catalogue does not have"},
           index, batch);
    return false;
  }
  if (!allowance_.TakeReport(report.vehicle_id, now_ns)) {
    ++batch.counted.not_now;
    return false;
  }
  if (const auto why = places_.Challenge(report.vehicle_id, FixOf(report))) {
    Refuse(*why, index, batch);
    return false;
  }
  if (!is_known_class) ++batch.counted.of_unknown_class;
  return true;
}

void ReportIntake::Refuse(const Refusal& refusal, std::size_t index, Batch& batch) {
  const protocol::Report& report = (*batch.reports)[index];
  batch.receipts[index] = {protocol::Receipt::Status::kRefused,
                           report.uuid,
                           Uuid{},
                           report.vehicle_id,
                           refusal.sentence,
                           ""};
  ++batch.counted.refused;
  ++batch.counted.refused_by_kind[static_cast<std::size_t>(refusal.kind)];
}

void ReportIntake::Apply(Batch& batch, ZoneTransaction& transaction) {
  for (const PendingReport& pending : batch.pending) ApplyOne(pending, batch, transaction);
  places_.Save(transaction.now_ns());
}

void ReportIntake::Close(const Batch& batch, std::int64_t now_ns) {
  for (const auto& [vehicle_id, cost] : batch.spent) pictures_.Spend(vehicle_id, cost, now_ns);
  places_.Keep(now_ns);
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
  const double course_rad = CourseOfPass(report, transaction.now_ns());
  auto slot = steps_.MatchNow(report, course_rad, transaction);
  if (!slot) {
    if (const auto why = WhyNoNewHazard(report, transaction.now_ns())) {
      Refuse(*why, pending.index, batch);
      return;
    }
  }
  if (slot) {
    Sight(*slot, report, course_rad, pending.picture, transaction);
    ++batch.counted.merged;
  } else {
    slot = Register(report, course_rad, pending.picture, transaction);
    ++batch.counted.added;
  }
  const HazardRecord& record = state_.hazards.Record(*slot);
  transaction.KeepReport(report, record.id, pending.picture.sha256);
  if (!pending.picture.sha256.empty()) batch.spent[report.vehicle_id] += pending.picture_cost;
  batch.hazard_of_report.emplace(report.uuid, record.uuid);
  batch.receipts[pending.index] = Committed(report, record.uuid);
}

/// In which direction the vehicle drove when it saw the hazard; NaN where the zone does not know,
/// or knows no streets for which it matters.
double ReportIntake::CourseOfPass(const protocol::Report& report, std::int64_t now_ns) const {
  if (!config_.streets) return std::numeric_limits<double>::quiet_NaN();
  // Vehicles may say it with a turn too many; drivers are told it without.
  return std::remainder(
      CourseAt(vehicles_.Track(report.vehicle_id), steps_.SeenNs(report.stamp_ns, now_ns)),
      2 * M_PI);
}

/// What several vehicles saw counts against none of them, so that only a vehicle that nobody else
/// confirms ever comes to its share of the map.
std::optional<Refusal> ReportIntake::WhyNoNewHazard(const protocol::Report& report,
                                                    std::int64_t now_ns) const {
  if (state_.hazards.on_map_count() >= config_.max_hazards) {
    return Refusal{RefusalKind::kMapFull, "the zone holds its maximum of " +
                                              std::to_string(config_.max_hazards) + " hazards"};
  }
  const std::uint64_t vehicle = VehicleKey(report.vehicle_id);
  const std::size_t resting = state_.hazards.CountRestingOn(vehicle);
  if (resting >= config_.max_hazards_by_one_vehicle) {
    return Refusal{RefusalKind::kOneWitness,
                   std::to_string(resting) +
                       " hazards rest on this vehicle's word alone, at most " +
                       std::to_string(config_.max_hazards_by_one_vehicle) + " may"};
  }
  // The store is asked only about those that the zone does not believe.
  const bool is_suspect =
      state_.trust.MaliciousProbability(vehicle, now_ns) >= config_.life.suspect_above;
  if (is_suspect && state_.store.FindStandingDistrust(report.vehicle_id, UINT64_MAX)) {
    return Refusal{RefusalKind::kOneWitness,
                   "an official distrusts this vehicle: no hazard rests on its word alone"};
  }
  return std::nullopt;
}

ReportIntake::Slot ReportIntake::Register(const protocol::Report& report, double course_rad,
                                          const PictureName& picture,
                                          ZoneTransaction& transaction) {
  HazardRegistry& hazards = state_.hazards;
  Uuid uuid = Uuid::Random(state_.generator);
  while (hazards.Find(uuid)) uuid = Uuid::Random(state_.generator);
  const std::int64_t now_ns = transaction.now_ns();
  const Slot slot = hazards.Add(report, hazards.HeadingOf(report.class_name), picture, uuid,
                                transaction.TakeSequence(), now_ns);
  transaction.NameHazard(slot, report.class_name);
  if (!std::isnan(course_rad)) transaction.KeepCourse(slot, course_rad);
  trails_.Note(slot, report.vehicle_id, steps_.SeenNs(report.stamp_ns, now_ns), transaction);
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

void ReportIntake::Sight(Slot slot, const protocol::Report& report, double course_rad,
                         const PictureName& picture, ZoneTransaction& transaction) {
  const ZoneTransaction::Before before = transaction.BeforeOf(slot);
  const std::int64_t now_ns = transaction.now_ns();
  const std::uint64_t sequence = transaction.TakeSequence();
  if (!allowance_.TakeEvidence(report.vehicle_id, now_ns)) {
    state_.hazards.Merge(slot, report, picture, sequence, now_ns, SightingSays::kNothing);
    transaction.RecordHazardEvent(
        slot, before, "sighting that counts for no more: too many from this vehicle", true);
    return;
  }
  const PresenceRecord earlier = state_.hazards.Record(slot).life;
  PresenceRecord life = earlier;
  const Evidence evidence =
      steps_.EvidenceOf(EvidenceKind::kSighting, report.vehicle_id, report.stamp_ns, now_ns);
  const LifecycleUpdate step =
      steps_.lifecycle().Apply(steps_.ClassOf(slot), evidence, now_ns, life);
  const SightingSays says = WhatItSays(slot, report, evidence, step.counted, earlier);
  state_.hazards.Merge(slot, report, picture, sequence, now_ns, says);
  const bool is_new_course = says != SightingSays::kNothing && !std::isnan(course_rad) &&
                             std::isnan(state_.hazards.Record(slot).course_rad);
  if (is_new_course) transaction.KeepCourse(slot, course_rad);
  // A vehicle's first sighting that counts: its further ones have the same trail.
  if (says == SightingSays::kWhere) {
    trails_.Note(slot, report.vehicle_id, steps_.SeenNs(report.stamp_ns, now_ns), transaction);
  }
  steps_.Keep(slot, life, step, transaction);
  transaction.RecordHazardEvent(slot, before,
                                step.transition ? step.transition->reason : "sighting", true);
}

/// What is no evidence moves nothing; nor does what an official has rejected move. A vehicle's
/// further sightings of a hazard share its errors, and each could pull the hazard a little further:
/// only its first one joins the others'. While nobody else has spoken, a much surer one takes the
/// place of that.
SightingSays ReportIntake::WhatItSays(Slot slot, const protocol::Report& report,
                                      const Evidence& evidence, bool counted,
                                      const PresenceRecord& earlier) const {
  const bool is_believed = evidence.malicious < config_.life.suspect_above;
  if (!counted || !is_believed || earlier.state == HazardState::kRejected) {
    return SightingSays::kNothing;
  }
  const auto is_of_vehicle = [&](const VehicleEvidence& one) {
    return one.vehicle == evidence.vehicle;
  };
  const auto is_of_another = [&](const VehicleEvidence& one) {
    return one.vehicle != 0 && !is_of_vehicle(one);
  };
  const auto& voices = earlier.voices;
  // Where an official has put it, it lies.
  if (state_.redirects.IsPlaced(state_.hazards.Record(slot).uuid)) return SightingSays::kWhen;
  if (std::none_of(voices.begin(), voices.end(), is_of_vehicle)) return SightingSays::kWhere;
  const bool is_alone = std::none_of(voices.begin(), voices.end(), is_of_another);
  return is_alone && !earlier.official && state_.hazards.IsSurer(slot, report)
             ? SightingSays::kSurer
             : SightingSays::kWhen;
}

}  // namespace livemap::zone
