#include "zone/service/zone_transaction.h"

#include <algorithm>
#include <utility>

#include "common/text.h"
#include "protocol/text_rules.h"

namespace livemap::zone {

ZoneTransaction::ZoneTransaction(ZoneState& state, std::int64_t now_ns)
    : state_(state), now_ns_(now_ns), sequence_(state.sequence), announced_(state.announced) {}

void ZoneTransaction::Begin() {
  state_.store.Begin();
  state_.hazards.Begin();
  state_.map_changes.Begin();
}

/// The store has committed already; memory follows.
void ZoneTransaction::Commit() {
  state_.hazards.Commit();
  state_.map_changes.Commit();
  state_.sequence = sequence_;
  state_.announced = announced_;
}

void ZoneTransaction::Rollback() {
  state_.store.Rollback();
  for (const auto& [slot, before] : trails_before_) state_.hazards.SetTrails(slot, before);
  state_.hazards.Rollback();
  state_.map_changes.Rollback();
  for (const auto& [class_name, before] : learned_before_) {
    state_.survival.Restore(class_name, before);
  }
  for (const auto& [vehicle, before] : trust_before_) state_.trust.Restore(vehicle, before);
}

void ZoneTransaction::Learn(const std::string& class_name, const LifetimeObservation& lesson) {
  if (!(lesson.stood_s >= 0) || (lesson.stood_s == 0 && !lesson.ended)) return;
  const auto known = state_.survival.learned().find(class_name);
  // The first time only: a failed transaction takes back all of them.
  learned_before_.emplace(
      class_name, known == state_.survival.learned().end() ? LearnedLifetime{} : known->second);
  state_.survival.Learn(class_name, lesson);
}

void ZoneTransaction::Judge(const std::vector<Verdict>& verdicts) {
  for (const Verdict& verdict : verdicts) {
    // The first time only: a failed transaction takes back all of them.
    trust_before_.emplace(verdict.vehicle, state_.trust.Get(verdict.vehicle));
    state_.trust.Judge(verdict, now_ns_);
  }
}

void ZoneTransaction::Unlearn(const std::string& class_name, const LifetimeObservation& lesson) {
  const auto known = state_.survival.learned().find(class_name);
  if (known == state_.survival.learned().end()) return;
  learned_before_.emplace(class_name, known->second);
  state_.survival.Unlearn(class_name, lesson);
}

void ZoneTransaction::RestoreTrust(std::uint64_t vehicle, const TrustRecord& record) {
  trust_before_.emplace(vehicle, state_.trust.Get(vehicle));
  state_.trust.Restore(vehicle, record);
}

void ZoneTransaction::TakeBackSuspicion(const SuspicionChange& change, std::int64_t at_ns) {
  trust_before_.emplace(change.vehicle, state_.trust.Get(change.vehicle));
  state_.trust.TakeBack(change.vehicle, change.added, at_ns, now_ns_);
}

void ZoneTransaction::Distrust(std::uint64_t vehicle) {
  trust_before_.emplace(vehicle, state_.trust.Get(vehicle));
  state_.trust.Distrust(vehicle, now_ns_);
}

ZoneTransaction::Before ZoneTransaction::BeforeOf(Slot slot) const {
  const HazardRecord& record = state_.hazards.Record(slot);
  return {record.life.state, record.sequence, record.picture};
}

void ZoneTransaction::RecordHazardEvent(Slot slot, const std::optional<Before>& before,
                                        std::string reason, bool tells) {
  HazardRegistry& hazards = state_.hazards;
  const HazardState state = hazards.State(slot);
  const bool was_on_map = before && IsOnMap(before->state);
  HazardEvent event;
  event.action = !IsOnMap(state) ? HazardAction::kRemoved
                 : was_on_map    ? HazardAction::kUpdated
                                 : HazardAction::kAdded;
  if (before) event.from = before->state;
  event.reason = CutUtf8(std::move(reason), kMaxEventReasonBytes);
  event.previous_announced = announced_;
  const auto told = DriversAction(event.from, state);
  event.announced = told && (tells || *told != HazardAction::kUpdated);
  if (event.announced) {
    hazards.MarkAnnounced(slot);
    announced_ = sequence_;
  }
  event.hazard = hazards.Get(slot);
  places_.push_back({hazards.Record(slot).id, before ? before->sequence : 0});
  touched_.push_back(slot);
  pictures_.emplace_back(was_on_map ? before->picture.Sha256() : "",
                         IsOnMap(state) ? event.hazard.image_sha256 : "");
  hazard_events_.push_back(std::move(event));
}

void ZoneTransaction::NameHazard(Slot slot, const std::string& reported_class) {
  reported_classes_[slot] = protocol::Trimmed(reported_class);
}

void ZoneTransaction::KeepCourse(Slot slot, double course_rad) {
  state_.hazards.SetCourse(slot, course_rad);
  courses_[slot] = course_rad;
}

void ZoneTransaction::KeepTrails(Slot slot, std::vector<protocol::Trail> trails) {
  // The first time only: a failed transaction takes back all of them.
  trails_before_.emplace(slot, state_.hazards.Trails(slot));
  state_.hazards.SetTrails(slot, std::move(trails));
}

void ZoneTransaction::RecordMapChangeEvent(MapChangeEvent event) {
  ++sequence_;
  map_change_events_.push_back(std::move(event));
}

void ZoneTransaction::KeepReport(const protocol::Report& report, std::uint32_t hazard_id,
                                 const std::string& image_sha256) {
  reports_.push_back({&report, hazard_id, image_sha256});
}

void ZoneTransaction::KeepAnswer(const protocol::PollAnswer& answer, std::uint32_t hazard_id) {
  answer_ = &answer;
  answered_id_ = hazard_id;
}

void ZoneTransaction::KeepAnswerPicture(const std::string& image_sha256, std::uint64_t decision) {
  answer_picture_ = image_sha256;
  frame_decision_ = decision;
}

void ZoneTransaction::KeepMapChangeReport(const protocol::MapChangeReport& report,
                                          const Uuid& feature) {
  map_change_reports_.emplace_back(&report, feature);
}

/// Hazards and classes once, as they are in the end; hazards before what refers to them.
void ZoneTransaction::Write() {
  ZoneStore& store = state_.store;
  std::sort(touched_.begin(), touched_.end());
  touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
  for (const Slot slot : touched_) {
    const HazardRecord& record = state_.hazards.Record(slot);
    ZoneStore::HazardRow row{record.id, state_.hazards.Get(slot), record.life};
    const auto reported = reported_classes_.find(slot);
    if (reported != reported_classes_.end()) row.hazard.class_name = reported->second;
    store.WriteHazard(row);
  }
  for (const Slot slot : renamed_) {
    store.WriteClass(state_.hazards.Record(slot).id, state_.hazards.ClassName(slot));
  }
  for (const auto& [slot, course_rad] : courses_) {
    store.WriteCourse(state_.hazards.Record(slot).id, course_rad);
  }
  for (const auto& [slot, before] : trails_before_) {
    store.WriteTrails(state_.hazards.Record(slot).id, state_.hazards.Trails(slot));
  }
  for (std::size_t i = 0; i < hazard_events_.size(); ++i) {
    store.WriteEvent(hazard_events_[i], places_[i].hazard_id, places_[i].previous_sequence);
  }
  for (const AcceptedReport& accepted : reports_) {
    store.WriteReport(*accepted.report, accepted.hazard_id, accepted.image_sha256, now_ns_);
  }
  if (answer_ != nullptr) store.WriteAnswer(*answer_, answered_id_, now_ns_);
  if (answer_ != nullptr && !answer_picture_.empty()) {
    store.WriteAnswerPicture(answer_->poll, answered_id_, answer_picture_, frame_decision_);
  }
  for (const auto& [class_name, before] : learned_before_) {
    store.WriteLife(class_name, state_.survival.learned().at(class_name));
  }
  for (const auto& [vehicle, before] : trust_before_) {
    store.WriteTrust(vehicle, state_.trust.Get(vehicle));
  }
  WriteMapChanges();
}

/// Features once, as they are in the end; those that made room for others go.
void ZoneTransaction::WriteMapChanges() {
  ZoneStore& store = state_.store;
  const MapChangeRegistry& map_changes = state_.map_changes;
  const MapChangeRegistry::Touched touched = map_changes.TouchedSinceBegin();
  for (const MapChangeRegistry::Id id : touched.written) {
    store.WriteMapChange({id, map_changes.Get(id)});
  }
  for (const MapChangeEvent& event : map_change_events_) {
    const auto id = map_changes.IdOf(event.feature.uuid);
    if (id) store.WriteMapChangeEvent(event, *id);
  }
  for (const MapChangeRegistry::Id id : touched.dropped) store.DropMapChange(id);
  for (const auto& [report, feature] : map_change_reports_) {
    store.WriteMapChangeReport(*report, feature, now_ns_);
  }
}

}  // namespace livemap::zone
