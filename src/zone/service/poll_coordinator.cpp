#include "zone/service/poll_coordinator.h"

#include <string>
#include <utility>

#include "imaging/image_header.h"
#include "protocol/text_rules.h"
#include "zone/admission/report_validation.h"

namespace livemap::zone {
namespace {

using protocol::PollAnswer;

EvidenceKind KindOf(PollAnswer::Answer answer) {
  switch (answer) {
    case PollAnswer::Answer::kYes:
      return EvidenceKind::kAnswerYes;
    case PollAnswer::Answer::kNo:
      return EvidenceKind::kAnswerNo;
    case PollAnswer::Answer::kCantSee:
      return EvidenceKind::kCantSee;
  }
  return EvidenceKind::kCantSee;
}

}  // namespace

PollCoordinator::PollCoordinator(const ZoneConfig& config, ZoneState& state, HazardSteps& steps,
                                 ImageStore& images, PictureAllowance& pictures,
                                 VehicleAllowance& allowance, const VehicleTable& vehicles,
                                 PlaceBook& places)
    : config_(config),
      state_(state),
      steps_(steps),
      images_(images),
      pictures_(pictures),
      allowance_(allowance),
      vehicles_(vehicles),
      places_(places),
      scheduler_(config.polls, state.generator()) {}

void PollCoordinator::SetHazard(Slot slot, std::int64_t now_ns) {
  const HazardRecord& record = state_.hazards.Record(slot);
  const ClassModel entry = steps_.ClassOf(slot);
  const std::int64_t picture_ns = record.picture.empty() ? 0 : record.estimate.last_seen_ns;
  const MutexLock lock(mutex_);
  // A detector never says "other": who is asked whether it sees one would always deny it.
  const bool has_name = state_.hazards.ClassName(slot) != protocol::kOtherClass ||
                        config_.catalogue.classes().count(protocol::kOtherClass) != 0;
  if (IsOnMap(record.life.state) && has_name) {
    scheduler_.SetHazard(slot, record.estimate.position, entry, record.life, picture_ns, now_ns);
  } else {
    scheduler_.RemoveHazard(slot);
  }
}

void PollCoordinator::SetVehicle(const VehicleState& vehicle) {
  const MutexLock lock(mutex_);
  scheduler_.SetVehicle(vehicle.vehicle_id, {vehicle.heard_ns, vehicle.position, vehicle.course_rad,
                                             vehicle.speed_mps});
}

std::vector<protocol::Poll> PollCoordinator::TakeDue(std::int64_t now_ns) {
  std::vector<PollChoice> choices;
  {
    const MutexLock lock(mutex_);
    choices = scheduler_.TakeDue(now_ns);
  }
  std::vector<protocol::Poll> polls;
  polls.reserve(choices.size());
  for (PollChoice& choice : choices) {
    const auto slot = static_cast<Slot>(choice.hazard);
    const HazardRecord& record = state_.hazards.Record(slot);
    protocol::Poll poll;
    poll.poll = choice.poll;
    poll.hazard = record.uuid;
    poll.stamp_ns = now_ns;
    poll.vehicle_id = std::move(choice.vehicle_id);
    poll.class_name = state_.hazards.ClassName(slot);
    poll.position = record.estimate.position;
    poll.covariance_m2 = record.estimate.covariance_m2;
    poll.expires_ns = choice.expires_ns;
    poll.picture = choice.picture_wanted ? config_.poll_picture : protocol::PollPicture::kNone;
    poll.max_picture_bytes =
        choice.picture_wanted ? static_cast<std::uint32_t>(config_.polls.picture_bytes) : 0;
    polls.push_back(std::move(poll));
  }
  return polls;
}

std::optional<PollCoordinator::AcceptedAnswer> PollCoordinator::Accept(const PollAnswer& answer,
                                                                       std::int64_t now_ns) {
  const std::optional<PollScheduler::OpenPoll> poll = FindOpen(answer.poll, now_ns);
  if (!poll || !IsAcceptable(answer, *poll, now_ns) ||
      !allowance_.TakeEvidence(answer.vehicle_id, now_ns)) {
    return std::nullopt;
  }
  AcceptedAnswer accepted{&answer, static_cast<Slot>(poll->hazard), {}, {}};
  const ReportedFix fix{answer.stamp_ns, answer.vehicle_position, config_.sight.position_slack_m};
  if (places_.Challenge(answer.vehicle_id, fix)) {
    places_.Keep(now_ns);
    return std::nullopt;
  }
  if (!IsPictureWanted(answer, *poll)) return accepted;
  if (const auto cost = pictures_.Ask(answer.vehicle_id, answer.image, {}, now_ns)) {
    accepted.picture_cost = *cost;
    accepted.picture.format = imaging::FormatName(
        imaging::ReadImageHeader(answer.image.data(), answer.image.size())->format);
    accepted.picture.sha256 = images_.Put(answer.image, accepted.picture.format);
    images_.Publish();
  }
  return accepted;
}

/// A picture that nobody asked for, or a larger one, is not kept; the answer counts without it.
bool PollCoordinator::IsPictureWanted(const PollAnswer& answer,
                                      const PollScheduler::OpenPoll& poll) const {
  return answer.answer == PollAnswer::Answer::kYes && !answer.image.empty() &&
         poll.picture_wanted &&
         static_cast<double>(answer.image.size()) <= config_.polls.picture_bytes;
}

std::optional<PollScheduler::OpenPoll> PollCoordinator::FindOpen(const Uuid& poll,
                                                                 std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  return scheduler_.FindOpen(poll, now_ns);
}

/// The answer is believed as far as the zone can check it by itself.
bool PollCoordinator::IsAcceptable(const PollAnswer& answer, const PollScheduler::OpenPoll& poll,
                                   std::int64_t now_ns) const {
  const HazardRecord& record = state_.hazards.Record(static_cast<Slot>(poll.hazard));
  if (answer.vehicle_id != poll.vehicle_id || answer.hazard != record.uuid) return false;
  // Of an image taken since the poll, by a clock that is nearly right.
  const auto window_ns = static_cast<std::int64_t>(config_.sight.window_s * 1e9);
  const std::int64_t seen_ns = steps_.SeenNs(answer.stamp_ns, now_ns);
  if (seen_ns < poll.asked_ns - window_ns || seen_ns > now_ns + window_ns) return false;
  const std::size_t max_bytes = config_.limits.max_text_bytes;
  if (!answer.reason.empty() && !protocol::IsAcceptableText(answer.reason, max_bytes)) return false;
  if (!answer.drive_id.empty() && !protocol::IsAcceptableName(answer.drive_id, max_bytes)) {
    return false;
  }
  if (!geo::IsValid(answer.vehicle_position) || IsPlaceOfNoFix(answer.vehicle_position)) {
    return false;
  }
  if (WhyStampRefused(answer.stamp_ns, config_.limits, config_.limits.max_age_s, now_ns)) {
    return false;
  }
  if (!(answer.confidence >= 0 && answer.confidence <= 1)) return false;
  if (!answer.image.empty() && WhyPictureRefused(answer.image, config_.limits)) return false;
  if (answer.answer == PollAnswer::Answer::kCantSee) return true;
  return CouldSee(vehicles_.Track(answer.vehicle_id), seen_ns, record.estimate.position,
                  config_.sight);
}

void PollCoordinator::Apply(const AcceptedAnswer& accepted, ZoneTransaction& transaction) {
  const PollAnswer& answer = *accepted.answer;
  const Slot slot = accepted.slot;
  transaction.KeepAnswer(answer, state_.hazards.Record(slot).id);
  places_.Save(transaction.now_ns());
  steps_.PassTime(slot, transaction);
  PresenceRecord life = state_.hazards.Record(slot).life;
  const std::int64_t now_ns = transaction.now_ns();
  const Evidence evidence =
      steps_.EvidenceOf(KindOf(answer.answer), answer.vehicle_id, answer.stamp_ns, now_ns);
  const LifecycleUpdate step =
      steps_.lifecycle().Apply(steps_.ClassOf(slot), evidence, now_ns, life);
  if (!step.counted && !step.transition) return;
  const ZoneTransaction::Before before = transaction.BeforeOf(slot);
  if (!accepted.picture.sha256.empty()) state_.hazards.SetPicture(slot, accepted.picture);
  const bool yes = answer.answer == PollAnswer::Answer::kYes;
  const std::string reason = step.transition ? step.transition->reason
                             : yes           ? "a vehicle was asked and saw it"
                                             : "a vehicle was asked and did not see it";
  steps_.KeepAsEvent(slot, life, step, reason, before, transaction);
}

void PollCoordinator::Close(const AcceptedAnswer& accepted, std::int64_t now_ns) {
  places_.Keep(now_ns);
  const PollAnswer& answer = *accepted.answer;
  if (!accepted.picture.sha256.empty()) {
    pictures_.Spend(answer.vehicle_id, accepted.picture_cost, now_ns);
  }
  const auto picture_bytes = static_cast<double>(answer.image.size());
  const MutexLock lock(mutex_);
  scheduler_.Answered(answer.poll, config_.polls.poll_bytes + picture_bytes, now_ns);
}

}  // namespace livemap::zone
