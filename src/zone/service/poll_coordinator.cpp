#include "zone/service/poll_coordinator.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "common/time.h"
#include "imaging/image_header.h"
#include "protocol/text_rules.h"
#include "zone/admission/report_validation.h"

namespace livemap::zone {
namespace {

using protocol::PollAnswer;

/// More names than there are officials; of more the longest silent one starts anew.
constexpr std::size_t kMaxOfficials = 1000;

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
      frames_of_({TokenBucket({config.frames_per_hour, 3600.0})}, kMaxOfficials,
                 KeyedTokenBuckets<1>::Eviction::kAlways),
      scheduler_(config.polls, state.generator()) {}

void PollCoordinator::CheckFrame(Slot slot, const std::string& official, std::int64_t now_ns) {
  {
    const MutexLock lock(mutex_);
    if (!scheduler_.AsksForFrames()) {
      throw DecisionConflict("this zone asks for no whole frames (poll_frame_bytes)");
    }
    if (!scheduler_.HasHazard(slot)) {
      throw DecisionConflict("vehicles cannot be asked about this hazard");
    }
  }
  DropOldFrames(now_ns);
  const auto open = frames_.find(slot);
  if (open != frames_.end()) {
    throw DecisionConflict("a whole frame was asked for already, by " + open->second.official);
  }
  auto* bucket = frames_of_.Use(official, now_ns);
  if (bucket != nullptr && bucket->front().Take(1)) return;
  throw DecisionTooOften("you have asked for " +
                         std::to_string(std::lround(config_.frames_per_hour)) +
                         " whole frames within an hour, wait before you ask for another one");
}

void PollCoordinator::AskForFrame(std::uint64_t decision, Slot slot, const std::string& official,
                                  std::int64_t now_ns) {
  const FrameRequest request{decision, state_.hazards.Record(slot).uuid, official, now_ns,
                             now_ns + Nanoseconds(config_.frame_timeout_s)};
  frames_[slot] = request;
  const MutexLock lock(mutex_);
  scheduler_.AskForFrame(slot, request.until_ns, now_ns);
}

bool PollCoordinator::IsFrameOpen(std::uint64_t decision, std::int64_t now_ns) {
  DropOldFrames(now_ns);
  return std::any_of(frames_.begin(), frames_.end(),
                     [decision](const auto& each) { return each.second.decision == decision; });
}

void PollCoordinator::CancelFrame(std::uint64_t decision) {
  for (auto open = frames_.begin(); open != frames_.end(); ++open) {
    if (open->second.decision != decision) continue;
    const MutexLock lock(mutex_);
    scheduler_.ForgetFrame(open->first);
    frames_.erase(open);
    return;
  }
}

void PollCoordinator::RestoreFrames(std::int64_t now_ns) {
  const std::int64_t since_ns = now_ns - Nanoseconds(config_.frame_timeout_s);
  for (FrameRequest& request : state_.store.LoadFrameRequests(since_ns)) {
    const auto slot = state_.hazards.Find(request.hazard);
    if (!slot || request.asked_ns > now_ns) continue;
    request.until_ns = request.asked_ns + Nanoseconds(config_.frame_timeout_s);
    const MutexLock lock(mutex_);
    scheduler_.AskForFrame(*slot, request.until_ns, now_ns);
    frames_[*slot] = std::move(request);
  }
}

/// The scheduler drops them by itself.
void PollCoordinator::DropOldFrames(std::int64_t now_ns) {
  for (auto open = frames_.begin(); open != frames_.end();) {
    open = now_ns > open->second.until_ns ? frames_.erase(open) : std::next(open);
  }
}

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
    if (choice.frame_wanted) {
      poll.picture = protocol::PollPicture::kFullFrame;
      poll.max_picture_bytes = static_cast<std::uint32_t>(config_.polls.frame_bytes);
    } else if (choice.picture_wanted) {
      poll.picture = config_.poll_picture;
      poll.max_picture_bytes = static_cast<std::uint32_t>(config_.polls.picture_bytes);
    }
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
  AcceptedAnswer accepted{&answer, static_cast<Slot>(poll->hazard), {}, {}, 0};
  const ReportedFix fix{answer.stamp_ns, answer.vehicle_position, config_.sight.position_slack_m};
  if (places_.Challenge(answer.vehicle_id, fix)) {
    places_.Keep(now_ns);
    return std::nullopt;
  }
  if (IsFrameWanted(answer, *poll, now_ns)) {
    accepted.frame = frames_.at(accepted.slot).decision;
  } else if (!IsPictureWanted(answer, *poll)) {
    return accepted;
  }
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

/// A whole frame for a request that is still open, whatever the answer: an official looks at it.
/// Whoever cannot have seen the place brings none.
bool PollCoordinator::IsFrameWanted(const PollAnswer& answer, const PollScheduler::OpenPoll& poll,
                                    std::int64_t now_ns) {
  if (!poll.frame_wanted || answer.image.empty()) return false;
  if (static_cast<double>(answer.image.size()) > config_.polls.frame_bytes) return false;
  DropOldFrames(now_ns);
  const auto slot = static_cast<Slot>(poll.hazard);
  if (frames_.count(slot) == 0) return false;
  return answer.answer != PollAnswer::Answer::kCantSee ||
         CouldSee(vehicles_.Track(answer.vehicle_id), steps_.SeenNs(answer.stamp_ns, now_ns),
                  state_.hazards.Record(slot).estimate.position, config_.sight);
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
  const bool has_picture = !accepted.picture.sha256.empty();
  if (has_picture) transaction.KeepAnswerPicture(accepted.picture.sha256, accepted.frame);
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
  // A whole frame stands in the history: by the hazard's picture one decides at a glance.
  if (has_picture && accepted.frame == 0) state_.hazards.SetPicture(slot, accepted.picture);
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
  const bool frame_came = accepted.frame != 0 && !accepted.picture.sha256.empty();
  if (frame_came) frames_.erase(accepted.slot);
  const MutexLock lock(mutex_);
  if (frame_came) scheduler_.ForgetFrame(accepted.slot);
  scheduler_.Answered(answer.poll, config_.polls.poll_bytes + picture_bytes, now_ns);
}

}  // namespace livemap::zone
